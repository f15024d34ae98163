"""Small games of the swarm, their networks and episodes, for the tests of the learners."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from app.domain.problem import Problem
from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import Actor
from app.learning.paper.exploration import EpsilonSchedule
from app.learning.paper.learner import Learner
from app.learning.paper.networks import QmixNetwork
from app.learning.paper.replay_buffer import ReplayBuffer
from app.simulation.generator import generate

ALWAYS_RANDOM = EpsilonSchedule(1.0, 1.0, 1)


@pytest.fixture(autouse=True)
def _single_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture
def problem() -> Problem:
    return generate("uniform", 3, 5, 2, np.random.default_rng(7))


@pytest.fixture
def make_network() -> Callable[[NetworkSizes], QmixNetwork]:
    def make(sizes: NetworkSizes, seed: int = 0) -> QmixNetwork:
        return QmixNetwork(sizes, 16, 8, torch.Generator().manual_seed(seed))

    return make


@pytest.fixture
def network(problem, make_network) -> QmixNetwork:
    return make_network(SwarmEnvironment(problem).sizes)


@pytest.fixture
def learner(network) -> Learner:
    return Learner(network, lr=5e-4, gamma=0.9, grad_norm_clip=10.0)


@pytest.fixture
def buffer(problem, network) -> ReplayBuffer:
    """Forty random episodes, of several lengths."""
    environment = SwarmEnvironment(problem)
    actor, rng = Actor(environment, network), np.random.default_rng(3)
    buffer = ReplayBuffer(40, environment.sizes, environment.max_steps)
    for _ in range(40):
        buffer.add(actor.play(ALWAYS_RANDOM, 0, rng))
    return buffer


@pytest.fixture
def batch(buffer):
    batch = buffer.sample(16, np.random.default_rng(5))
    assert len(set(batch.filled.sum(0).tolist())) > 1, "episodes of several lengths, so that there is padding"
    return batch
