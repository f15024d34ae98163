"""Transfer-QMIX (Algorithm 2): the most similar source task's networks, fine-tuned by Algorithm 1."""

from __future__ import annotations

from typing import Any

import numpy as np

from app.domain.errors import InvalidParameters, NoCompatibleSource, Violation
from app.domain.problem import Problem
from app.learning.architecture import QMIX_PAPER_1, QmixConfig
from app.learning.checkpoint import Checkpoint, decode, encode
from app.learning.parameters import TransferQmixParameters
from app.learning.qmix import metrics_of, qmix_config, require_memory, train
from app.learning.random_streams import random_streams
from app.learning.threads import one_thread
from app.library.description import description_space, task_description
from app.solvers.protocol import Report, Solution, SolverContext, SourcePolicy, StopCriterion
from policy_store.database import Database
from policy_store.errors import PolicyNotFound
from policy_store.library import PolicyLibrary
from policy_store.similarity import squared_distances


class TransferQmix:
    """Copies the most similar source policy of the library and fine-tunes it on the problem.

    Parameters
    ----------
    parameters
        Table 3.
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
            If the library has no policy for the same M, N, K and hidden units; ``details["sizes"]`` has the
            sizes there are.
        InvalidParameters
            If the `source` asked for does not exist or does not fit.
        ProblemTooLarge
            If fine-tuning would not fit into memory.
        """
        parameters = self._parameters
        config = qmix_config(problem, parameters)
        require_memory(parameters, config.sizes, problem.max_steps, parameters.drqn_hidden_dim)
        source, checkpoint = self._source(problem, config)
        streams = random_streams(seed)
        with one_thread():
            network = checkpoint.network
            training = train(problem, network, parameters, streams, stop, report, count_updates=True)
            learned = encode(
                network,
                config=config,
                task=problem,
                algorithm="transfer_qmix",
                seed=seed,
                parameters=parameters,
                metrics=metrics_of(training),
            )
        return Solution(training.incumbent.plan, training.history, parameters, source, learned)

    def _source(self, problem: Problem, config: QmixConfig) -> tuple[SourcePolicy, Checkpoint]:
        if self._context.library_url is None:
            raise _no_source(problem, "there is no library", [])
        database = Database(self._context.library_url)
        try:
            library = PolicyLibrary(database)
            if self._parameters.source is not None:
                return _asked_for(library, self._parameters.source, problem, config)
            return _nearest(library, problem, config)
        finally:
            database.dispose()


def _nearest(library: PolicyLibrary, problem: Problem, config: QmixConfig) -> tuple[SourcePolicy, Checkpoint]:
    """Lines 1 to 6 of Algorithm 2, among the policies whose networks have this shape."""
    space, description = description_space(problem), task_description(problem)
    asked, neighbours = 1, library.nearest(space, description, 1, QMIX_PAPER_1)
    while True:
        for neighbour in neighbours:
            policy = neighbour.policy
            if policy.metadata.get("config") == config.as_record():
                source = SourcePolicy(policy.id, policy.name, neighbour.distance)
                return source, decode(library.checkpoint(policy.id))
        if len(neighbours) < asked:
            break
        # The nearest have other hidden units, which only requests that change the defaults meet.
        asked *= 8
        neighbours = library.nearest(space, description, asked, QMIX_PAPER_1)
    sizes = library.sizes(QMIX_PAPER_1)
    if neighbours:
        reason = f"none has {config.drqn_hidden_dim} and {config.qmix_hidden_dim} hidden units"
    else:
        reason = "the library has " + (", ".join(f"{m}x{n}x{k}" for m, n, k in sizes) or "none at all")
    raise _no_source(problem, reason, sizes)


def _asked_for(
    library: PolicyLibrary, policy_id: str, problem: Problem, config: QmixConfig
) -> tuple[SourcePolicy, Checkpoint]:
    try:
        policy = library.get(policy_id)
        space = description_space(problem)
        vector = library.vectors(policy_id).get(space)
        checkpoint = decode(library.checkpoint(policy_id)) if policy.architecture == QMIX_PAPER_1 else None
    except PolicyNotFound:
        raise _bad_source(f"there is no policy {policy_id!r} in the library") from None
    if checkpoint is None or checkpoint.config != config or vector is None:
        raise _bad_source(
            f"policy {policy_id!r} ({policy.architecture}, {_size(policy)}) does not fit a task of "
            f"{_size(problem)} with {config.drqn_hidden_dim} and {config.qmix_hidden_dim} hidden units"
        )
    query = task_description(problem).astype(np.float32)
    distance = float(squared_distances(vector[None], query)[0])
    return SourcePolicy(policy.id, policy.name, distance), checkpoint


def _size(item: Any) -> str:
    return f"{item.n_uavs}x{item.n_targets}x{item.n_materials}"


def _no_source(problem: Problem, reason: str, sizes: list[tuple[int, int, int]]) -> NoCompatibleSource:
    return NoCompatibleSource(
        f"no source policy for {_size(problem)} (UAVs x targets x materials): {reason}",
        details={"sizes": [list(size) for size in sizes]},
    )


def _bad_source(detail: str) -> InvalidParameters:
    return InvalidParameters(detail, [Violation("/parameters/source", detail)])
