"""A policy for every size: the agent network and the mixing network that was trained with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from app.domain.problem import Problem
from app.learning.universal.architecture import UniversalConfig
from app.learning.universal.learner import evaluate, joint_values, make_batch
from app.learning.universal.mixer import UniversalMixer
from app.learning.universal.network import UniversalAgent
from app.learning.universal.trainer import initial
from app.learning.universal.unfolding import unfold
from app.simulation.arrays import compile_problem
from app.solvers.greedy import greedy_plan

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
        """Take the networks out of a state that :func:`app.learning.universal.trainer.fit` wrote."""
        policy, tensors = cls(config), load_file(state)
        named = {
            new + name.removeprefix(old): tensor
            for old, new in _STATE_PREFIXES.items()
            for name, tensor in tensors.items()
            if name.startswith(old)
        }
        policy.load_state_dict(named, strict=True)
        return policy


@torch.inference_mode()
def values_of_greedy_plan(policy: UniversalPolicy, problem: Problem) -> tuple[Tensor, Tensor]:
    """Value the turns of the greedy rule's plan.

    Parameters
    ----------
    policy
        The policy.
    problem
        M UAVs, N targets, S steps.

    Returns
    -------
    Tensor
        (T, N+1) Q values of the turns that were taken; T is 0 where nothing can be flown.
    Tensor
        (1, S) Q_tot of the steps.
    """
    arrays = compile_problem(problem)
    plans = np.full((1, problem.max_steps, problem.n_uavs), problem.n_targets, np.int64)
    rows = greedy_plan(problem).as_array()
    plans[0, : len(rows)] = rows
    turns = unfold(arrays, np.zeros(1, np.int64), plans)
    batch = make_batch(arrays, turns, torch.device("cpu"))
    found = evaluate(policy.agent, batch)
    chosen = found.values.gather(1, batch.action[:, None])[:, 0]
    return found.values, joint_values(batch, chosen, found.hidden, policy.mixer)[0]
