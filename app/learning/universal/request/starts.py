"""Plans of the library's nearest policy, for a search to start from."""

from __future__ import annotations

import numpy as np

from app.domain.problem import Problem
from app.learning.checkpoints.checkpoint import ANY_SIZE
from app.learning.checkpoints.source_policies import SourcePolicies
from app.learning.compute.threads import one_thread
from app.learning.universal.episodes.effort import effort
from app.learning.universal.episodes.variety import roll_outs
from app.simulation.arrays import Integers, ProblemArrays
from app.simulation.simulator import new_episodes
from app.simulation.stacks import without_reloads
from app.solvers.protocol import SourcePolicy, StopCriterion
from app.solvers.seeds import seed_sequence


def policy_starts(
    problem: Problem, arrays: ProblemArrays, library_url: str | None, seed: int, stop: StopCriterion
) -> tuple[Integers, SourcePolicy] | None:
    """Roll the policy with the nearest source task out, in several ways.

    Parameters
    ----------
    problem, arrays
        The problem, and the stack of it alone, with its reloads.
    library_url
        Database of the policy library, or None.
    seed
        Of what makes the ways differ.
    stop
        Asked before every turn.

    Returns
    -------
    Integers
        Plans (B, S, M); one may be illegal, so replay them.
    SourcePolicy
        The policy. None instead of both where the nearest is not for every size, or nobody may go anywhere.

    Raises
    ------
    NoCompatibleSource
        If the library has no policy for every size.
    """
    source = SourcePolicies(library_url).shortlist(problem)[0]
    if not isinstance(source.network, ANY_SIZE):
        return None
    played = arrays if source.network.knows_reloads else without_reloads(arrays)
    if new_episodes(played, 1).done[0]:
        return None
    rng = np.random.default_rng(seed_sequence(seed))
    with one_thread():
        return roll_outs(source.network, played, effort(played).orders, rng, stop), source.policy
