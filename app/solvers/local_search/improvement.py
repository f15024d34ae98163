"""Rounds of annealing in pieces: as many moves as were asked for, unless a stop criterion ends it early."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from app.simulation.arrays import ProblemArrays
from app.solvers.local_search.annealing import Search, anneal, drop_useless
from app.solvers.local_search.effort import move_cost
from app.solvers.protocol import StopCriterion

_PIECE = 6000
"""Moves between two looks at the stop criterion times what a move costs: about 2 ms."""

_TOLD = 32
"""Times that progress is told, beside the ends of the rounds."""


class Cooling(NamedTuple):
    """Temperatures of a round and the price of a useless visit, in largest levels.

    Attributes
    ----------
    hot, cold
        The temperature falls geometrically from one to the other.
    penalty
        What a visit that unloads nothing costs during the search.
    """

    hot: float = 0.1
    cold: float = 0.002
    penalty: float = 0.03


Watch = Callable[[float, int], None]
"""Takes the share of the moves done and the number of rounds ended."""


def improve(
    search: Search,
    rng: np.random.Generator,
    moves: int,
    rounds: int,
    cooling: Cooling,
    stop: StopCriterion,
    watch: Watch,
) -> None:
    """Anneal from the search's current plan, each round from where the one before ended.

    Parameters
    ----------
    search
        Changed; its incumbent is the best plan of all rounds and of before.
    rng
        The only source of randomness.
    moves, rounds
        How many moves to try, over all rounds, at least 1.
    cooling
        Temperatures.
    stop
        Asked every few milliseconds. It does not change what the moves before it were.
    watch
        Told now and then, and after each round.
    """
    for number in range(rounds):
        before, after = moves * number // rounds, moves * (number + 1) // rounds

        def tell(done: int, before: int = before, number: int = number) -> None:
            watch((before + done) / moves, number)

        if stop():
            return
        if len(search.near.active) and len(search.near.wanted):
            _round(search, rng, after - before, -(-moves // _TOLD), cooling, stop, tell)
        watch(after / max(moves, 1), number + 1)


def _round(
    search: Search,
    rng: np.random.Generator,
    moves: int,
    tell_every: int,
    cooling: Cooling,
    stop: StopCriterion,
    tell: Callable[[int], None],
) -> None:
    """One round; the plan at its end is made legal."""
    scale = _level_scale(search.arrays)
    piece = max(100, round(_PIECE / move_cost(search.arrays)))
    done, told = 0, 0
    while done < moves and not stop():
        following = min(done + piece, moves)
        hot, cold = (cooling.hot * (cooling.cold / cooling.hot) ** (n / moves) for n in (done, following))
        anneal(search, rng, following - done, hot * scale, cold * scale, cooling.penalty * scale)
        done = following
        if done - told >= tell_every:
            told = done
            tell(done)
    drop_useless(search)


def _level_scale(arrays: ProblemArrays) -> float:
    """Return the largest level of a target that needs anything; never 0."""
    levels = arrays.level[0][arrays.need_total[0] > 0]
    return max(float(levels.max(initial=0.0)), 1e-12)
