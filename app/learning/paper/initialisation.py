"""Initial weights from an explicit generator: nothing here touches torch's global random state."""

from __future__ import annotations

import math

import torch
from torch import nn


class UninitialisedLinear(nn.Linear):
    """A linear layer with weights to be set; nn.Linear alone would draw them from the global state."""

    def reset_parameters(self) -> None:
        """Leave the weights as they are."""


class UninitialisedGRUCell(nn.GRUCell):
    """A recurrent cell with weights to be set."""

    def reset_parameters(self) -> None:
        """Leave the weights as they are."""


@torch.no_grad()
def initialise(layer: nn.Module, fan_in: int, generator: torch.Generator) -> None:
    """Draw every parameter of a layer as torch's own layers do, uniform in ±1/√fan_in.

    Parameters
    ----------
    layer
        A linear layer (`fan_in` its inputs) or a recurrent cell (`fan_in` its hidden units).
    fan_in
        At least 1.
    generator
        Where the numbers come from.
    """
    bound = 1.0 / math.sqrt(fan_in)
    for parameter in layer.parameters(recurse=False):
        parameter.uniform_(-bound, bound, generator=generator)
