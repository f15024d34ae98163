"""Why a rescue area does not get all it needs: a code and a sentence with numbers for each.

The reasons are tried from the hardest to the softest: what no plan could ever do from where the request has
the swarm, then what this plan's loads, ranges and clocks still allow at its end.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.domain.allocation import Unmet
from app.domain.problem import Problem
from app.simulation import simulator
from app.simulation.arrays import ProblemArrays

NO_SUPPLY = "no_supply"
OUT_OF_RANGE = "out_of_range"
DEADLINE = "deadline"
LOADS_USED = "loads_used"
NOT_WORTH_IT = "not_worth_it"
STEP_LIMIT = "step_limit"
NOT_CHOSEN = "not_chosen"


def unmet_targets(
    problem: Problem, arrays: ProblemArrays, episodes: simulator.Episodes, visits: Sequence[int]
) -> tuple[Unmet, ...]:
    """List the targets with needs left at the end of a plan.

    Parameters
    ----------
    problem, arrays
        The problem, and the same as a stack of one.
    episodes
        One episode at the plan's end, every UAV still at its last stop.
    visits
        Number of stops of each UAV in the plan.
    """
    found = []
    for j, target in enumerate(problem.targets):
        remaining = episodes.need[0, j]
        if remaining.max() > 0:
            code, reason = _reason(arrays, episodes, j, visits)
            amounts = tuple(float(amount) for amount in remaining)
            found.append(Unmet(target.id, amounts, code, reason))
    return tuple(found)


def _reason(
    arrays: ProblemArrays, episodes: simulator.Episodes, j: int, visits: Sequence[int]
) -> tuple[str, str]:
    wanted = episodes.need[0, j] > 0
    carriers = ~arrays.ret[0] & ((arrays.load[0] > 0) & wanted).any(axis=1)
    if not carriers.any():
        return NO_SUPPLY, "no UAV that can be sent carries any of the materials still needed"

    reach = arrays.dis[0] + arrays.start_target[0, :, j]
    if arrays.return_to_base[0]:
        reach = reach + arrays.home[0, :, j]
    reaching = carriers & (reach <= arrays.voyage[0] * (1 + simulator.TOLERANCE))
    if not reaching.any():
        missing = (reach - arrays.voyage[0])[carriers]
        return OUT_OF_RANGE, (
            f"no UAV that carries what it needs has the range: the best lacks {missing.min():.6g}"
        )

    arrival = np.where(reaching, arrays.start_target[0, :, j] / arrays.speed[0], np.inf)
    late = arrival.min() - arrays.deadline[0, j]
    if late > abs(arrays.deadline[0, j]) * simulator.TOLERANCE:
        return DEADLINE, f"the fastest UAV that could serve it would arrive {late:.6g} after its deadline"

    able = [
        i for i in range(len(reaching)) if simulator.verdict(arrays, episodes, 0, i, j) == simulator.ALLOWED
    ]
    if not able:
        return LOADS_USED, (
            f"{reaching.sum()} UAVs could serve it first; the plan uses their loads, range or time elsewhere"
        )
    gains = {i: _gain(arrays, episodes, i, j) for i in able}
    best = max(able, key=lambda i: gains[i])
    if gains[best] <= 0:
        return NOT_WORTH_IT, f"one more visit would cost {-gains[best]:.6g} more in distance than it earns"
    if visits[best] >= arrays.max_steps[0]:
        return STEP_LIMIT, f"one more decision step would earn {gains[best]:.6g} here"
    return (
        NOT_CHOSEN,
        f"one more visit would earn {gains[best]:.6g}; a better algorithm or more time finds it",
    )


def _gain(arrays: ProblemArrays, episodes: simulator.Episodes, i: int, j: int) -> float:
    """Reward of one more visit of UAV `i` to target `j` at the plan's end."""
    unloaded = np.minimum(episodes.load[0, i], episodes.need[0, j]).sum()
    flown = simulator.leg_to(arrays, episodes, 0, i, j)
    if arrays.charge_return[0]:
        flown += arrays.home[0, i, j] - simulator.leg_home(arrays, episodes, 0, i)
    return float(arrays.level[0, j] * unloaded / arrays.need_total[0, j] - arrays.weight[0] * flown)
