"""Why a rescue area does not get all it needs: a code, a sentence with numbers, and what would change it.

The reasons are tried from the hardest to the softest: what no plan could do from where the request has the
swarm, then what one more visit would do to this plan. Each is verified by flying the plan with that visit on
the simulator, first in the problem as it is, then with more load, range, time or steps. The most urgent areas
are first; where an answer has too many for all to be flown, the rest say that they were not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.domain.allocation import Unmet
from app.domain.problem import Problem
from app.simulation import simulator
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.counterfactual import Counterfactuals, Outcome
from app.simulation.openings import NONE, NOT_LOOKED, Facts, FlownPlan, gather

NO_SUPPLY = "no_supply"
OUT_OF_RANGE = "out_of_range"
DEADLINE = "deadline"
LOADS_USED = "loads_used"
RANGE_USED = "range_used"
NOT_WORTH_IT = "not_worth_it"
STEP_LIMIT = "step_limit"
NOT_CHOSEN = "not_chosen"


def unmet_targets(
    problem: Problem,
    arrays: ProblemArrays,
    episodes: simulator.Episodes,
    actions: Integers,
    delivered: Floats,
    reward: float,
    hurry: Callable[[], bool],
) -> tuple[Unmet, ...]:
    """List the targets with needs left at the end of a plan.

    Parameters
    ----------
    problem, arrays
        The problem, and the same as a stack of one.
    episodes
        One episode at the plan's end, every UAV still at its last stop.
    actions, delivered
        (S', M) joint actions and (S', M, K) what they unload.
    reward
        What the plan earns.
    hurry
        Once it is true, nothing more is looked for or flown.
    """
    m, n, _ = arrays.shape
    visiting = actions < n
    length = visiting.sum(axis=0)
    target = np.zeros((m, int(arrays.max_steps[0])), np.int64)
    target[:, : len(actions)] = np.where(visiting, actions, 0).T
    plan = FlownPlan(target, length, delivered, reward, episodes)
    remaining = episodes.need[0]
    open_targets = np.flatnonzero(remaining.max(axis=1) > 0)
    if not len(open_targets):
        return ()
    share = remaining[open_targets].sum(axis=1) / arrays.need_total[0, open_targets]
    urgent = open_targets[np.argsort(-arrays.level[0, open_targets] * share, kind="stable")]
    facts = gather(arrays, plan, urgent, hurry)
    planned = problem.objective.unloading == "planned"
    counterfactuals = Counterfactuals(arrays, target, length, planned, remaining.sum(axis=1), hurry)
    judge = _Judge(problem, arrays, plan, facts, counterfactuals)
    found = {int(j): judge.reason(int(j)) for j in urgent}
    return tuple(found[int(j)] for j in open_targets)


class _Judge:
    """Finds the reason for one target after the other."""

    def __init__(
        self,
        problem: Problem,
        arrays: ProblemArrays,
        plan: FlownPlan,
        facts: Facts,
        counterfactuals: Counterfactuals,
    ) -> None:
        self._problem, self._arrays, self._plan = problem, arrays, plan
        self._facts, self._fly = facts, counterfactuals
        self._least = 1e-9 * max(1.0, abs(plan.reward))

    def reason(self, j: int) -> Unmet:
        """Say why target `j` does not get all it needs."""
        facts, problem = self._facts, self._problem
        carrier, fastest = int(facts.carrier[j]), int(facts.fastest[j])
        if carrier < 0:
            return self._no_supply(j)
        if fastest < 0:
            lacks = float(facts.missing[j])
            says = f"no UAV that carries what it needs has the range: the best lacks {lacks:.6g}"
            remedy = f"range +{lacks:.6g} of {problem.uavs[carrier].id}"
            outcome = (
                None if self._fly.spent else self._fly.insert(carrier, 0, j, more_range=lacks * (1 + 1e-9))
            )
            return self._unmet(j, OUT_OF_RANGE, says, carrier, remedy, outcome)
        late = float(facts.late[j])
        latest = float(self._arrays.deadline[0, j])
        if late > abs(latest) * simulator.TOLERANCE:
            says = f"the fastest UAV that could serve it would arrive {late:.6g} after its deadline"
            remedy = f"a deadline {late:.6g} later"
            outcome = None if self._fly.spent else self._fly.insert(fastest, 0, j, deadline=latest + late)
            return self._unmet(j, DEADLINE, says, fastest, remedy, outcome)
        return self._one_more_visit(j)

    def _no_supply(self, j: int) -> Unmet:
        says = "no UAV that can be sent carries any of the materials still needed"
        ready = np.flatnonzero(~self._arrays.ret[0])
        if not len(ready):
            return self._unmet(j, NO_SUPPLY, says, -1, "a UAV that is not returning", None)
        nearest = int(ready[np.argmin(self._arrays.start_target[0, ready, j])])
        outcome = None
        if not self._fly.spent:
            place = int(self._plan.length[nearest])
            outcome = self._fly.insert(
                nearest, place, j, more_load=self._plan.episodes.need[0, j], more_steps=1
            )
            if not outcome.helps:
                outcome = self._fly.insert(nearest, 0, j, more_load=self._plan.episodes.need[0, j])
        remedy = f"{self._amounts(j)} aboard {self._problem.uavs[nearest].id}"
        return self._unmet(j, NO_SUPPLY, says, nearest, remedy, outcome)

    def _one_more_visit(self, j: int) -> Unmet:
        facts = self._facts
        i, place = int(facts.uav[j]), int(facts.place[j])
        if i == NOT_LOOKED:
            says = "a UAV with what it needs could be there in range; no time was left to look further"
            return self._unmet(j, NOT_CHOSEN, says, int(facts.fastest[j]), None, None)
        if i == NONE:
            says = "the UAVs that could serve it have used their loads, range or time elsewhere"
            return self._unmet(j, LOADS_USED, says, -1, None, None)
        uav = self._problem.uavs[i].id
        if self._fly.spent:
            guess = float(facts.guess[j])
            code = NOT_CHOSEN if guess > 0 else LOADS_USED
            says = f"one more visit, by {uav}, is guessed to change the reward by {guess:.6g}"
            return self._unmet(j, code, says, i, None, None)
        where = "first" if place == 0 else f"after {self._id(int(self._plan.target[i, place - 1]))}"
        now = self._fly.insert(i, place, j)
        gain = now.reward - self._plan.reward
        if gain > self._least:
            says = f"one more visit would earn {gain:.6g}; a better algorithm or more time finds it"
            return self._unmet(j, NOT_CHOSEN, says, i, f"{uav} flies there {where}", now)
        full = int(self._plan.length[i]) >= int(self._arrays.max_steps[0])
        if full:
            longer = self._fly.insert(i, place, j, more_steps=1)
            if longer.reward - self._plan.reward > self._least:
                says = f"one more decision step would earn {longer.reward - self._plan.reward:.6g} here"
                return self._unmet(j, STEP_LIMIT, says, i, "one more decision step", longer)
        lacks = float(facts.short[j])
        if lacks > 0:
            further = self._fly.insert(i, place, j, more_range=lacks * (1 + 1e-9), more_steps=int(full))
            if further.reward - self._plan.reward > self._least:
                says = (
                    f"{uav} would have to give up other visits for it: it lacks {lacks:.6g} of range for all"
                )
                step = " and one more decision step" if full else ""
                return self._unmet(j, RANGE_USED, says, i, f"range +{lacks:.6g} of {uav}{step}", further)
        needed = self._plan.episodes.need[0, j]
        loaded = self._fly.insert(
            i, place, j, more_load=needed, more_range=max(0.0, lacks) * (1 + 1e-9), more_steps=int(full)
        )
        remedy = None
        if loaded.reward - self._plan.reward > self._least:
            extras = [f"{self._amounts(j)} more aboard {uav}"]
            extras += [f"range +{lacks:.6g}"] if lacks > 0 else []
            extras += ["one more decision step"] if full else []
            remedy = ", ".join(extras)
        outcome = now if remedy is None else loaded
        if now.helps and now.elsewhere >= self._elsewhere(j) - self._least:
            says = f"one more visit would cost {max(0.0, -gain):.6g} more in distance than it earns"
            return self._unmet(j, NOT_WORTH_IT, says, i, remedy, outcome)
        says = "what there is serves as much elsewhere"
        if gain < 0:
            says = f"what there is serves more elsewhere: bringing it here would cost {-gain:.6g}"
        return self._unmet(j, LOADS_USED, says, i, remedy, outcome)

    def _elsewhere(self, j: int) -> float:
        """What the plan earns at other targets than `j`, without distance."""
        whole = float(self._arrays.need_total[0, j])
        met = whole - float(self._plan.episodes.need[0, j].sum())
        return float(self._plan.episodes.satisfaction[0]) - float(self._arrays.level[0, j]) * met / whole

    def _unmet(
        self, j: int, code: str, says: str, uav: int, remedy: str | None, outcome: Outcome | None
    ) -> Unmet:
        change = None if outcome is None else outcome.reward - self._plan.reward
        hard = code in (NO_SUPPLY, OUT_OF_RANGE, DEADLINE)
        verified = outcome is not None and (outcome.helps or not hard)
        return Unmet(
            target_id=self._id(j),
            remaining=tuple(self._plan.episodes.need[0, j].tolist()),
            code=code,
            reason=says,
            uav_id=None if uav < 0 else self._problem.uavs[uav].id,
            remedy=remedy,
            reward_change=change if verified else None,
            verified=verified,
        )

    def _id(self, j: int) -> str:
        return self._problem.targets[j].id

    def _amounts(self, j: int) -> str:
        left = self._plan.episodes.need[0, j]
        return " and ".join(f"{left[k]:.6g} of material {k + 1}" for k in np.flatnonzero(left > 0))
