"""The best plan of a small problem, with the proof that there is no better one."""

from __future__ import annotations

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.evaluation import reward_of
from app.solvers.bound.enumeration import Enumeration, is_tiny
from app.solvers.bound.instance import Instance, new_instance
from app.solvers.bound.joint_plans import JointPlans
from app.solvers.bound.tree import PROVEN, Tree
from app.solvers.bound.upper_bound import bound_without_sets, enumerate_sets, sets_are_few
from app.solvers.local_search.annealing import ROUNDING
from app.solvers.local_search.effort import default_moves
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import ExactParameters, LocalSearchParameters
from app.solvers.protocol import History, Progress, Proof, Report, Solution, SolverContext, StopCriterion
from app.solvers.stop import share_of_time

_SEARCH_SHARE = 0.1
"""Of the time limit, and of the progress bar, for the local search that finds the first incumbent."""

_SEARCH_SHARE_LARGE = 0.6
"""The same where target sets are too many, so that only the search makes the plan better."""


_ACTIONS_A_NODE = 500
"""Actions that stand for a node where all plans are flown: about as much work."""


class Exact:
    """A :class:`~app.solvers.protocol.Solver` for greedy unloading; an epoch is a node of the search tree.

    Branch and bound with the bounds of :mod:`app.solvers.bound`, from the local search's plan. Where a node
    has few plans left that could be better, the simulator flies them all; with reloads it flies all plans of
    a tiny problem.
    """

    def __init__(self, parameters: ExactParameters, context: SolverContext) -> None:
        self.parameters = parameters
        self._context = context

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`; the solution has a proof."""
        instance = new_instance(problem)
        few = is_tiny(instance.arrays) if problem.bases else sets_are_few(instance)
        share = _SEARCH_SHARE if few else _SEARCH_SHARE_LARGE

        def searching(progress: Progress) -> None:
            report(Progress(share * progress.fraction, 0, progress.best_reward, progress.incumbent))

        # With time to spare the proof is worth more than a longer search.
        search = LocalSearchParameters(moves=default_moves(instance.arrays) if few else None)
        limit = share_of_time(stop, share)
        plan = LocalSearch(search, self._context).solve(problem, seed, limit, searching).plan
        reward = reward_of(problem, plan)
        history = History()
        history.add(0, reward)
        if problem.bases:
            return self._with_bases(problem, instance, plan, history, stop, share, report)
        lower = reward / instance.scale
        sets = enumerate_sets(instance, stop)
        if sets is None:
            bound = max(reward, bound_without_sets(instance, lower, stop) * instance.scale)
            return Solution(plan, history, self.parameters, proof=_proof(bound, reward, instance.scale))
        joint = JointPlans(instance, sets, stop)
        tree = Tree(instance, sets, lower, joint)
        most = self.parameters.nodes
        while not tree.proven and not stop() and tree.nodes < most:
            tree.run(stop, tree.nodes + 1)
            if joint.actions is not None:
                found = Plan.of(joint.actions, problem.n_targets)
                earned = reward_of(problem, found)
                if earned > reward + ROUNDING * abs(reward):
                    plan, reward = found, earned
                    # Also where the node could not be closed.
                    tree.lower = max(tree.lower, earned / instance.scale)
                    history.add(tree.nodes, reward)
            fraction = share + (1.0 - share) * tree.nodes / most
            report(Progress(min(1.0, fraction), tree.nodes, reward, plan))
        if history.epoch[-1] < tree.nodes:
            history.add(tree.nodes, reward)
        bound = max(reward, tree.bound * instance.scale)
        return Solution(plan, history, self.parameters, proof=_proof(bound, reward, instance.scale))

    def _with_bases(
        self,
        problem: Problem,
        instance: Instance,
        plan: Plan,
        history: History,
        stop: StopCriterion,
        share: float,
        report: Report,
    ) -> Solution:
        """Fly all plans of a tiny problem, and bound those of another one."""
        reward = history.reward[-1]
        plans = Enumeration(instance.arrays, reward) if is_tiny(instance.arrays) else None
        most = self.parameters.nodes
        for node in range(1, most + 1):
            if plans is None or plans.complete or stop():
                break
            plans.run(stop, node * _ACTIONS_A_NODE)
            if plans.actions is not None:
                plan = Plan.of(plans.actions, problem.n_targets)
                reward, plans.actions = reward_of(problem, plan), None
                history.add(node, reward)
            report(Progress(share + (1.0 - share) * node / most, node, reward, plan))
        bound = reward
        if plans is None or not plans.complete:
            bound = max(reward, bound_without_sets(instance, reward / instance.scale, stop) * instance.scale)
        return Solution(plan, history, self.parameters, proof=_proof(bound, reward, instance.scale))


def _proof(bound: float, reward: float, scale: float) -> Proof:
    return Proof(float(bound), bool(bound - reward <= 2.0 * PROVEN * scale))
