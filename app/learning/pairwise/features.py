"""What the policy sees, by name: the only place that says which features there are, and in which order.

Every number is a ratio: distances over the span, rewards over the largest level, times over the time in which
a UAV of mean speed crosses the span, amounts over other amounts. So nothing depends on units, or on how UAVs,
areas, bases and materials are numbered. In the meanings below,

- *over span*: over the longest leg of the problem, at most 10.
- *Over time*: over the time in which a UAV flies as far as the span, at the mean speed of those that have not
  returned at the beginning; clipped to 0…4 where nothing else is said.
- *Squashed*, a reward: divided by the largest level of the areas that need something at the beginning, and
  then x / (1 + abs(x)).
- *Share*: of amounts of all materials together; at most 1, and 0 of nothing.
- A visit or a reload is *possible* by the rules. What a visit brings is its *value*, what its leg loses its
  *cost*, and the difference its *net*.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Self


class _Column(IntEnum):
    """Columns, counted from 0; each is declared with its meaning."""

    meaning: str

    def __new__(cls, meaning: str) -> Self:
        column = int.__new__(cls, len(cls.__members__))
        column._value_, column.meaning = len(cls.__members__), meaning
        return column


class UavFeature(_Column):
    """What is seen of a UAV."""

    OUT = "1 until it has landed for good"
    ACTED = "1 if it has acted in this step, or has landed for good"
    VISITS = "visits that are possible, over N"
    BEST = "the largest net of them, squashed; −1 if there is none"
    SECOND = "the second largest, squashed; −1 if there is none"
    LOAD_OF_MOST = "share: what it carries, of the most that a UAV carries that is out"
    LOAD_LEFT = "share: what it carries, of the most that it may carry of each material"
    LOAD_WANTED = "share: what it carries, material by material at most what is needed, of what it carries"
    RANGE_LEFT = "range that it has left in this flight, over span, clipped to 0…4"
    HOME = "way to where it would land, over span; 0 once it has"
    HOME_COST = "reward lost for that way, squashed; 0 if the way home is not charged"
    CLOCK = "its clock, over time"
    AHEAD = "its clock after the first clock of those that are out, over time"
    SPEED = "its speed over that mean, clipped to 0…4"
    AIR_LEFT = (
        "endurance left or, if less, time until it must have landed, over time, clipped to −1…4; 4: no limit"
    )
    RELOADS = "1 if one of its reloads is allowed"
    AFTER_RELOAD = "the largest best_then of its reloads; 0 if there is none"
    STEPS_LEFT = "steps left with this one, of all"
    ONE_OVER_STEPS = "1 over the steps left with this one"
    LAST_STEP = "1 in the last step"
    RETURN_CHARGED = "1 if the way home is charged"
    MUST_RETURN = "1 if range has to suffice for the way home"
    UAVS_OF_ALL = "M / (M + N)"
    ONE_OVER_AREAS = "1 / N"
    COVERED = "share: of all that is needed, what those that are out carry, material by material"
    SUPPLY_WANTED = "share: the same amount, of all that those that are out carry"
    DISTANCE_WEIGHT = "reward lost for a way as long as the span, squashed"
    SWARM_OUT = "UAVs that are out, over M"
    SWARM_ACTED = "UAVs that are out and have acted in this step, over M"
    DECAY = "x / (1 + x) of x, the time over the half-life; 0 if nothing decays"
    BONUS = "x / (1 + x) of x, the minimum_weight − 1; 0 if no first share earns more"
    MAKESPAN_WEIGHT = "reward lost for a makespan of the time, squashed"
    CHANGE_WEIGHT = "reward lost for a visit of start_plan that is not made, squashed"
    HAS_BASES = "1 if the problem has bases"


class AreaFeature(_Column):
    """What is seen of an area."""

    NEEDS = "1 if it still needs something"
    NEED_LEFT = "share: what it needs now, of what it needed at the beginning"
    NEED_SHARE = "share: what it needs now, of what all areas do"
    LEVEL = "what meeting its need of the beginning brings at once, over the largest level; 0 of no need"
    LEVEL_DECADES = "its decimal logarithm over 4, at least −1"
    WORTH = "level times need_left"
    HAS_DEADLINE = "1 if there is one"
    DEADLINE = "deadline after the first clock of those that are out, over time, clipped to −1…4; 4: none"
    EARLIEST = "earliest time after that clock, over time"
    SERVICE = "service time, over time"
    ABLE = "UAVs whose visit is possible, over M"
    SUPPLY = "x / (1 + x) of x, what they would unload if each came first, added up, over what it needs"
    BEST = "the largest net of their visits, squashed; −1 if there is none"
    SECOND = "the second largest, squashed; −1 if there is none"
    CHOSEN = "1 if a UAV has chosen it in this step"
    NEIGHBOUR = "way to the nearest other area that needs something, over span; 10: none (note 1)"


class BaseFeature(_Column):
    """What is seen of a base."""

    STOCK = "share: of all that is needed, what it has in stock, material by material"
    UNLIMITED = "1 if it has as much as is asked for"
    TURNAROUND = "turnaround, over time"


class VisitFeature(_Column):
    """What is seen of a UAV and an area: of a visit. All but the distance is 0 if it is not possible."""

    ALLOWED = "1 if it is possible and in order (note 4)"
    DISTANCE = "length of the leg, over span; 10 once the UAV has landed for good"
    COST = "its cost, squashed"
    VALUE = "its value, squashed"
    NET = "its net, squashed"
    SHARE_OF_NEED = "share: what it would unload, of what the area needs"
    SHARE_OF_LOAD = "share: the same, of what the UAV carries"
    RANGE_SLACK = "range left after it, and after the way home if compulsory, over span, clipped to −1…3"
    HOME_THEN = "way from the area to where the UAV would land, over span"
    DETOUR = "distance and home_then together less the way home from here, over span, clipped to −10…10"
    DEADLINE_SLACK = "time from arrival to the deadline, over time, clipped to −1…4; 4: no deadline"
    FLIGHT_TIME = "time of the leg, over time"
    WAIT = "time from arrival to the earliest time, over time"
    AIR_SLACK = "the UAV's air_left after it, and after the way home if compulsory; 4: no limit"
    FOLLOW_UP = "the largest net of a visit after it, 0 or more, squashed; 0 in the last step (note 2)"
    NET_WITH_FOLLOW_UP = "the net of both together, squashed"
    LEAD_OVER_RIVALS = "net less the largest of other UAVs' visits to the area, 0 or more, squashed"
    LEAD_OVER_ELSEWHERE = "net less the largest of the UAV's visits to other areas, 0 or more, squashed"
    SHARE_OF_VALUE = "value / (value + cost)"
    FILLS_NEED = "1 if it would unload all that the area needs"
    EMPTIES_LOAD = "1 if it would unload all that the UAV carries"
    REST_BY_RIVALS = (
        "share: of what the area would still need, what others would unload now; 1 if it is nothing"
    )
    NET_BY_TIME = "net over (0.05 + time until it has ended, over time, not clipped), squashed"
    BEFORE = "1 if start_plan has it, it has not been made, and changes cost reward"
    AROUND = "sum of the nets of visits after it above 0, times exp(−8 way over span), squashed (note 2)"
    FARTHER = "distance beyond that of the UAV's nearest possible visit, over span"
    CHOSEN = "1 if a UAV has chosen the area in this step"
    MATERIALS = "share: of what the area needs, that of materials of which the UAV carries any"


class ReloadFeature(_Column):
    """What is seen of a UAV and a base: of a reload. If it is not possible the distance is 10, all else 0."""

    ALLOWED = "1 if it is possible and in order (note 4)"
    DISTANCE = "length of the leg, over span"
    COST = "its cost, squashed"
    FLIGHT_TIME = "time of the leg, over time"
    TURNAROUND = "turnaround of the base, over time"
    LOADED = "share: what it would take, of what it leaves a base with at most"
    LOAD_THEN = "share: what it would carry then, of the same"
    LOADED_WANTED = "share: what it would take of what is needed and not aboard, by material, of the same"
    BEST_THEN = "the largest net of a visit after it, 0 or more, squashed (note 3)"
    LEAD_OVER_NOW = "the same less the largest net of a visit now, 0 or more, squashed"
    REACHED_THEN = "areas that it could visit after it, over those that need something (note 3)"
    RANGE_GAINED = "what it has flown in this flight, over span, clipped to 0…4"
    TIME_LEFT = (
        "time from the end of it until the UAV has to have landed, over time, clipped to −1…4; 4: no limit"
    )
    FARTHER_THAN_HOME = "distance less the way home from here, over span, clipped to −1…10"
