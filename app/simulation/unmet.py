"""Why a rescue area does not get all it needs: a code and a sentence with numbers for each.

The reasons are tried from the hardest to the softest: what no plan could ever do from where the request has
the swarm, then what this plan's loads, ranges and clocks still allow at its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from app.domain.allocation import Unmet
from app.domain.problem import Problem
from app.simulation import simulator
from app.simulation.arrays import Floats, Integers, ProblemArrays

NO_SUPPLY = "no_supply"
OUT_OF_RANGE = "out_of_range"
DEADLINE = "deadline"
LOADS_USED = "loads_used"
NOT_WORTH_IT = "not_worth_it"
STEP_LIMIT = "step_limit"
NOT_CHOSEN = "not_chosen"


class _FollowingVisit(NamedTuple):
    """The best visit that could follow the plan at each target: ``uav`` (N,), -1 for none; ``gain`` (N,)."""

    uav: Integers
    gain: Floats


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
    following = _FollowingVisit(np.empty(problem.n_targets, np.int64), np.empty(problem.n_targets))
    _look_for_one_more(arrays, episodes, following)
    found = []
    for j, target in enumerate(problem.targets):
        remaining = episodes.need[0, j]
        if remaining.max() > 0:
            code, reason = _reason(arrays, episodes, j, visits, following)
            amounts = tuple(float(amount) for amount in remaining)
            found.append(Unmet(target.id, amounts, code, reason))
    return tuple(found)


def _reason(
    arrays: ProblemArrays,
    episodes: simulator.Episodes,
    j: int,
    visits: Sequence[int],
    following: _FollowingVisit,
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

    best = int(following.uav[j])
    if best < 0:
        return LOADS_USED, (
            f"{reaching.sum()} UAVs could serve it first; the plan uses their loads, range or time elsewhere"
        )
    gain = following.gain[j]
    if gain <= 0:
        return NOT_WORTH_IT, f"one more visit would cost {-gain:.6g} more in distance than it earns"
    if visits[best] >= arrays.max_steps[0]:
        return STEP_LIMIT, f"one more decision step would earn {gain:.6g} here"
    return NOT_CHOSEN, f"one more visit would earn {gain:.6g}; a better algorithm or more time finds it"


@simulator.compiled
def _look_for_one_more(
    arrays: ProblemArrays, episodes: simulator.Episodes, following: _FollowingVisit
) -> None:
    """Find the best visit after the plan to every target."""
    for j in range(arrays.level.shape[1]):
        following.uav[j] = -1
        for i in range(arrays.speed.shape[1]):
            if simulator.verdict(arrays, episodes, 0, i, j) != simulator.ALLOWED:
                continue
            unloaded = 0.0
            for k in range(arrays.load.shape[2]):
                unloaded += min(episodes.load[0, i, k], episodes.need[0, j, k])
            flown = simulator.leg_to(arrays, episodes, 0, i, j)
            if arrays.charge_return[0]:
                flown += arrays.home[0, i, j] - simulator.leg_home(arrays, episodes, 0, i)
            gain = arrays.level[0, j] * unloaded / arrays.need_total[0, j] - arrays.weight[0] * flown
            if following.uav[j] < 0 or gain > following.gain[j]:
                following.uav[j], following.gain[j] = i, gain
