"""What the networks of ``qmix-universal-2`` look like, in numbers; no torch here."""

from __future__ import annotations

from dataclasses import dataclass

HEADS = 4
"""Attention heads a layer; the width is a multiple of it."""

DISTANCE_FEATURES = 5
"""What attention between places is told of their distance."""


@dataclass(frozen=True, slots=True)
class PairwiseConfig:
    """What fixes the shape of every tensor."""

    width: int = 64
    layers: int = 2
    qmix_hidden_dim: int = 32
