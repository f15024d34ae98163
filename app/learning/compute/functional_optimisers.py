"""RMSprop and AdamW as functions of torch, without the objects of ``torch.optim``.

The first object of ``torch.optim`` that is made loads torch's compiler and a computer algebra system, which
nothing here uses: 2.7 s of each worker's start and 80 MB of its memory. Its arithmetic is in functions of
torch, called here with the defaults of these objects; the weights come out the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import torch
from torch import Tensor
from torch.optim.adamw import adamw
from torch.optim.rmsprop import rmsprop


class Optimiser(Protocol):
    """What steps weights by their gradients; every object of ``torch.optim`` is one.

    Attributes
    ----------
    param_groups
        Of each group of weights ``lr``, its learning rate.
    """

    param_groups: list[dict[str, Any]]

    def step(self) -> Any:
        """Change the weights that have a gradient."""


class RMSprop:
    """RMSprop with torch's defaults.

    Parameters
    ----------
    weights
        Stepped together; those without a gradient are left as they are.
    lr
        Learning rate.

    Attributes
    ----------
    param_groups
        See :class:`Optimiser`.
    """

    def __init__(self, weights: Iterable[Tensor], lr: float) -> None:
        self.param_groups: list[dict[str, Any]] = [{"lr": lr}]
        self._slots = [(each, torch.zeros_like(each), torch.zeros(())) for each in weights]

    @torch.no_grad()
    def step(self) -> None:
        """Change the weights that have a gradient."""
        weights, gradients, squares, steps = _with_gradient(self._slots)
        rmsprop(
            weights,
            gradients,
            squares,
            [],
            [],
            steps,
            foreach=True,
            lr=self.param_groups[0]["lr"],
            alpha=0.99,
            eps=1e-8,
            weight_decay=0.0,
            momentum=0.0,
            centered=False,
        )


class AdamW:
    """AdamW with torch's defaults but for the decay of weights.

    Parameters
    ----------
    weights
        Stepped together; those without a gradient are left as they are.
    lr
        Learning rate.
    weight_decay
        Share of the learning rate by which weights shrink in a step.

    Attributes
    ----------
    param_groups
        See :class:`Optimiser`.
    """

    def __init__(self, weights: Iterable[Tensor], lr: float, weight_decay: float) -> None:
        self.param_groups: list[dict[str, Any]] = [{"lr": lr}]
        self._weight_decay = weight_decay
        self._slots = [
            (each, torch.zeros_like(each), torch.zeros_like(each), torch.zeros(())) for each in weights
        ]

    @torch.no_grad()
    def step(self) -> None:
        """Change the weights that have a gradient."""
        weights, gradients, means, squares, steps = _with_gradient(self._slots)
        adamw(
            weights,
            gradients,
            means,
            squares,
            [],
            steps,
            foreach=None,
            amsgrad=False,
            beta1=0.9,
            beta2=0.999,
            lr=self.param_groups[0]["lr"],
            weight_decay=self._weight_decay,
            eps=1e-8,
            maximize=False,
        )


def _with_gradient(slots: Sequence[tuple[Tensor, ...]]) -> list[list[Tensor]]:
    """Return the weights that have a gradient, their gradients, and each of what is kept of them."""
    rows = [(slot[0], slot[0].grad, *slot[1:]) for slot in slots if slot[0].grad is not None]
    return [[row[column] for row in rows] for column in range(len(slots[0]) + 1)]
