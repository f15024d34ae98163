"""The answer to a problem: a plan with what it earns, its routes, and what stays unmet.

What only the world of a problem gives a meaning to (waiting, zones, wind, endurance, … : see
:func:`app.domain.world_use.uses_world`) is in classes of its own, so that an answer to a problem without any
of it does not have it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from app.domain.plan import Plan

Path = tuple[tuple[float, float], ...]
"""Points flown over, the first and the last place among them."""


@dataclass(frozen=True, slots=True)
class Stop:
    """One visit of a UAV.

    Attributes
    ----------
    target_id
        The rescue area.
    step
        Decision step, counted from 1.
    arrival_time
        Time units from now.
    distance
        Length of the leg flown to it.
    delivered
        Amounts unloaded, K of them.
    """

    target_id: str
    step: int
    arrival_time: float
    distance: float
    delivered: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Reload:
    """One landing of a UAV at a base, where it takes up material and flies on.

    Attributes
    ----------
    base_id
        The base.
    step, arrival_time, distance
        As of a visit.
    loaded
        Amounts taken up, K of them.
    departure_time
        When it may take off again.
    path
        Points flown over on the way to it; None where that is a straight line.
    kind
        Always ``reload``; visits of such problems have ``visit``.
    """

    base_id: str
    step: int
    arrival_time: float
    distance: float
    loaded: tuple[float, ...]
    departure_time: float
    path: Path | None
    kind: Literal["reload"] = "reload"


@dataclass(frozen=True, slots=True)
class Route:
    """What one UAV does: its stops in order, then home.

    Attributes
    ----------
    uav_id
        The UAV.
    distance
        Distance of the legs to its stops, without the leg home.
    return_distance
        Length of the leg home; 0 for a UAV that was already returning.
    stops
        Its visits, and reloads.
    """

    uav_id: str
    distance: float
    return_distance: float
    stops: tuple[Stop | Reload, ...]

    @property
    def visits(self) -> tuple[Stop, ...]:
        """Its visits alone."""
        return tuple(stop for stop in self.stops if isinstance(stop, Stop))


@dataclass(frozen=True, slots=True)
class TimedStop(Stop):
    """A visit in a world with more than places.

    Attributes
    ----------
    begin_time
        When unloading begins: on arrival, or after waiting.
    departure_time
        When the visit has ended.
    range_left
        Air length left on departure, of the whole ``voyage``.
    endurance_left
        Time in the air left on departure, of the whole ``endurance``; None where there is no limit.
    path
        Points flown over on the way to it; None where that is a straight line.
    """

    begin_time: float
    departure_time: float
    range_left: float
    endurance_left: float | None
    path: Path | None


@dataclass(frozen=True, slots=True)
class Visit(TimedStop):
    """A visit of a problem with bases, where there are other stops, too.

    Attributes
    ----------
    kind
        Always ``visit``.
    """

    kind: Literal["visit"] = "visit"


@dataclass(frozen=True, slots=True)
class Landing:
    """The end of a route.

    Attributes
    ----------
    time
        When the UAV has landed; where it need not return, when its last visit has ended.
    path
        Points flown over on the way home; None where that is a straight line, or it need not return.
    """

    time: float
    path: Path | None


@dataclass(frozen=True, slots=True)
class LandingSomewhere(Landing):
    """The end of a route where there are bases.

    Attributes
    ----------
    base_id
        The base at which the UAV has landed; None where that is its starting point, or it need not return.
    """

    base_id: str | None


@dataclass(frozen=True, slots=True)
class LandingRoute(Route):
    """A route in a world with more than places.

    Attributes
    ----------
    landing
        Its end; None for a UAV that does not fly.
    """

    landing: Landing | None


class UnmetCode(StrEnum):
    """Why a rescue area does not get all it needs, from what no plan could change to what another would."""

    NO_SUPPLY = "no_supply"
    SKILLS = "skills"
    EXCLUDED = "excluded"
    NO_FLY_ZONE = "no_fly_zone"
    WIND = "wind"
    OUT_OF_RANGE = "out_of_range"
    DEADLINE = "deadline"
    ENDURANCE = "endurance"
    TOO_EARLY_TO_WAIT = "too_early_to_wait"
    AVAILABLE_UNTIL = "available_until"
    COMMITTED = "committed"
    STEP_LIMIT = "step_limit"
    RANGE_USED = "range_used"
    TIME_USED = "time_used"
    LOADS_USED = "loads_used"
    STOCK = "stock"
    NO_TIME_FOR_RELOAD = "no_time_for_reload"
    NOT_WORTH_IT = "not_worth_it"
    NOT_CHOSEN = "not_chosen"

    @property
    def meaning(self) -> str:
        """One sentence for it."""
        return _MEANINGS[self]


_MEANINGS = {
    UnmetCode.NO_SUPPLY: "No UAV that can be sent carries any of what it still needs, or can load any.",
    UnmetCode.SKILLS: "No UAV that carries any of it has all the skills that the area asks for.",
    UnmetCode.EXCLUDED: "Every UAV that carries any of it must not be sent there.",
    UnmetCode.NO_FLY_ZONE: "No way leads there, or home from there, round the no-fly zones.",
    UnmetCode.WIND: "The wind is too strong to fly there, or home from there.",
    UnmetCode.OUT_OF_RANGE: "No UAV that carries any of it has the range to fly there, not even directly.",
    UnmetCode.DEADLINE: "No UAV with any of it and the range is there in time, not even directly.",
    UnmetCode.ENDURANCE: "A UAV that could bring some of it would be in the air for too long.",
    UnmetCode.TOO_EARLY_TO_WAIT: "A UAV that could bring some of it cannot wait in the air until it opens.",
    UnmetCode.AVAILABLE_UNTIL: "A UAV that could bring some of it would land too late.",
    UnmetCode.COMMITTED: "The UAVs that could bring some of it are committed to other visits first.",
    UnmetCode.STEP_LIMIT: "A UAV has some of it left over and lacks only a decision step for one more visit.",
    UnmetCode.RANGE_USED: "A UAV has some of it left over, but its other visits leave it too little range.",
    UnmetCode.TIME_USED: "A UAV has some of it left over, but its other visits leave too little time.",
    UnmetCode.LOADS_USED: "The UAVs that could serve it unload elsewhere all that it could use.",
    UnmetCode.STOCK: "What the UAVs carry of it is unloaded elsewhere, and the bases have none left.",
    UnmetCode.NO_TIME_FOR_RELOAD: "A base has some of it left, but no UAV the time to fetch it and bring it.",
    UnmetCode.NOT_WORTH_IT: "One more visit would cost more distance than it earns.",
    UnmetCode.NOT_CHOSEN: "One more visit would earn something; if it is not verified, nobody has looked.",
}


@dataclass(frozen=True, slots=True)
class LaterDeadline:
    """A deadline that would have to be later.

    Attributes
    ----------
    target_id
        The rescue area.
    by
        How much later, in time units.
    """

    target_id: str
    by: float


@dataclass(frozen=True, slots=True)
class Relaxation:
    """What a problem would have to allow more of.

    Attributes
    ----------
    more_load
        Amounts more aboard the UAV, K of them.
    more_range
        Range more of the UAV.
    more_steps
        Decision steps more.
    later_deadlines
        Deadlines that would have to be later.
    """

    more_load: tuple[float, ...]
    more_range: float = 0.0
    more_steps: int = 0
    later_deadlines: tuple[LaterDeadline, ...] = ()


@dataclass(frozen=True, slots=True)
class Unmet:
    """A rescue area that does not get all it needs.

    Attributes
    ----------
    target_id
        The rescue area.
    remaining
        Amounts still needed after the plan, K of them; 0 where they are only rounding.
    code
        The reason, for programs.
    reason
        The reason, for people, with its numbers.
    uav_id
        The UAV that could serve it, or comes closest to it; None where there is none.
    step
        The decision step, from 1, in which that UAV would visit it: in one that is taken its later visits
        come a step later. Where the plan has this visit already and more is to be aboard, no other is
        needed. None where nothing was evaluated.
    remedy
        What would change it, for people; None where nothing simple would.
    relaxation
        What the problem has to allow for the remedy, for programs; None where it is another plan, or none.
    reward_change
        Change of the reward with that visit once the remedy is there, or, without a remedy, as things are;
        visits that it makes illegal are left out. None where that was not evaluated.
    verified
        Whether the reason is verified: by the simulator's own comparisons, and where it depends on the plan
        by the exact reward of every single visit of any UAV at any place in its route.
    """

    target_id: str
    remaining: tuple[float, ...]
    code: UnmetCode
    reason: str
    uav_id: str | None = None
    step: int | None = None
    remedy: str | None = None
    relaxation: Relaxation | None = None
    reward_change: float | None = None
    verified: bool = False


@dataclass(frozen=True, slots=True)
class Allocation:
    """A plan and everything that follows from it by the rules of the specification.

    ``reward = satisfaction - distance_weight * distance``, less what makespan and changes cost where the
    objective says so; ``distance`` has the legs home only where the objective charges for them.
    """

    plan: Plan
    reward: float
    satisfaction: float
    distance: float
    distance_weight: float
    routes: tuple[Route, ...]
    unmet: tuple[Unmet, ...]


@dataclass(frozen=True, slots=True)
class TimedAllocation(Allocation):
    """An allocation in a world with more than places; reward is lost for the makespan and for changes too.

    Attributes
    ----------
    makespan
        When the last UAV with a visit has landed; 0 without visits.
    changes
        Pairs of UAV and area that are visited in ``start_plan`` and not in the plan.
    """

    makespan: float
    changes: int


@dataclass(frozen=True, slots=True)
class BaseLeft:
    """A base at the end of a plan.

    Attributes
    ----------
    base_id
        The base.
    stock
        Amounts left, K of them; None where there is as much as is asked for.
    """

    base_id: str
    stock: tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class SortieAllocation(TimedAllocation):
    """An allocation where there are bases.

    Attributes
    ----------
    bases
        What is left of each stock.
    """

    bases: tuple[BaseLeft, ...]
