"""TD(lambda) targets of joint values."""

from __future__ import annotations

import torch
from torch import Tensor


def lambda_returns(
    reward: Tensor, following: Tensor, running: Tensor, gamma: float, td_lambda: float
) -> Tensor:
    """TD(lambda) targets (B, S).

    Parameters
    ----------
    reward
        (B, S) of each step.
    following
        (B, S) value of the best joint action of each step.
    running
        (B, S) 1 for steps that belong to the episode; after its end nothing is worth anything.
    gamma, td_lambda
        Discount and trace.
    """
    steps = reward.shape[1]
    returns = torch.zeros_like(reward)
    later = reward.new_zeros(reward.shape[0])
    for s in range(steps - 1, -1, -1):
        if s + 1 < steps:
            value = following[:, s + 1] * running[:, s + 1]
            later = (1 - td_lambda) * value + td_lambda * later
        returns[:, s] = reward[:, s] + gamma * later
        later = returns[:, s] * running[:, s]
    return returns
