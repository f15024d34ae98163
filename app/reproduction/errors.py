"""What can go wrong in this room.

* ReproductionError
    * ImpossibleScale
    * MissingPackage
"""

from __future__ import annotations


class ReproductionError(Exception):
    """Root of this room's errors."""


class ImpossibleScale(ReproductionError):
    """Experiments are asked for that do not exist."""


class MissingPackage(ReproductionError):
    """An optional package is not installed; the message says how to install it."""
