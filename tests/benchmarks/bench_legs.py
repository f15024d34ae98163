"""How long legs take: 1,000 UAVs and 2,000 targets, with wind and without, round 20 zones or none.

Run: ``python tests/benchmarks/bench_legs.py``. One thread; figures are of one run each. ``prepared`` is the
union, sight of corners and the ways among them; ``ground`` all legs from UAVs to targets and among targets;
``flown`` air lengths and times of the same legs for one speed; ``detours`` the share of legs that are not
straight.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]

from app.travel.around_zones import LegsAroundZones  # noqa: E402
from app.travel.legs import Legs  # noqa: E402
from app.travel.straight import STILL_AIR, StraightLegs  # noqa: E402
from app.travel.wind import Wind  # noqa: E402

M, N, ZONES, CORNERS = 1000, 2000, 20, 10
Result = TypeVar("Result")


def scene(crs: str, rng: np.random.Generator) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return places and zones: stars of ten corners, some of which overlap; 100 km by 100 km on the globe."""
    places = rng.random((M + N, 2))
    zones = []
    for middle in rng.random((ZONES, 2)):
        angle = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)[:, None]
        radius = rng.uniform(0.03, 0.08, (CORNERS, 1))
        zones.append(middle + radius * np.hstack([np.cos(angle), np.sin(angle)]))
    if crs == "wgs84":
        place = np.array([85.0, 27.0])
        return place + places, [place + zone for zone in zones]
    return places, zones


def timed(work: Callable[[], Result]) -> tuple[float, Result]:
    """Return how many seconds some work takes, and what it returns."""
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


def main() -> None:
    """Print the table."""
    uavs, targets = np.arange(M), np.arange(M, M + N)
    print(f"{'':28} {'prepared':>9} {'ground':>9} {'flown':>9} {'detours':>9}  seconds")
    for crs in ("local", "wgs84"):
        places, zones = scene(crs, np.random.default_rng(1))
        for with_zones in (False, True):
            for wind in (STILL_AIR, Wind(12.0, 60.0)):

                def prepare(z: bool = with_zones, w: Wind = wind) -> Legs:
                    return LegsAroundZones(crs, places, zones, w) if z else StraightLegs(crs, places, w)  # noqa: B023

                prepared, legs = timed(prepare)
                ground, blocks = timed(
                    lambda found=legs: [found.between(a[:, None], targets) for a in (uavs, targets)]
                )
                flown, _ = timed(lambda found=blocks: [block.flown(50.0) for block in found])
                straight = StraightLegs(crs, places)
                longer = [
                    block.ground > straight.between(a[:, None], targets).ground * (1 + 1e-12)
                    for block, a in zip(blocks, (uavs, targets), strict=True)
                ]
                name = f"{crs}, {'zones' if with_zones else 'open'}, {'wind' if wind.speed else 'still'}"
                share = np.concatenate(longer).mean()
                print(f"{name:28} {prepared:>9.2f} {ground:>9.2f} {flown:>9.2f} {share:>9.2f}")


if __name__ == "__main__":
    main()
