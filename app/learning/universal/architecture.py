"""What the universal networks look like, in numbers; no torch here."""

from __future__ import annotations

from dataclasses import asdict, dataclass

QMIX_UNIVERSAL_1 = "qmix-universal-1"
"""Architecture: attention over targets, a recurrent cell, a mixing network; for any M, N and K."""


@dataclass(frozen=True, slots=True)
class UniversalConfig:
    """What fixes the shape of every tensor of ``qmix-universal-1``."""

    width: int = 64
    layers: int = 2
    qmix_hidden_dim: int = 32

    def as_record(self) -> dict[str, int]:
        """Return the fields, JSON-ready."""
        return asdict(self)
