"""QMIX from scratch: Algorithm 1, or in service mode :mod:`app.learning.universal.request.from_scratch`."""

from __future__ import annotations

from app.domain.errors import ProblemTooLarge
from app.domain.problem import Problem
from app.domain.said import said
from app.learning.checkpoints.checkpoint import encode
from app.learning.checkpoints.checkpoint_time import CheckpointReserve
from app.learning.compute.threads import one_thread
from app.learning.paper.architecture import NetworkSizes, QmixConfig
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import Actor
from app.learning.paper.learner import Learner
from app.learning.paper.networks import QmixNetwork
from app.learning.paper.random_streams import RandomStreams, random_streams
from app.learning.paper.replay_buffer import ReplayBuffer
from app.learning.paper.trainer import Incumbent, Trainer, Training
from app.learning.parameters import LearningParameters, QmixParameters, TableParameters
from app.learning.universal.request.from_scratch import UniversalFromScratch, fits
from app.simulation.arrays import compile_problem
from app.solvers.protocol import Report, Solution, SolverContext, StopCriterion

MAX_TRAINING_BYTES = 2**30
"""Most memory that replay buffer and one update may take; workers share a machine."""

_ACTIVATIONS = 16
"""Numbers kept for the backward pass per hidden unit of an agent in a step; measured, rounded up."""


def require_memory(
    parameters: LearningParameters, sizes: NetworkSizes, max_steps: int, hidden_dim: int
) -> None:
    """Refuse a problem whose training would not fit into memory.

    Raises
    ------
    ProblemTooLarge
        If replay buffer and one update would take more than :data:`MAX_TRAINING_BYTES`.
    """
    stored = ReplayBuffer.bytes_needed(parameters.buffer_size, sizes, max_steps)
    batch = min(parameters.batch_size, parameters.buffer_size)
    rows = batch * max_steps * sizes.n_agents
    needed = stored + 4 * rows * (_ACTIVATIONS * hidden_dim + 4 * sizes.n_actions)
    if needed > MAX_TRAINING_BYTES:
        raise ProblemTooLarge(
            said(
                "{agents} agents with {actions} actions over {steps} steps, {stored} stored episodes and "
                "batches of {batch} take {needed} MiB; the limit is {limit} MiB",
                agents=sizes.n_agents,
                actions=sizes.n_actions,
                steps=max_steps,
                stored=parameters.buffer_size,
                batch=batch,
                needed=round(needed / 2**20),
                limit=round(MAX_TRAINING_BYTES / 2**20),
            )
        )


def qmix_config(problem: Problem, parameters: TableParameters) -> QmixConfig:
    """Return what fixes the networks' shapes."""
    return QmixConfig(
        problem.n_uavs,
        problem.n_targets,
        problem.n_materials,
        parameters.drqn_hidden_dim,
        parameters.qmix_hidden_dim,
    )


def train(
    problem: Problem,
    network: QmixNetwork,
    parameters: TableParameters,
    streams: RandomStreams,
    stop: StopCriterion,
    report: Report,
) -> Training:
    """Run Algorithm 1 from networks as they are; their weights are changed.

    Parameters
    ----------
    problem, parameters, streams, stop, report
        As in :class:`~app.learning.paper.trainer.Trainer`.
    network
        Networks for a problem of this size.
    """
    sizes = SwarmEnvironment(problem).sizes
    trainer = Trainer(
        explorer=Actor(SwarmEnvironment(problem), network),
        evaluator=Actor(SwarmEnvironment(problem), network),
        learner=Learner(network, parameters.lr, parameters.gamma, parameters.grad_norm_clip),
        buffer=ReplayBuffer(parameters.buffer_size, sizes, problem.max_steps),
        parameters=parameters,
        streams=streams,
    )
    return trainer.run(Incumbent.empty(problem), stop, report)


def metrics_of(training: Training) -> dict[str, float | int]:
    """Return what a checkpoint tells about its training.

    ``reward`` is the best plan's, ``greedy_reward`` that of the last greedy evaluation.
    """
    return {
        "reward": training.incumbent.reward,
        "greedy_reward": training.history.reward[-1],
        "epochs": training.epochs,
        "steps": training.steps,
    }


class Qmix:
    """Multi-agent Q-learning with a monotonic mixing network, from scratch.

    Parameters
    ----------
    parameters
        Table 1.
    context
        Not used: nothing is transferred.
    """

    def __init__(self, parameters: QmixParameters, context: SolverContext) -> None:  # noqa: ARG002 - the protocol's
        self._parameters = parameters

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """Train on the problem and return the best plan seen; see :class:`~app.solvers.protocol.Solver`.

        In service mode problems whose episodes are too long to learn from at once are left to Algorithm 1;
        the solution's parameters say so by their mode.

        Raises
        ------
        ProblemTooLarge
            If training would not fit into memory.
        """
        parameters = self._parameters
        if parameters.mode == "service" and fits(compile_problem(problem)):
            with one_thread():
                return UniversalFromScratch(problem, parameters, seed, stop, report).run()
        table, used = parameters.table(), parameters.in_paper()
        config = qmix_config(problem, table)
        require_memory(table, config.sizes, problem.max_steps, table.drqn_hidden_dim)
        streams = random_streams(seed)
        with one_thread():
            network = QmixNetwork(
                config.sizes, table.drqn_hidden_dim, table.qmix_hidden_dim, streams.initialisation
            )
            in_time = CheckpointReserve(stop, network)
            training = train(problem, network, table, streams, in_time, report)
            checkpoint = (
                encode(
                    network,
                    config=config,
                    task=problem,
                    algorithm="qmix",
                    seed=seed,
                    parameters=used,
                    metrics=metrics_of(training),
                )
                if in_time.checkpoint
                else None
            )
        return Solution(training.incumbent.plan, training.history, used, checkpoint=checkpoint)
