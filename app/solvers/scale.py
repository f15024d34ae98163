"""The unit of a problem's rewards, by which what is small or large in a search is measured."""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import Floats, ProblemArrays

_NOTHING = 1e-300
"""Level that is none: beside it other numbers would leave the range of floating-point numbers."""


_TYPICAL = 4.0
"""Times the geometric mean that the largest of the levels is at most where none stands out."""


def common_level(arrays: ProblemArrays) -> float:
    """Return the largest level that does not stand out from the others; never more than the largest.

    One area of a very large level among small ones would otherwise be the only one that counts.
    """
    levels = arrays.areas["level"][0][
        (arrays.areas["need_total"][0] > 0) & (arrays.areas["level"][0] > _NOTHING)
    ]
    return common_of(levels) if len(levels) else largest_level(arrays)


def common_of(values: Floats) -> float:
    """Return the largest of some values, all above 0, that does not stand out from the others."""
    return float(min(values.max(), _TYPICAL * np.exp(np.log(values).mean())))


def largest_level(arrays: ProblemArrays) -> float:
    """Return the largest level of a target that needs anything, for the first problem of a stack.

    It is never 0: where no target has a level, 1 stands for it.
    """
    level = float(arrays.areas["level"][0][arrays.areas["need_total"][0] > 0].max(initial=0.0))
    return level if level > _NOTHING else 1.0
