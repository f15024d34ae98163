"""What an event did to the plan in force, and how two plans differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from app.domain.allocation import LandingRoute, Reload, TimedStop
from app.domain.problem import TOLERANCE
from app.missions.state import Routes, Stop

GONE = {
    "uav_lost": "the UAV is lost",
    "area_cancelled": "the area was cancelled",
}
"""Rules by which a stop is dropped beside those of a plan, and what they say."""


@dataclass(frozen=True, slots=True)
class Broken:
    """A stop of the plan in force that cannot be made any more, and was dropped from it.

    Attributes
    ----------
    uav_id, stop
        Who does not stop where.
    rule, says
        The rule for programs (those of ``POST /evaluate``, and :data:`GONE`), and for people.
    needed, had
        What the stop needs of what the rule limits, and what there is; None where the rule has no figures.
    """

    uav_id: str
    stop: Stop
    rule: str
    says: str
    needed: float | None = None
    had: float | None = None


@dataclass(frozen=True, slots=True)
class Late:
    """A stop of the plan in force that is later than it was.

    Attributes
    ----------
    uav_id, stop
        Who stops where.
    arrival_time, planned
        When, and when before the event.
    """

    uav_id: str
    stop: Stop
    arrival_time: float
    planned: float


@dataclass(frozen=True, slots=True)
class Effect:
    """What an event did to the plan in force.

    Attributes
    ----------
    broken, late
        Stops that cannot be made any more, and those that are made later.
    reward_before, reward
        What the rest of the plan earned before the event, and earns after it.
    """

    broken: tuple[Broken, ...]
    late: tuple[Late, ...]
    reward_before: float
    reward: float

    @property
    def flyable(self) -> bool:
        """Whether the plan can be flown as it was."""
        return not self.broken

    def to_record(self) -> dict[str, Any]:
        """Return what answers have."""
        return {
            "flyable": self.flyable,
            "broken": [
                {
                    "uav_id": each.uav_id,
                    **each.stop.to_record(),
                    "rule": each.rule,
                    "says": each.says,
                    "needed": each.needed,
                    "had": each.had,
                }
                for each in self.broken
            ],
            "late": [
                {
                    "uav_id": each.uav_id,
                    **each.stop.to_record(),
                    "arrival_time": each.arrival_time,
                    "planned": each.planned,
                }
                for each in self.late
            ],
            "reward_before": self.reward_before,
            "reward": self.reward,
        }


def stop_of(stop: TimedStop | Reload) -> Stop:
    """Return where a stop of an answer is."""
    return Stop(stop.base_id, True) if isinstance(stop, Reload) else Stop(stop.target_id)


def later_stops(before: Iterable[LandingRoute], after: Iterable[LandingRoute]) -> tuple[Late, ...]:
    """Return the stops that are made in both plans, and later in the second one.

    A UAV that stops somewhere twice is told apart by the order.
    """
    planned = dict(_arrivals(before))
    return tuple(
        Late(key[0], key[1], time, planned[key])
        for key, time in _arrivals(after)
        if key in planned and time - planned[key] > TOLERANCE * max(1.0, abs(planned[key]))
    )


def _arrivals(routes: Iterable[LandingRoute]) -> Iterable[tuple[tuple[str, Stop, int], float]]:
    for route in routes:
        seen: Counter[Stop] = Counter()
        # From the end: what was done in between is at the beginning.
        for stop in reversed(route.stops):
            if not isinstance(stop, TimedStop | Reload):
                continue
            where = stop_of(stop)
            seen[where] += 1
            yield (route.uav_id, where, seen[where]), stop.arrival_time


def differences(uav_ids: Sequence[str], before: Routes, after: Routes) -> dict[str, Any]:
    """Return how two plans of the same UAVs differ; UAVs that are new have no stops in the first.

    Returns
    -------
    dict
        ``uavs``, those whose stops differ, each with ``before``, ``after``, and the visits that are ``added``
        and ``removed``; and ``visits_changed``, how many pairs of UAV and area are in only one of the plans.
    """
    changed = []
    total = 0
    for i, uav_id in enumerate(uav_ids):
        old = before[i] if i < len(before) else ()
        new = after[i] if i < len(after) else ()
        if old == new:
            continue
        added, removed = Counter(new) - Counter(old), Counter(old) - Counter(new)
        total += sum(n for stop, n in (added + removed).items() if not stop.is_base)
        changed.append(
            {
                "uav_id": uav_id,
                "before": [stop.to_record() for stop in old],
                "after": [stop.to_record() for stop in new],
                "added": [stop.to_record() for stop in added.elements()],
                "removed": [stop.to_record() for stop in removed.elements()],
            }
        )
    return {"uavs": changed, "visits_changed": total}
