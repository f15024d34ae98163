"""Transfer-QMIX: a source policy of the library, carried over to a problem.

In paper mode Algorithm 2: the networks of the most similar source task of the same size, fine-tuned by
Algorithm 1. In service mode :mod:`app.learning.universal.request.transfer`.
"""

from __future__ import annotations

import copy
from typing import cast

import numpy as np

from app.domain.errors import InvalidParameters, Violation
from app.domain.problem import Problem
from app.domain.said import said
from app.learning.checkpoints.checkpoint import ANY_SIZE, encode
from app.learning.checkpoints.checkpoint_time import CheckpointReserve
from app.learning.checkpoints.source_policies import Source, SourcePolicies
from app.learning.compute.threads import one_thread
from app.learning.paper.networks import QmixNetwork
from app.learning.paper.random_streams import random_streams
from app.learning.parameters import TransferQmixParameters
from app.learning.qmix import metrics_of, qmix_config, require_memory, train
from app.learning.universal.episodes.best_plan import BestPlan
from app.learning.universal.episodes.effort import effort
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.request.polishing import polish
from app.learning.universal.request.transfer import UniversalTransfer, fill_in
from app.simulation.arrays import compile_problem
from app.solvers.greedy import greedy_plan
from app.solvers.protocol import Progress, Report, Solution, SolverContext, StopCriterion
from app.solvers.seeds import seed_sequence

_TUNING_SHARE = 0.5
"""Of the progress, where a local search follows the fine-tuning of a policy for one size."""


class TransferQmix:
    """Carries a source policy of the library over to the problem.

    Parameters
    ----------
    parameters
        Table 3, and what service mode adds.
    context
        Its library is where the source policies are.
    """

    def __init__(self, parameters: TransferQmixParameters, context: SolverContext) -> None:
        self._parameters = parameters
        self._context = context

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """Transfer, fine-tune and return the best plan seen; see :class:`~app.solvers.protocol.Solver`.

        Epoch 0 of the history is the source policy's greedy roll-out as it was found.

        Raises
        ------
        NoCompatibleSource
            If the library has no policy that fits: in paper mode for the same M, N, K and hidden units, in
            service mode for every size. ``details["sizes"]`` has the sizes there are.
        InvalidParameters
            If the `source` asked for does not exist or does not fit.
        ProblemTooLarge
            If fine-tuning would not fit into memory.
        """
        parameters, policies = self._parameters, SourcePolicies(self._context.library_url)
        config = qmix_config(problem, parameters.table())
        with one_thread():
            if parameters.mode == "paper":
                if parameters.source is None:
                    source = policies.most_similar(problem, config)
                else:
                    source = policies.asked_for(parameters.source, problem, config=config, any_size=False)
                return _fine_tune(problem, source, parameters, seed, stop, report)
            if parameters.source is None:
                sources = policies.shortlist(problem)
            else:
                sources = [policies.asked_for(parameters.source, problem, config=config, any_size=True)]
                _require_trainable(sources[0], parameters)
            if isinstance(sources[0].network, ANY_SIZE):
                transfer = UniversalTransfer(problem, parameters, seed, stop, report, self._other_threads)
                return transfer.run(sources)
            return _fine_tune_and_polish(problem, sources[0], parameters, seed, stop, report)

    def _other_threads(self) -> int:
        """How many threads may work beside this one now."""
        return self._context.threads - 1 + self._context.spare_threads()


def _require_trainable(source: Source, parameters: TransferQmixParameters) -> None:
    """Refuse fine-tuning that is asked for of a policy that is only played.

    Raises
    ------
    InvalidParameters
        If it is.
    """
    if parameters.n_epochs and isinstance(source.network, UniversalPolicy):
        detail = said(
            "n_epochs is {epochs}, and policy {id!r} is of an architecture that is played and not trained "
            "any more; ask for 0, or for another source",
            epochs=parameters.n_epochs,
            id=source.policy.id,
        )
        raise InvalidParameters(detail, [Violation("/parameters/n_epochs", detail)])


def _fine_tune(
    problem: Problem,
    source: Source,
    parameters: TransferQmixParameters,
    seed: int,
    stop: StopCriterion,
    report: Report,
) -> Solution:
    """Line 7 of Algorithm 2: copy the parameters of the source task, then Algorithm 1."""
    network = copy.deepcopy(cast(QmixNetwork, source.network))
    hidden = {name: getattr(network, name) for name in ("drqn_hidden_dim", "qmix_hidden_dim")}
    used = parameters.table().model_copy(update=hidden)
    config = qmix_config(problem, used)
    require_memory(used, config.sizes, problem.max_steps, used.drqn_hidden_dim)
    in_time = CheckpointReserve(stop, network)
    training = train(problem, network, used, random_streams(seed), in_time, report)
    parameters = parameters.model_copy(update=used.model_dump())
    learned = (
        encode(
            network,
            config=config,
            task=problem,
            algorithm="transfer_qmix",
            seed=seed,
            parameters=parameters,
            metrics=metrics_of(training),
        )
        if in_time.checkpoint
        else None
    )
    return Solution(training.incumbent.plan, training.history, parameters, source.policy, learned)


def _fine_tune_and_polish(
    problem: Problem,
    source: Source,
    parameters: TransferQmixParameters,
    seed: int,
    stop: StopCriterion,
    report: Report,
) -> Solution:
    """Service mode from a policy for one size: fine-tuned the paper's way, polished as any other."""
    arrays = compile_problem(problem)
    # One roll-out in one order, then the paper's updates: nothing of service mode's own.
    used = fill_in(parameters.model_copy(update={"orders": 1, "samples": 0, "replans": 0}), effort(arrays))
    paper = used.parameters.model_copy(update=dict.fromkeys(parameters.fixed_in_service))
    share = _TUNING_SHARE if used.polish_moves else 1.0

    def tell(progress: Progress) -> None:
        report(Progress(share * progress.fraction, progress.epoch, progress.best_reward, progress.incumbent))

    tuned = _fine_tune(problem, source, paper, seed, stop, tell)
    best = BestPlan(arrays)
    best.consider(tuned.plan.as_array()[None])
    if not used.is_bare:
        best.consider(greedy_plan(problem, stop).as_array()[None])
    epochs = tuned.history.epoch[-1]
    polish(
        arrays,
        best,
        used.polish_moves,
        np.random.default_rng(seed_sequence(seed)),
        stop,
        lambda done: report(Progress(share + (1 - share) * done, epochs, best.reward, best.plan)),
    )
    learned = tuned.checkpoint if used.n_epochs else None
    return Solution(best.plan, tuned.history, tuned.parameters, source.policy, learned)
