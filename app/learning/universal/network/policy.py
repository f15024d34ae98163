"""A policy for every size: the agent network and the mixing network that was trained with it."""

from __future__ import annotations

from pathlib import Path

import torch
from safetensors.torch import load_file
from torch import nn

from app.learning.universal.network.agent import UniversalAgent
from app.learning.universal.network.architecture import UniversalConfig
from app.learning.universal.network.mixer import UniversalMixer

_STATE_PREFIXES = {"networks.0.0.": "agent.", "networks.0.1.": "mixer."}
"""Names in a training's state, and in a checkpoint."""


class UniversalPolicy(nn.Module):
    """Both networks of ``qmix-universal-1``.

    Parameters
    ----------
    config
        Their sizes.
    """

    def __init__(self, config: UniversalConfig) -> None:
        super().__init__()
        self.config = config
        self.agent = UniversalAgent(config.width, config.layers)
        self.mixer = UniversalMixer(config.width, config.qmix_hidden_dim)

    @classmethod
    def of_seed(cls, config: UniversalConfig, seed: int) -> UniversalPolicy:
        """Make a policy with random weights that depend on the seed alone."""
        # Building it draws numbers too, from where everybody else does.
        with torch.random.fork_rng(devices=[]):
            policy = cls(config)
        policy.agent, policy.mixer = initial(config, seed)
        return policy

    @classmethod
    def of_training(cls, state: Path, config: UniversalConfig) -> UniversalPolicy:
        """Take the networks out of a state that :func:`app.learning.universal.training.trainer.fit` wrote."""
        policy, tensors = cls(config), load_file(state)
        named = {
            new + name.removeprefix(old): tensor
            for old, new in _STATE_PREFIXES.items()
            for name, tensor in tensors.items()
            if name.startswith(old)
        }
        policy.load_state_dict(named, strict=True)
        return policy


def initial(config: UniversalConfig, seed: int) -> tuple[UniversalAgent, UniversalMixer]:
    """Make networks with random weights that depend on the seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return UniversalAgent(config.width, config.layers), UniversalMixer(
            config.width, config.qmix_hidden_dim
        )
