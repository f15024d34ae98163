"""Loading and compiling what a transfer in service mode needs, before anybody waits for it."""

from __future__ import annotations

import numpy as np

from app.domain.problem import Problem
from app.learning.checkpoints.checkpoint import verify
from app.learning.checkpoints.source_policies import Source
from app.learning.compute.threads import one_thread
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.parameters import TransferQmixParameters
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.network.architecture import UniversalConfig
from app.learning.universal.request.transfer import UniversalTransfer
from app.simulation.arrays import compile_problem
from app.simulation.stacks import without_reloads
from app.solvers.protocol import Solution, SourcePolicy
from app.solvers.stop import never


def warm_up(problem: Problem) -> None:
    """Transfer a policy that knows nothing, with every part of a request that is there by default.

    Parameters
    ----------
    problem
        Small; somebody can fly somewhere.
    """
    solution = _transfer(problem, TransferQmixParameters(samples=2, n_epochs=1, polish_moves=100))
    if solution.checkpoint is None:
        raise ValueError("somebody must be able to fly somewhere in the problem")
    verify(solution.checkpoint, problem)


def warm_up_the_rest(problem: Problem) -> None:
    """Do what is asked for seldom: replans, and policies of the architecture before; see :func:`warm_up`."""
    _transfer(problem, TransferQmixParameters(samples=0, replans=8, n_epochs=0, polish=False))
    before = UniversalPolicy.of_seed(UniversalConfig(width=8, layers=1, qmix_hidden_dim=4), seed=0)
    with one_thread():
        before.play(without_reloads(compile_problem(problem)), np.zeros(1, np.int64))


def _transfer(problem: Problem, parameters: TransferQmixParameters) -> Solution:
    policy = PairwisePolicy.of_seed(PairwiseConfig(width=8, layers=1, qmix_hidden_dim=4), seed=0)
    with one_thread():
        transfer = UniversalTransfer(problem, parameters, 0, never, lambda _progress: None)
        return transfer.run([Source(SourcePolicy("", "", 0.0), policy)])
