"""What a plan unloads, and loads, where that is planned: the best amounts of its routes.

They follow from problem and routes, so a plan is its joint actions alone, here as everywhere. Where they are
one transportation problem, they are found by flows (:mod:`app.simulation.deliveries` and
:mod:`app.simulation.loads`), otherwise by a linear program (:mod:`app.simulation.amounts_program`).
"""

from __future__ import annotations

from collections import deque
from operator import is_
from typing import Any

import numpy as np

from app.domain.problem import ROUNDING
from app.simulation.amounts import Amounts
from app.simulation.amounts_program import amounts_by_program, in_turn
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.deliveries import new_unloading
from app.simulation.loads import serve_at_best
from app.simulation.promised_amounts import keep_promises
from app.simulation.visit_lists import visits_of
from app.simulation.worth import satisfaction_of

_LARGEST_PROGRAM = 20_000
"""Amounts, of stops and materials, up to which a linear program is solved: some seconds at most."""


def best_amounts(arrays: ProblemArrays, actions: Integers) -> Amounts:
    """Work out what the stops of a plan unload and load at best.

    Where loads are refilled, ``loaded`` is 0: the simulator knows what a reload takes. Where stocks are
    limited then, or a program is too large or its numbers are too far apart, the amounts are possible, and
    not always the best.

    Parameters
    ----------
    arrays
        A stack of one problem.
    actions
        (S', M) joint actions; ranges and deadlines do not matter here.

    Returns
    -------
    Amounts
        0 where there is no stop, and where one is of no use, but for a promised visit.
    """
    return keep_promises(arrays, actions, _unpromised(arrays, actions))


def _unpromised(arrays: ProblemArrays, actions: Integers) -> Amounts:
    """Work the amounts out as if no visit had to unload anything."""
    by_flow = Amounts(_by_flow(arrays, actions), np.zeros((*actions.shape, arrays.shape[2])))
    if not arrays.terms["plans_loading"][0]:
        return by_flow
    if how_many(arrays, actions) > _LARGEST_PROGRAM or _is_flow(arrays, by_flow):
        return in_turn(arrays, actions, by_flow)
    limits = arrays.need, arrays.stock, arrays.load, arrays.uavs
    plan = actions.shape, actions.tobytes()
    for known_limits, known_plan, amounts in tuple(_solved):
        if plan == known_plan and all(map(is_, limits, known_limits)):
            return amounts
    best = amounts_by_program(arrays, actions)
    if best is None:
        guesses = (in_turn(arrays, actions, each) for each in (by_flow, _all_needed(arrays, actions)))
        best = max(guesses, key=lambda guess: _satisfaction(arrays, actions, guess))
    _solved.append((limits, plan, best))
    return best


_Solved = tuple[tuple[Any, ...], tuple[tuple[int, ...], bytes], Amounts]
_solved: deque[_Solved] = deque(maxlen=4)
"""The newest programs, by what limits amounts, and the plan: search, answer and reasons ask for the same."""


def amounts_are_exact(arrays: ProblemArrays) -> bool:
    """Whether :func:`best_amounts` finds the best amounts of any plan that is not too large for a program."""
    if arrays.terms["plans_loading"][0] or not arrays.n_bases:
        return True
    unlimited = bool(np.isinf(arrays.stock[0]).all())
    return unlimited and bool((arrays.load[0] <= arrays.full[0]).all())


def how_many(arrays: ProblemArrays, actions: Integers) -> int:
    """Return how many amounts a plan has."""
    return int((actions != arrays.shape[1]).sum()) * arrays.shape[2]


def _is_flow(arrays: ProblemArrays, by_flow: Amounts) -> bool:
    """Whether nothing limits the amounts but capacities and needs, so that those of the flow are the best.

    Of a single base no flight has more than another, so a stock that is not used up limits nothing.
    """
    if arrays.load.any():
        return False
    if np.isinf(arrays.stock[0]).all():
        return True
    used = by_flow.delivered.sum(axis=(0, 1))
    return arrays.n_bases == 1 and bool((used < (1.0 - ROUNDING) * arrays.stock[0, 0]).all())


def _all_needed(arrays: ProblemArrays, actions: Integers) -> Amounts:
    """Return amounts by which every visit would bring all that its area needs."""
    n, wanted = arrays.shape[1], np.zeros((*actions.shape, arrays.shape[2]))
    visits = actions < n
    wanted[visits] = arrays.need[0][actions[visits]]
    return Amounts(wanted, np.zeros_like(wanted))


def _satisfaction(arrays: ProblemArrays, actions: Integers, amounts: Amounts) -> float:
    """Return what amounts earn."""
    met, visits = np.zeros_like(arrays.need[0]), actions < arrays.shape[1]
    np.add.at(met, actions[visits], amounts.delivered[visits])
    return satisfaction_of(arrays, met)


def _by_flow(arrays: ProblemArrays, actions: Integers) -> Floats:
    m, n, k = arrays.shape
    visits, unloading = visits_of(arrays, actions), new_unloading(arrays)
    unloading.served[:] = unloading.order
    serve_at_best(arrays, visits, unloading, n)
    delivered = np.zeros((*actions.shape, k))
    most = np.maximum(arrays.load[0], arrays.full[0])
    for s, i in np.argwhere(actions < n):
        possible = np.minimum(most[i], arrays.need[0, actions[s, i]])
        amount = unloading.amount[s * m + i]
        delivered[s, i] = np.where(amount > ROUNDING * possible, np.minimum(amount, possible), 0.0)
    return delivered
