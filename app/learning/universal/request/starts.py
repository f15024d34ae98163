"""Plans of the library's nearest policy, for a search to start from."""

from __future__ import annotations

import numpy as np

from app.domain.problem import Problem
from app.learning.checkpoints.source_policies import SourcePolicies
from app.learning.compute.threads import one_thread
from app.learning.universal.episodes.effort import effort
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.episodes.rollout import play_in_orders
from app.learning.universal.episodes.turn_order import some_orders
from app.simulation.arrays import Integers, ProblemArrays
from app.solvers.protocol import SourcePolicy, StopCriterion
from app.solvers.seeds import seed_sequence


def policy_starts(
    problem: Problem, arrays: ProblemArrays, library_url: str | None, seed: int, stop: StopCriterion
) -> tuple[Integers, SourcePolicy] | None:
    """Roll the policy with the nearest source task out greedily, in several orders of the UAVs.

    Parameters
    ----------
    problem, arrays
        The problem, and the stack of it alone.
    library_url
        Database of the policy library, or None.
    seed
        Of the orders.
    stop
        Asked before every turn.

    Returns
    -------
    Integers
        Plans (B, S, M); one may be illegal, so replay them.
    SourcePolicy
        The policy. None instead of both where the nearest is not for every size.

    Raises
    ------
    NoCompatibleSource
        If the library has no policy for every size.
    """
    source = SourcePolicies(library_url).shortlist(problem)[0]
    if not isinstance(source.network, UniversalPolicy):
        return None
    rng = np.random.default_rng(seed_sequence(seed))
    orders = some_orders(effort(arrays).orders, problem.n_uavs, rng)
    with one_thread():
        return play_in_orders(source.network.agent, arrays, orders, stop=stop), source.policy
