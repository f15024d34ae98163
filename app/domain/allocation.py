"""The answer to a problem: a plan with what it earns, who flies where with what, and what stays unmet."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True)
class Unmet:
    """A rescue area that does not get all it needs.

    Attributes
    ----------
    target_id
        The rescue area.
    remaining
        Amounts still needed after the plan, K of them.
    code
        The reason, for programs.
    reason
        The reason, for people, with its numbers.
    uav_id
        The UAV that could serve it, or comes closest to it; None where there is none.
    remedy
        What would change it, for people; None where nothing simple would.
    reward_change
        Change of the reward with one more visit to it once the remedy is there, or, without a remedy, as
        things are; None where that was not evaluated.
    verified
        Whether the reason was verified by flying the plan with that visit on the simulator.
    """

    target_id: str
    remaining: tuple[float, ...]
    code: str
    reason: str
    uav_id: str | None = None
    remedy: str | None = None
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
