"""Small policies for every size, and problems they are tried on."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import nn

from app.domain.problem import Problem
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.network.architecture import UniversalConfig
from app.simulation.generator import FAMILIES, generate

SMALL = PairwiseConfig(width=8, layers=2, qmix_hidden_dim=4)
SMALL_BEFORE = UniversalConfig(width=8, layers=2, qmix_hidden_dim=4)


def _larger(policy: nn.Module) -> None:
    """Make random weights larger than at the start of a training, so that they prefer something."""
    with torch.no_grad():
        for parameter in policy.parameters():
            parameter.mul_(2.0)


@pytest.fixture(scope="session")
def make_policy() -> Callable[..., PairwisePolicy]:
    def make(seed: int = 0, config: PairwiseConfig = SMALL) -> PairwisePolicy:
        policy = PairwisePolicy.of_seed(config, seed)
        _larger(policy)
        with torch.no_grad():
            # "Return" is worth what is worth nothing, so that about half of the visits are better.
            policy.agent.home_head.weight.zero_()
            policy.agent.home_head.bias.fill_(-5.0)
        return policy

    return make


@pytest.fixture
def policy(make_policy) -> PairwisePolicy:
    return make_policy()


@pytest.fixture(scope="session")
def make_before() -> Callable[..., UniversalPolicy]:
    def make(seed: int = 0, config: UniversalConfig = SMALL_BEFORE) -> UniversalPolicy:
        """Make a policy of the architecture before."""
        policy = UniversalPolicy.of_seed(config, seed)
        _larger(policy)
        with torch.no_grad():
            policy.agent.home.normal_(generator=torch.Generator().manual_seed(seed))
        return policy

    return make


@pytest.fixture
def before(make_before) -> UniversalPolicy:
    return make_before()


@pytest.fixture(scope="session")
def family_problems() -> list[Problem]:
    """One problem of every family."""
    return [generate(family, 5, 8, 3, np.random.default_rng([5, *family.encode()])) for family in FAMILIES]
