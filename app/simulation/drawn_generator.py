"""Generated problems of no family: every property is drawn by itself, over powers of ten where it has them.

A search or a policy that is good on the families and not here is tuned to the families.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Base
from app.simulation.arrays import Floats


def drawn_size(
    rng: np.random.Generator, most_uavs: int = 40, most_targets: int = 150
) -> tuple[int, int, int]:
    """Draw M, N and K; small ones as often as large ones."""
    n_uavs = round(_log_uniform(rng, 1, most_uavs))
    n_targets = round(_log_uniform(rng, max(3, n_uavs / 2), min(most_targets, 30 * n_uavs)))
    return n_uavs, n_targets, int(rng.choice([1, 1, 2, 3, 3, 6]))


def drawn(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """Draw a problem of the size; a :data:`~app.simulation.generator.Family`."""
    day = _Day.draw(rng)
    places = _places(n_targets, rng)
    starts = _starts(n_uavs, rng)
    need = _needs(n_targets, n_materials, rng)
    load = _loads(need, n_uavs, day.alike, rng)
    level = _levels(n_targets, rng)
    # A leg between neighbours, if they lay evenly, and the way to the areas.
    spacing = _neighbour_distance(places)
    away = float(np.median(np.hypot(*(places[None] - starts[:, None]).transpose(2, 0, 1))))
    visits = _log_uniform(rng, 1.0, 25.0)
    there_and_back = 2.2 * away if day.returns else away
    ranges = (there_and_back + visits * spacing) * _varied(n_uavs, day.alike, 0.3, rng)
    speeds = _log_uniform(rng, 0.1, 100.0) * _varied(n_uavs, day.alike, 0.5, rng)
    # Time that a UAV takes for its range; windows and days are measured by it.
    day_time = float(np.median(ranges / speeds))
    service = day_time / max(visits, 2.0) * rng.uniform(0.0, 0.5) if rng.random() < 0.4 else 0.0
    flights = day.flights
    opens, closes = _windows(n_targets, day_time * flights, rng)
    targets = tuple(
        Target(
            f"area-{j + 1}",
            float(places[j, 0]),
            float(places[j, 1]),
            float(level[j]),
            tuple(need[j].tolist()),
            deadline=float(closes[j]) if np.isfinite(closes[j]) else None,
            service_time=float(service),
            earliest=float(opens[j]),
        )
        for j in range(n_targets)
    )
    uavs = tuple(
        UAV(
            f"uav-{i + 1}",
            float(starts[i, 0]),
            float(starts[i, 1]),
            float(starts[i, 0]),
            float(starts[i, 1]),
            float(speeds[i]),
            float(ranges[i]),
            tuple(load[i].tolist()),
            endurance=day_time * float(rng.uniform(0.7, 1.5)) if day.batteries else None,
            available_from=day_time * float(rng.uniform(0, 0.3)) if day.batteries else 0.0,
            available_until=day_time * flights if flights > 1 else None,
        )
        for i in range(n_uavs)
    )
    worth = float(np.median(level[need.sum(axis=1) > 0])) if need.any() else 1.0
    price = 0.0 if rng.random() < 0.2 else worth / (spacing + away / visits) * _log_uniform(rng, 0.003, 1.0)
    decaying, planned = rng.random() < 0.1, rng.random() < 0.1
    objective = Objective(
        distance_weight=price,
        return_to_base=day.returns,
        charge_return=bool(rng.random() < 0.2),
        unloading="planned" if planned and not decaying else "greedy",
        half_life=day_time * flights * float(rng.uniform(0.3, 2.0)) if decaying else None,
    )
    steps = int(np.clip(round(1.6 * visits * flights) + 2, 3, 40))
    problem = Problem(uavs=uavs, targets=targets, objective=objective, max_steps=steps)
    return _with_bases(problem, starts, need, day_time, rng) if flights > 1 else problem


@dataclass(frozen=True, slots=True)
class _Day:
    """What holds for all UAVs: whether they are alike, return, watch batteries; flights of each."""

    alike: bool
    returns: bool
    batteries: bool
    flights: int

    @staticmethod
    def draw(rng: np.random.Generator) -> _Day:
        flights = int(rng.integers(2, 7)) if rng.random() < 0.25 else 1
        return _Day(
            alike=bool(rng.random() < 0.3),
            returns=flights > 1 or bool(rng.random() < 0.8),
            batteries=bool(rng.random() < 0.15),
            flights=flights,
        )


def _places(n: int, rng: np.random.Generator) -> Floats:
    """Areas evenly, in clusters of any tightness, or along a road."""
    kind = rng.random()
    if kind < 0.4:
        return rng.random((n, 2))
    if kind < 0.8:
        centres = rng.random((max(1, round(_log_uniform(rng, 1, max(1, n / 3)))), 2))
        return centres[rng.integers(len(centres), size=n)] + rng.normal(
            0, _log_uniform(rng, 0.003, 0.2), (n, 2)
        )
    along = rng.random(n)
    return np.stack([along, 0.1 * np.sin(3 * along) + rng.normal(0, 0.03, n)], axis=1)


def _starts(m: int, rng: np.random.Generator) -> Floats:
    """All at one base, at a few, or each at its own; among the areas or up to five extents away."""
    count = int(rng.choice([1, 1, 2, 4, m]))
    bases = rng.random((count, 2))
    if rng.random() < 0.25:
        angle = rng.uniform(0, 2 * np.pi)
        bases = bases * 0.2 + _log_uniform(rng, 0.7, 5.0) * np.array([np.cos(angle), np.sin(angle)]) + 0.4
    return bases[rng.integers(count, size=m)] if count < m else rng.permutation(np.resize(bases, (m, 2)))


def _needs(n: int, k: int, rng: np.random.Generator) -> Floats:
    """Whole numbers or any, of one size or of many, of all materials or of some."""
    kind = rng.random()
    if kind < 0.4:
        need = rng.integers(0, 7, (n, k)).astype(np.float64)
    elif kind < 0.6:
        need = np.ones((n, k))
    else:
        need = np.asarray(np.exp(rng.normal(1.5, rng.uniform(0.2, 1.5), (n, k))).round(2))
    if k > 1 and rng.random() < 0.5:
        need[rng.random((n, k)) >= 0.6] = 0.0
    return need


def _loads(need: Floats, m: int, alike: bool, rng: np.random.Generator) -> Floats:
    """All together a fifth to ten times what is needed; each UAV carries all materials or one or two."""
    k = need.shape[1]
    each = np.maximum(need.sum(axis=0), 1.0) / m * _log_uniform(rng, 0.2, 10.0)
    load = each * (np.ones((m, k)) if alike else np.exp(rng.normal(0, rng.uniform(0.1, 1.0), (m, k))))
    if k > 1 and rng.random() < 0.3:
        carried = np.zeros((m, k), np.bool_)
        for i in range(m):
            carried[i, rng.choice(k, int(rng.integers(1, 3)), replace=False)] = True
        load = np.where(carried, load * k / 1.5, 0.0)
    whole = bool(rng.random() < 0.7)
    return np.asarray(np.ceil(load) if whole else load)


def _levels(n: int, rng: np.random.Generator) -> Floats:
    """All the same, up to 1, of classes or anything within powers of ten, or one that stands out."""
    kind = rng.random()
    if kind < 0.15:
        return np.ones(n)
    if kind < 0.45:
        return rng.integers(1, 6, n) / 5
    decades = rng.uniform(1.0, 4.0)
    if kind < 0.7:
        return 10.0 ** rng.uniform(-decades / 2, decades / 2, n)
    if kind < 0.85:
        return 10.0 ** (rng.integers(0, 4, n) * decades / 3 - 1)
    level = rng.uniform(0.2, 1.0, n)
    level[int(rng.integers(n))] *= 10.0**decades
    return level


def _windows(n: int, day_time: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """(N,) and (N,): when areas open and close; none, at some areas or at all."""
    opens, closes = np.zeros(n), np.full(n, np.inf)
    kind = rng.random()
    if kind < 0.6:
        return opens, closes
    bound = rng.random(n) < (1.0 if kind < 0.8 else 0.4)
    closes[bound] = rng.uniform(0.1, rng.uniform(0.4, 1.5), int(bound.sum())) * day_time
    if rng.random() < 0.4:
        opens = np.where(bound, np.maximum(closes - rng.uniform(0.1, 0.6, n) * day_time, 0.0), 0.0)
    return opens, closes


def _with_bases(
    problem: Problem, starts: Floats, need: Floats, day_time: float, rng: np.random.Generator
) -> Problem:
    """Add a base at every starting point, of limited stock or not, and one more perhaps."""
    points = np.unique(starts, axis=0)
    if rng.random() < 0.4:
        points = np.concatenate([points, rng.random((1, 2))])
    limited = rng.random() < 0.4
    share = rng.uniform(0.3, 1.5) / len(points)
    turnaround = day_time * float(rng.uniform(0.0, 0.2))
    bases = tuple(
        Base(
            f"base-{number + 1}",
            float(x),
            float(y),
            stock=tuple(np.round(need.sum(axis=0) * share).tolist()) if limited else None,
            turnaround=turnaround,
        )
        for number, (x, y) in enumerate(points[:5])
    )
    loads = 3.0 / problem.max_steps * np.array([uav.loadlist for uav in problem.uavs])
    uavs = tuple(
        replace(uav, loadlist=tuple(np.ceil(load).tolist()))
        for uav, load in zip(problem.uavs, loads, strict=True)
    )
    return replace(problem, uavs=uavs, bases=bases)


def _neighbour_distance(places: Floats) -> float:
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    nearest = apart.min(axis=1)
    return max(2.0 * float(np.mean(nearest[np.isfinite(nearest)])) if len(places) > 1 else 1.0, 1e-3)


def _varied(m: int, alike: bool, spread: float, rng: np.random.Generator) -> Floats:
    return np.ones(m) if alike else np.exp(rng.normal(0, spread, m))


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
