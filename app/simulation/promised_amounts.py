"""A little for promised visits to which the best amounts of a plan give nothing.

A visit has to unload something, and no other one is made before those that a UAV is committed to. Where it
earns more to keep everything for later, there is no best amount: the less is unloaded there, the better.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.domain.problem import ROUNDING
from app.simulation.amounts import Amounts
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays

_LITTLE = 1e-6
"""Share of the larger of load and need that such a visit unloads: far above what counts as rounding."""


def keep_promises(arrays: ProblemArrays, actions: Integers, amounts: Amounts) -> Amounts:
    """Return amounts in which every promised visit unloads something, if it can.

    Parameters
    ----------
    arrays
        A stack of one problem.
    actions
        (S', M) joint actions.
    amounts
        What its stops unload and load; they are not changed.
    """
    if not (arrays.committed[0] != NONE).any():
        return amounts
    delivered = amounts.delivered
    for i in np.flatnonzero((arrays.committed[0] != NONE).any(axis=1)).tolist():
        steps = np.flatnonzero(actions[:, i] != arrays.shape[1])
        promised = int((arrays.committed[0, i] != NONE).sum())
        for s in steps[:promised].tolist():
            if actions[s, i] < arrays.shape[1] and not (delivered[s, i] > 0.0).any():
                if delivered is amounts.delivered:
                    delivered = delivered.copy()
                _give_little(arrays, actions, delivered, s, i)
    return amounts._replace(delivered=delivered)


def _give_little(arrays: ProblemArrays, actions: Integers, delivered: Floats, s: int, i: int) -> None:
    """Let the visit of UAV `i` in step `s` unload a little of the material of which most is at hand."""
    n, j = arrays.shape[1], int(actions[s, i])
    load, need = arrays.load[0, i], arrays.need[0, j]
    k = int(np.minimum(load, need).argmax())
    little = min(0.5 * min(load[k], need[k]), _LITTLE * max(load[k], need[k]))
    if little <= 0.0:
        return
    # What the UAV unloads before it reloads is all of one load.
    stops = actions[:, i]
    reloads = np.flatnonzero(stops > n)
    flight = np.arange(len(stops)) < (reloads[0] if len(reloads) else len(stops))
    _make_room(delivered[:, i, k], flight & (stops < n), load[k] - little)
    there = actions == j
    _make_room(delivered[:, :, k], there, need[k] - little)
    delivered[s, i, k] = little


def _make_room(amounts: Floats, concerned: npt.NDArray[np.bool_], most: float) -> None:
    """Take so much from the largest of some amounts, in place, that they add up to `most` at most."""
    over = float(amounts[concerned].sum()) - most
    while over > ROUNDING * most:
        at = np.unravel_index(np.where(concerned, amounts, -1.0).argmax(), amounts.shape)
        taken = min(over, float(amounts[at]) / 2)
        amounts[at] -= taken
        over -= taken
