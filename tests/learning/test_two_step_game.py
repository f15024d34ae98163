"""The two-step game of the QMIX paper (Rashid et al. 2018, section 5.1), learned with the real learner.

Agent 0's first action chooses a matrix. In the first, every joint action earns 7; in the second, joint
actions earn 0, 1, 1 and 8. The best is 8. Who values the second matrix by what agents earn on average while
the other explores, or by a sum of one value an agent, sees less than 7 in it and takes the first.
"""

import numpy as np
import torch
from torch import nn

from app.domain.plan import Plan
from app.learning.paper.agent_network import AgentNetwork
from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.episode import Actor
from app.learning.paper.learner import Learner
from app.learning.paper.networks import QmixNetwork
from app.learning.paper.random_streams import random_streams
from app.learning.paper.replay_buffer import ReplayBuffer
from app.learning.paper.trainer import Incumbent, Trainer
from app.learning.parameters import TableParameters
from app.solvers.stop import never

SAFE = np.full((2, 2), 7.0)
RISKY = np.array([[0.0, 1.0], [1.0, 8.0]])


class TwoStepGame:
    sizes = NetworkSizes(n_agents=2, n_actions=2, own_features=1, common_features=3)
    max_steps = 2

    def reset(self):
        self.stage = 0

    @property
    def done(self):
        return self.stage == 3

    def observe(self, state, allowed):
        state[:] = 0.0
        state[2 + self.stage] = 1.0
        allowed[:] = True

    def step(self, values, draws, epsilon, actions):
        for i in range(2):
            explores = draws[i, 0] < epsilon
            actions[i] = int(draws[i, 1] * 2) if explores else int(values[i].argmax())
        if self.stage == 0:
            self.stage = 1 + int(actions[0])
            return 0.0
        matrix = (SAFE, RISKY)[self.stage - 1]
        self.stage = 3
        return float(matrix[tuple(actions)])

    def plan(self, actions):
        return Plan.of(actions, home=2)


class SumOfAgents(nn.Module):
    """The same agents, mixed by a plain sum."""

    def __init__(self, sizes, hidden_dim, generator):
        super().__init__()
        self.agent = AgentNetwork(sizes, hidden_dim, generator)
        self.unroll, self.step = self.agent.unroll, self.agent.step

    def mix(self, values, states):
        return values.sum(-1)


def learned_reward(network_of, seed):
    """Reward of the greedy policy after learning from random actions only."""
    parameters = TableParameters(
        n_epochs=750, evaluate_per_epoch=750, learning_starts=32, lr=2e-3, epsilon_end=1.0,
        update_target_params=50,
    )  # fmt: skip
    streams = random_streams(seed)
    network = network_of(streams.initialisation)
    learner = Learner(network, parameters.lr, parameters.gamma, parameters.grad_norm_clip)
    trainer = Trainer(
        explorer=Actor(TwoStepGame(), network),
        evaluator=Actor(TwoStepGame(), network),
        learner=learner,
        buffer=ReplayBuffer(parameters.buffer_size, TwoStepGame.sizes, 2),
        parameters=parameters,
        streams=streams,
    )
    training = trainer.run(Incumbent(Plan.empty(2, 2), -np.inf), never, lambda progress: None)
    return training.history.reward[-1]


def test_independent_learners_prefer_the_safe_matrix():
    """What a lone agent sees while the other explores: the average over the other's actions."""
    assert RISKY.mean(axis=1).max() < SAFE.mean(axis=1).max()
    assert RISKY.max() > SAFE.max()


def test_qmix_finds_the_best_joint_action():
    sizes = TwoStepGame.sizes
    assert learned_reward(lambda generator: QmixNetwork(sizes, 32, 16, generator), 0) == 8.0


def test_a_sum_of_agents_does_not():
    """So the mixing network is what finds it, not the game being easy."""
    sizes = TwoStepGame.sizes
    assert learned_reward(lambda generator: SumOfAgents(sizes, 32, generator), 0) == 7.0


def test_learned_values_of_the_risky_matrix_are_its_rewards():
    """Q_tot over all joint actions, against the matrix (Table 2b of the QMIX paper)."""
    generator = torch.Generator().manual_seed(3)
    network = QmixNetwork(TwoStepGame.sizes, 32, 16, generator)
    learner = Learner(network, lr=2e-3, gamma=0.99, grad_norm_clip=10.0)
    buffer, game = ReplayBuffer(100, TwoStepGame.sizes, 2), TwoStepGame()
    actor, rng = Actor(game, network), np.random.default_rng(0)
    for epoch in range(1000):
        buffer.add(actor.play(lambda steps: 1.0, 0, rng))
        learner.update(buffer.sample(32, rng))
        if epoch % 50 == 0:
            learner.update_target()
    states = torch.zeros(2, 4, 5)
    states[0, :, 2], states[1, :, 4] = 1.0, 1.0
    actions = torch.tensor([[[1, a]] * 2 for a in (0, 1)]).reshape(1, 4, 2).expand(2, 4, 2)
    with torch.no_grad():
        values = network.unroll(states, actions)[1]  # (4, 2, 2)
        joint = torch.tensor([[0, 0], [0, 1], [1, 0], [1, 1]])
        total = network.mix(values.gather(-1, joint.unsqueeze(-1)).squeeze(-1), states[1])
    assert np.abs(total.numpy() - RISKY.ravel()).max() < 0.6
