"""How many moves a search is given where nobody says: by the size of its problem, never by the clock."""

from __future__ import annotations

from app.simulation.arrays import ProblemArrays

_MOVES_A_VISIT = 40_000
"""Moves for each visit there can be; more find little."""

_ROUND_A_VISIT = 5_000
"""Moves of a round for each visit there can be: cooling faster costs more than another round brings."""

_MOST = 4_300_000
"""Bound of the moves times what one costs; about 2 s."""


def move_cost(arrays: ProblemArrays) -> float:
    """Cost of a move, 1 at least: it grows with materials and with the length of routes, not with M or N."""
    return 1.0 + arrays.shape[2] / 16 + int(arrays.max_steps[0]) / 20


def default_moves(arrays: ProblemArrays) -> int:
    """Return the moves for a problem."""
    return round(min(_MOVES_A_VISIT * _visits(arrays), _MOST / move_cost(arrays)))


def default_restarts(arrays: ProblemArrays, moves: int) -> int:
    """Return in how many rounds more than one the moves are made."""
    return max(0, moves // (_ROUND_A_VISIT * _visits(arrays)) - 1)


def _visits(arrays: ProblemArrays) -> int:
    return arrays.shape[0] * int(arrays.max_steps[0])
