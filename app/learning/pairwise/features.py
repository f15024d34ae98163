"""What the policy sees, by name: the only place that says which features there are, and in which order.

Every number is a ratio: distances over the span, rewards over the largest level, times over the time in which
a UAV of mean speed crosses the span, amounts over other amounts. So nothing depends on units, or on how UAVs,
areas, bases and materials are numbered.
"""

from __future__ import annotations

from enum import IntEnum, auto


class _Column(IntEnum):
    """Columns, counted from 0."""

    @staticmethod
    def _generate_next_value_(_name: str, _start: int, count: int, _last: list[int]) -> int:
        return count


class UavFeature(_Column):
    """What is seen of a UAV."""

    OUT = auto()
    ACTED = auto()
    VISITS = auto()
    BEST = auto()
    SECOND = auto()
    LOAD_OF_MOST = auto()
    LOAD_LEFT = auto()
    LOAD_WANTED = auto()
    RANGE_LEFT = auto()
    HOME = auto()
    HOME_COST = auto()
    CLOCK = auto()
    AHEAD = auto()
    SPEED = auto()
    AIR_LEFT = auto()
    RELOADS = auto()
    AFTER_RELOAD = auto()
    STEPS_LEFT = auto()
    ONE_OVER_STEPS = auto()
    LAST_STEP = auto()
    RETURN_CHARGED = auto()
    MUST_RETURN = auto()
    UAVS_OF_ALL = auto()
    ONE_OVER_AREAS = auto()
    COVERED = auto()
    SUPPLY_WANTED = auto()
    DISTANCE_WEIGHT = auto()
    SWARM_OUT = auto()
    SWARM_ACTED = auto()
    DECAY = auto()
    BONUS = auto()
    MAKESPAN_WEIGHT = auto()
    CHANGE_WEIGHT = auto()
    HAS_BASES = auto()


class AreaFeature(_Column):
    """What is seen of an area."""

    NEEDS = auto()
    NEED_LEFT = auto()
    NEED_SHARE = auto()
    LEVEL = auto()
    LEVEL_DECADES = auto()
    WORTH = auto()
    HAS_DEADLINE = auto()
    DEADLINE = auto()
    EARLIEST = auto()
    SERVICE = auto()
    ABLE = auto()
    SUPPLY = auto()
    BEST = auto()
    SECOND = auto()
    CHOSEN = auto()
    NEIGHBOUR = auto()


class BaseFeature(_Column):
    """What is seen of a base."""

    STOCK = auto()
    UNLIMITED = auto()
    TURNAROUND = auto()


class VisitFeature(_Column):
    """What is seen of a UAV and an area together: of a visit."""

    ALLOWED = auto()
    DISTANCE = auto()
    COST = auto()
    VALUE = auto()
    NET = auto()
    SHARE_OF_NEED = auto()
    SHARE_OF_LOAD = auto()
    RANGE_SLACK = auto()
    HOME_THEN = auto()
    DETOUR = auto()
    DEADLINE_SLACK = auto()
    FLIGHT_TIME = auto()
    WAIT = auto()
    AIR_SLACK = auto()
    FOLLOW_UP = auto()
    NET_WITH_FOLLOW_UP = auto()
    LEAD_OVER_RIVALS = auto()
    LEAD_OVER_ELSEWHERE = auto()
    SHARE_OF_VALUE = auto()
    FILLS_NEED = auto()
    EMPTIES_LOAD = auto()
    REST_BY_RIVALS = auto()
    NET_BY_TIME = auto()
    BEFORE = auto()
    AROUND = auto()
    FARTHER = auto()
    CHOSEN = auto()
    MATERIALS = auto()


class ReloadFeature(_Column):
    """What is seen of a UAV and a base together: of a reload."""

    ALLOWED = auto()
    DISTANCE = auto()
    COST = auto()
    FLIGHT_TIME = auto()
    TURNAROUND = auto()
    LOADED = auto()
    LOAD_THEN = auto()
    LOADED_WANTED = auto()
    BEST_THEN = auto()
    LEAD_OVER_NOW = auto()
    REACHED_THEN = auto()
    RANGE_GAINED = auto()
    TIME_LEFT = auto()
    LANDS_NEAR = auto()
