"""Annealing in pieces: as many moves as were asked for, unless a stop criterion ends it early."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from app.simulation.arrays import ProblemArrays
from app.solvers.local_search.annealing import Search, actions_of, anneal, set_routes
from app.solvers.protocol import StopCriterion

_PIECE = 4000
"""Moves between two looks at the stop criterion, for few materials and steps: about 2 ms."""


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
    cold: float = 0.001
    penalty: float = 0.01


def can_improve(search: Search) -> bool:
    """Whether there is any UAV that may be sent anywhere."""
    return len(search.near.active) > 0 and len(search.near.wanted) > 0


def improve(
    search: Search,
    rng: np.random.Generator,
    moves: int,
    cooling: Cooling,
    stop: StopCriterion,
    watch: Callable[[int], None],
) -> None:
    """Anneal one round from the search's current plan.

    Parameters
    ----------
    search
        Changed; its incumbent is the best plan of the round and of before.
    rng
        The only source of randomness.
    moves
        How many to try.
    cooling
        Temperatures.
    stop
        Asked every few milliseconds. It does not change what the moves before it were.
    watch
        Told the moves done, after each piece.
    """
    if not can_improve(search):
        return
    scale = level_scale(search.arrays)
    piece = _piece(search.arrays)
    done = 0
    while done < moves and not stop():
        following = min(done + piece, moves)
        hot, cold = (cooling.hot * (cooling.cold / cooling.hot) ** (n / moves) for n in (done, following))
        anneal(search, rng, following - done, hot * scale, cold * scale, cooling.penalty * scale)
        done = following
        watch(done)


def return_to_best(search: Search) -> None:
    """Make the incumbent the current plan."""
    set_routes(search, actions_of(search))


def level_scale(arrays: ProblemArrays) -> float:
    """Return the largest level of a target that needs anything; never 0."""
    levels = arrays.level[0][arrays.need_total[0] > 0]
    return max(float(levels.max(initial=0.0)), 1e-12)


def _piece(arrays: ProblemArrays) -> int:
    """Longer routes and more materials make a move dearer."""
    return max(100, round(_PIECE / (1 + arrays.shape[2] / 16 + int(arrays.max_steps[0]) / 20)))
