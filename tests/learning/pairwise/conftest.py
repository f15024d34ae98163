"""Small policies of ``qmix-universal-2``, and problems they are tried on."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from app.domain.problem import Problem
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.simulation.generator import FAMILIES, generate

SMALL = PairwiseConfig(width=16, layers=2, qmix_hidden_dim=4)


@pytest.fixture(scope="session")
def make_policy() -> Callable[..., PairwisePolicy]:
    def make(seed: int = 0, config: PairwiseConfig = SMALL) -> PairwisePolicy:
        """Random weights, larger than at the start of a training so that they prefer something."""
        policy = PairwisePolicy.of_seed(config, seed)
        with torch.no_grad():
            for parameter in policy.parameters():
                parameter.mul_(2.0)
            # Nobody is so sure that two are equally sure.
            policy.agent.sharpness.zero_()
        return policy

    return make


@pytest.fixture
def policy(make_policy) -> PairwisePolicy:
    return make_policy()


@pytest.fixture(scope="session")
def family_problems() -> list[Problem]:
    """One problem of every family."""
    return [generate(family, 4, 6, 3, np.random.default_rng([5, *family.encode()])) for family in FAMILIES]
