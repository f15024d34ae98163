"""Initial weights from an explicit generator: nothing here touches torch's global random state."""

from __future__ import annotations

import math

import torch
from torch import nn
from torch.nn.utils import skip_init


def uninitialised_linear(inputs: int, outputs: int) -> nn.Linear:
    """Make a linear layer with weights to be set; nn.Linear alone would draw them from the global state."""
    layer: nn.Linear = skip_init(nn.Linear, inputs, outputs)  # type: ignore[no-untyped-call]  # untyped in torch
    return layer


def uninitialised_gru_cell(inputs: int, hidden: int) -> nn.GRUCell:
    """Make a recurrent cell with weights to be set."""
    cell: nn.GRUCell = skip_init(nn.GRUCell, inputs, hidden)  # type: ignore[no-untyped-call]  # untyped in torch
    return cell


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
