"""What steps the weights: Adam, or Muon on the matrices between hidden layers beside Adam on the rest.

Muon (torch's, with the step sizes matched to Adam's) makes every direction of a matrix's step equally long.
On demonstrations it gets further in the same number of updates, see LOG.md; on one problem, where a policy
is only adjusted, Adam is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import nn

from app.learning.compute.functional_optimisers import AdamW, Optimiser

WEIGHT_DECAY = 1e-4
_MUON_WEIGHT_DECAY = 1e-2

_NARROWEST = 16
"""Smaller side of the matrices that Muon steps; those with fewer inputs or outputs have few directions."""

MakeOptimisers = Callable[[nn.Module, float], Sequence[Optimiser]]
"""Takes networks and the highest learning rate; every weight belongs to one of what comes back."""


def adam(networks: nn.Module, lr: float) -> list[AdamW]:
    """Step all weights by Adam."""
    return [AdamW(networks.parameters(), lr, WEIGHT_DECAY)]


def muon(networks: nn.Module, lr: float) -> list[torch.optim.Optimizer]:
    """Step matrices by Muon, everything else by Adam, both with a state that can be kept."""
    matrices: list[torch.Tensor] = []
    rest: list[torch.Tensor] = []
    for weights in networks.parameters():
        wide = weights.ndim == 2 and min(weights.shape) >= _NARROWEST
        (matrices if wide else rest).append(weights)
    optimisers: list[torch.optim.Optimizer] = [
        torch.optim.AdamW(rest, lr=lr, weight_decay=WEIGHT_DECAY),
    ]
    if matrices:
        optimisers.append(
            torch.optim.Muon(matrices, lr=lr, weight_decay=_MUON_WEIGHT_DECAY, adjust_lr_fn="match_rms_adamw")
        )
    return optimisers
