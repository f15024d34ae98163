"""Small policies for every size, and problems they are tried on."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from app.domain.problem import Problem
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.network.architecture import UniversalConfig
from app.simulation.generator import FAMILIES, generate

SMALL = UniversalConfig(width=8, layers=2, qmix_hidden_dim=4)


@pytest.fixture(scope="session")
def make_policy() -> Callable[..., UniversalPolicy]:
    def make(seed: int = 0, config: UniversalConfig = SMALL) -> UniversalPolicy:
        """Random weights, larger than at the start of a training so that they prefer something."""
        policy = UniversalPolicy.of_seed(config, seed)
        with torch.no_grad():
            for parameter in policy.parameters():
                parameter.mul_(2.0)
            policy.agent.home.normal_(generator=torch.Generator().manual_seed(seed))
        return policy

    return make


@pytest.fixture
def policy(make_policy) -> UniversalPolicy:
    return make_policy()


@pytest.fixture(scope="session")
def family_problems() -> list[Problem]:
    """One problem of every family."""
    return [generate(family, 5, 8, 3, np.random.default_rng([5, *family.encode()])) for family in FAMILIES]
