"""DQN over joint actions (section 4.1, Eq. 15): what the paper compares QMIX with, for small problems."""

from __future__ import annotations

from app.domain.problem import Problem
from app.learning.compute.threads import one_thread
from app.learning.paper.episode import Actor
from app.learning.paper.joint_environment import JointEnvironment
from app.learning.paper.joint_network import JointNetwork
from app.learning.paper.learner import Learner
from app.learning.paper.random_streams import random_streams
from app.learning.paper.replay_buffer import ReplayBuffer
from app.learning.paper.trainer import Incumbent, Trainer
from app.learning.parameters import DqnParameters
from app.learning.qmix import require_memory
from app.solvers.protocol import Report, Solution, SolverContext, StopCriterion


class Dqn:
    """Q-learning over the joint action space.

    Parameters
    ----------
    parameters
        Table 1's, as far as they apply.
    context
        Not used: nothing is transferred.
    """

    def __init__(self, parameters: DqnParameters, context: SolverContext) -> None:  # noqa: ARG002 - the protocol's
        self._parameters = parameters

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """Train on the problem and return the best plan seen; see :class:`~app.solvers.protocol.Solver`.

        Raises
        ------
        ProblemTooLarge
            If there are too many joint actions, or training would not fit into memory.
        """
        parameters = self._parameters
        environment = JointEnvironment(problem)
        sizes = environment.sizes
        require_memory(parameters, sizes, problem.max_steps, parameters.hidden_dim)
        streams = random_streams(seed)
        with one_thread():
            network = JointNetwork(sizes, parameters.hidden_dim, streams.initialisation)
            trainer = Trainer(
                explorer=Actor(environment, network),
                evaluator=Actor(JointEnvironment(problem), network),
                learner=Learner(network, parameters.lr, parameters.gamma, parameters.grad_norm_clip),
                buffer=ReplayBuffer(parameters.buffer_size, sizes, problem.max_steps),
                parameters=parameters,
                streams=streams,
            )
            training = trainer.run(Incumbent.empty(problem), stop, report)
        return Solution(training.incumbent.plan, training.history, parameters)
