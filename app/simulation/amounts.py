"""Amounts of a plan, and how an answer prints them: without the rounding errors of sums."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from app.domain.problem import ROUNDING
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.visit import most_carried

_DIGITS = 9
"""Decimal digits, from the first of what was requested on, to which an amount is rounded if it is near."""

_ERROR = 1e-12
"""Rounding error of a sum of amounts, relative to the largest of them."""


class Amounts(NamedTuple):
    """What the stops of a plan of S' steps do.

    Attributes
    ----------
    delivered
        (S', M, K) what visits unload.
    loaded
        (S', M, K) what reloads take; what they leave behind where it is below 0.
    """

    delivered: Floats
    loaded: Floats


def stops_in_order(actions: Integers, n: int) -> Iterator[tuple[int, int, int]]:
    """Yield step, UAV and action of every visit and reload, in the order of the plan."""
    for s, i in np.argwhere(actions != n).tolist():
        yield s, i, int(actions[s, i])


def tidy(
    arrays: ProblemArrays, actions: Integers, delivered: Floats, loaded: Floats, needs: Floats, stock: Floats
) -> None:
    """Write 0.2 for what the sums made 0.19999999999999998; an amount that is no rounding error away stays.

    Parameters
    ----------
    arrays
        A stack of one problem.
    actions, delivered, loaded
        (S, M) joint actions and (S, M, K) what they unload and load, which is changed.
    needs, stock
        (N, K) what is still needed at the end and (D, K) what is in stock then, which is changed.
    """
    requested = arrays.requested[0]
    size = np.log10(np.where(requested > 0.0, requested, 1.0))
    _tidy(arrays, actions, delivered, needs, 10.0 ** (_DIGITS - np.ceil(size)))
    if arrays.n_bases:
        full = np.maximum(arrays.full[0], arrays.load[0])
        _tidy_all(loaded, np.broadcast_to(full, loaded.shape))
        _tidy_all(stock, np.where(np.isinf(arrays.stock[0]), 0.0, arrays.stock[0]))


def _tidy_all(amounts: Floats, whole: Floats) -> None:
    """Do the same for amounts by what each is a part of."""
    scale = 10.0 ** (_DIGITS - np.ceil(np.log10(np.where(whole > 0.0, whole, 1.0))))
    finite = np.where(np.isinf(amounts), 0.0, amounts)
    rounded = np.rint(finite * scale) / scale
    near = np.abs(rounded - finite) <= np.minimum(_ERROR * whole, ROUNDING * finite)
    np.copyto(amounts, rounded, where=near & np.isfinite(amounts))


@compiled
def _tidy(arrays: ProblemArrays, actions: Integers, delivered: Floats, needs: Floats, scale: Floats) -> None:
    n, materials = scale.shape
    for s in range(actions.shape[0]):
        for i in range(actions.shape[1]):
            j = actions[s, i]
            if j < n:
                for k in range(materials):
                    whole = max(arrays.requested[0, j, k], most_carried(arrays, 0, i, k))
                    delivered[s, i, k] = _tidied(delivered[s, i, k], whole, scale[j, k])
    for j in range(n):
        for k in range(materials):
            needs[j, k] = _tidied(needs[j, k], arrays.requested[0, j, k], scale[j, k])


@compiled
def _tidied(amount: float, whole: float, scale: float) -> float:
    rounded = np.rint(amount * scale) / scale
    return rounded if abs(rounded - amount) <= min(_ERROR * whole, ROUNDING * amount) else amount
