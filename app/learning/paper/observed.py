"""Which problems the paper's learners can take: those whose reward follows from what their networks observe.

What a visit earns and costs must follow from Eqs. 10 to 13: loads, needs, levels, positions, distance flown.
What is allowed need not: the masks say so at every turn, as they always did of deadlines. A field is refused
unless it is named here, so one that is new is refused until somebody has looked. ``ALGORITHMS.md`` has the
reasons field by field. Nothing here needs torch.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from app.domain.said import said
from app.domain.world_use import later_fields

_TAKEN = frozenset(
    {
        # What is allowed: the masks keep it.
        "uavs.endurance",
        "uavs.airborne",
        "uavs.reserve",
        "uavs.available_from",
        "uavs.available_until",
        "uavs.capacity",
        "uavs.skills",
        "uavs.excluded",
        "uavs.committed",
        "targets.earliest",
        "targets.skills",
        # Range is counted in air length, which is what `dis` is too; the reward is by length over ground.
        "wind",
        # What a material earns, by the share of a need that is left; the need is observed.
        "objective.minimum_share",
        "objective.minimum_weight",
        # By itself a plan that no answer is below.
        "start_plan",
        # Nothing without `matrices`.
        "uavs.location",
        "uavs.home_location",
        "uavs.profile",
        "targets.location",
        # Nothing without `bases`.
        "uavs.full_load",
        "uavs.bases",
        "objective.loading",
    }
)

_NO_CLOCK = said("the reward depends on the clock, which Eqs. 10 to 13 do not have")
_REASONS = {
    "bases": said("there is no action for a reload, and positions do not tell at which base a UAV lands"),
    "no_fly_zones": said("the reward counts the way round a zone, which positions do not tell"),
    "matrices": said(
        "the reward counts legs of a table, and the positions that are observed are for display"
    ),
    "objective.half_life": _NO_CLOCK,
    "objective.makespan_weight": _NO_CLOCK,
    "objective.change_weight": said(
        "the reward depends on which visits of `start_plan` were made, which Eqs. 10 to 13 do not have"
    ),
}
_UNKNOWN = said("the paper's observation (Eq. 13) and actions (section 3.2.3) have no place for it")


@cache
def unobserved() -> Mapping[str, str]:
    """Return the fields that are refused, by their names, each with why and what to do instead."""
    return {
        name: said(
            "the paper's learners cannot take `{field}`: {why}; `auto` takes it",
            field=name.rpartition(".")[2],
            why=_REASONS.get(name, _UNKNOWN),
        )
        for name in later_fields()
        if name not in _TAKEN
    }
