"""The answer to a problem: a plan with what it earns, its routes, and what stays unmet."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from app.domain.plan import Plan


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
        Its visits.
    """

    uav_id: str
    distance: float
    return_distance: float
    stops: tuple[Stop, ...]


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
    NOT_WORTH_IT = "not_worth_it"
    NOT_CHOSEN = "not_chosen"

    @property
    def meaning(self) -> str:
        """One sentence for it."""
        return _MEANINGS[self]


_MEANINGS = {
    UnmetCode.NO_SUPPLY: "No UAV that can be sent carries any of what it still needs.",
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

    ``reward = satisfaction - distance_weight * distance``; ``distance`` has the legs home only where the
    objective charges for them.
    """

    plan: Plan
    reward: float
    satisfaction: float
    distance: float
    distance_weight: float
    routes: tuple[Route, ...]
    unmet: tuple[Unmet, ...]
