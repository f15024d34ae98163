"""Kinds of days, and days drawn from seeds: what is known in the morning, and what turns out.

Everything lies in a unit square. Six UAVs start from one depot; 24 areas need two materials. A UAV of mean
speed flies 0.9 in a unit of time. All ways cost, those home too, so that who flies home for want of
something to do pays for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Base

N_UAVS, N_AREAS, N_MATERIALS = 6, 24, 2
APPEARING_UNTIL = 2.4
"""Areas appear from the morning to this time, at times that are equally likely."""

FAILING = (0.2, 1.5)
"""Between these times UAVs are lost, at times that are equally likely."""

LAST_SURPRISE = max(APPEARING_UNTIL, FAILING[1])
"""Who looks at what may still turn out has nothing to look at later."""

SERVICE_TIME = 0.05
TURNAROUND = 0.1
DISTANCE_WEIGHT = 0.2
MAX_STEPS = 20
"""More than any route has, so that no plan is bound by it, however often steps count anew."""

_WRONG_NEEDS, _WRONG_LEVELS = (0.0, 0.4, 1.0, 1.8), (0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True)
class Kind:
    """What may turn out otherwise on a day of a kind.

    Attributes
    ----------
    appearing
        Share of the areas that nobody knows of in the morning.
    failing
        How many UAVs are lost.
    slowest
        A leg takes between 1 and this times as long as planned, each pair of UAV and stop its own number.
    wrong
        Share of the areas whose need and level are first reported wrongly.
    windows
        Whether areas take visits only in a short window of time, known when the area is.
    bases
        How many bases there are beside the depot, which is then one, too. UAVs carry half as much then, and
        have half the range.
    """

    appearing: float = 0.0
    failing: int = 0
    slowest: float = 1.0
    wrong: float = 0.0
    windows: bool = False
    bases: int = 0


KINDS: Mapping[str, Kind] = {
    "areas": Kind(appearing=0.5),
    "windows": Kind(appearing=0.5, windows=True),
    "reloads": Kind(appearing=0.5, bases=1),
    "failures": Kind(failing=2),
    "slow": Kind(slowest=2.0),
    "needs": Kind(wrong=0.5),
    "all": Kind(appearing=0.4, failing=1, slowest=1.5, wrong=0.3),
}
"""The kinds of days by name."""


@dataclass(frozen=True, slots=True)
class Day:
    """A day: what is known in the morning, and what turns out.

    Attributes
    ----------
    kind, seed
        What it was drawn from.
    problem
        What is known in the morning, without a plan.
    areas
        Every area of the day by its id, as it is.
    reports
        Every area as it is first reported.
    appears
        When each area becomes known that is not known in the morning.
    corrected
        When a message tells of each wrong report, unless somebody has been there before.
    lost
        When each UAV is lost that is.
    slowness
        How many times as long as planned the leg of a UAV to a stop takes, by their ids; 1 where none is
        given.
    """

    kind: str
    seed: int
    problem: Problem
    areas: Mapping[str, Target]
    reports: Mapping[str, Target]
    appears: Mapping[str, float] = field(default_factory=dict)
    corrected: Mapping[str, float] = field(default_factory=dict)
    lost: Mapping[str, float] = field(default_factory=dict)
    slowness: Mapping[tuple[str, str], float] = field(default_factory=dict)


def draw(kind: str, seed: int) -> Day:
    """Draw a day.

    Parameters
    ----------
    kind
        A name in :data:`KINDS`.
    seed
        0 or more.

    Raises
    ------
    KeyError
        If there is no such kind.
    """
    of = KINDS[kind]
    rng = np.random.default_rng([seed, *kind.encode()])
    depot = rng.random(2)
    uavs = tuple(_uav(f"uav-{i + 1}", depot, of, rng) for i in range(N_UAVS))
    places = [depot, *rng.random((of.bases, 2))] if of.bases else []
    bases = tuple(
        Base(f"base-{d + 1}", float(x), float(y), turnaround=TURNAROUND) for d, (x, y) in enumerate(places)
    )
    later = round(of.appearing * N_AREAS)
    times = np.sort(rng.uniform(0.0, APPEARING_UNTIL, later))
    since = [0.0] * (N_AREAS - later) + times.tolist()
    reports = [area(f"area-{j + 1}", time, of, rng) for j, time in enumerate(since)]
    areas = [_as_it_is(report, of, rng) for report in reports]
    heard = rng.uniform(0.1, 1.5, N_AREAS)
    lost = rng.choice(N_UAVS, of.failing, replace=False)
    failures = rng.uniform(*FAILING, of.failing)
    stops = [each.id for each in areas] + [each.id for each in bases]
    slowness = rng.uniform(1.0, of.slowest, (N_UAVS, len(stops)))
    return Day(
        kind,
        seed,
        Problem(
            uavs,
            tuple(report for report, time in zip(reports, since, strict=True) if time == 0.0),
            max_steps=MAX_STEPS,
            objective=Objective(distance_weight=DISTANCE_WEIGHT, charge_return=True),
            bases=bases,
        ),
        {each.id: each for each in areas},
        {each.id: each for each in reports},
        {report.id: time for report, time in zip(reports, since, strict=True) if time > 0.0},
        {
            report.id: time + float(later)
            for report, now, time, later in zip(reports, areas, since, heard, strict=True)
            if report != now
        },
        {uavs[i].id: float(time) for i, time in zip(lost.tolist(), failures, strict=True)},
        {
            (uav.id, stop): float(slowness[i, s])
            for i, uav in enumerate(uavs)
            for s, stop in enumerate(stops)
            if of.slowest > 1.0
        },
    )


def area(identifier: str, since: float, kind: Kind, rng: np.random.Generator) -> Target:
    """Draw an area as it is reported at a time; its deadline lies after that time."""
    x, y = rng.random(2)
    need = rng.integers(1, 6, N_MATERIALS)
    level = int(rng.integers(1, 6)) / 5
    earliest = since + float(rng.uniform(0.3, 1.2)) if kind.windows else 0.0
    patience = rng.uniform(0.2, 0.5) if kind.windows else rng.uniform(0.8, 2.2)
    return Target(
        identifier,
        float(x),
        float(y),
        level,
        tuple(map(float, need)),
        deadline=max(since, earliest) + float(patience),
        service_time=SERVICE_TIME,
        earliest=earliest,
    )


def _uav(identifier: str, depot: npt.NDArray[np.float64], kind: Kind, rng: np.random.Generator) -> UAV:
    half = 0.5 if kind.bases else 1.0
    x, y = map(float, depot)
    load = tuple(map(float, np.ceil(half * rng.integers(10, 17, N_MATERIALS))))
    return UAV(
        identifier, x, y, x, y, float(rng.uniform(0.6, 1.2)), half * float(rng.uniform(3.0, 5.0)), load
    )


def _as_it_is(report: Target, kind: Kind, rng: np.random.Generator) -> Target:
    """Draw what an area needs, and how urgently, if it is not what is reported."""
    need, level, wrong = rng.choice(_WRONG_NEEDS), rng.choice(_WRONG_LEVELS), rng.random()
    if wrong >= kind.wrong:
        return report
    loadlist = tuple(float(np.ceil(need * amount)) for amount in report.loadlist)
    return replace(report, level=float(level) * report.level, loadlist=loadlist)
