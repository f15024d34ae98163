"""Local search from the best plan that learning has found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.learning.universal.episodes.best_plan import BestPlan
from app.simulation.arrays import ProblemArrays
from app.solvers.local_search.annealing import actions_of, new_search, set_routes
from app.solvers.local_search.effort import default_restarts
from app.solvers.local_search.improvement import Cooling, improve
from app.solvers.protocol import StopCriterion

_COOLING = Cooling()


def polish(
    arrays: ProblemArrays,
    best: BestPlan,
    moves: int,
    rng: np.random.Generator,
    stop: StopCriterion,
    watch: Callable[[float], None],
) -> None:
    """Search from the best plan, and put what is found into it.

    Parameters
    ----------
    arrays
        A stack of one problem.
    best
        Changed.
    moves
        How many to try.
    rng
        Source of the search's randomness.
    stop
        Asked every few milliseconds.
    watch
        Told the share of the moves done, now and then.
    """
    if moves == 0 or stop():
        return
    search = new_search(arrays)
    set_routes(search, best.actions)

    def tell(done: float, _ended: int) -> None:
        best.consider(actions_of(search)[None])
        watch(done)

    restarts = default_restarts(arrays, moves, search.routes.length)
    improve(search, rng, moves, restarts + 1, _COOLING, stop, tell)
    best.consider(actions_of(search)[None])
