"""How many moves a search is given where nobody says: by the size of its problem; a time limit cuts it."""

from __future__ import annotations

from app.simulation.arrays import ProblemArrays

_MOVES_A_VISIT = 40_000
"""Moves for each visit there can be; more find little."""

_ROUND_A_VISIT = 5_000
"""Moves of a round for each visit there can be: cooling faster costs more than another round brings."""

_MOST = 4_300_000
"""Bound of the moves times what one costs; about 2 s."""


_SPEED = 3e6
"""Moves a second times what one costs, on a core of 2024."""

_PATIENCE = 25
"""Times the default moves that a search goes on where a time limit allows it."""


def move_cost(arrays: ProblemArrays) -> float:
    """Cost of a move, 1 at least: it grows with materials and with the length of routes, not with M or N."""
    return 1.0 + arrays.shape[2] / 16 + int(arrays.max_steps[0]) / 20


def moves_a_second(arrays: ProblemArrays) -> float:
    """Return about how many moves a second are tried on one core; no schedule relies on it."""
    return _SPEED / move_cost(arrays)


def moves_within_limit(arrays: ProblemArrays) -> int:
    """Return the moves after which a search gives up although there is time left."""
    return _PATIENCE * default_moves(arrays)


def default_moves(arrays: ProblemArrays) -> int:
    """Return the moves for a problem."""
    return round(min(_MOVES_A_VISIT * _visits(arrays), _MOST / move_cost(arrays)))


def default_restarts(arrays: ProblemArrays, moves: int) -> int:
    """Return in how many rounds more than one the moves are made."""
    return max(0, moves // (_ROUND_A_VISIT * _visits(arrays)) - 1)


def rounds_for(rounds: int, share: float) -> int:
    """Return in how many rounds to do a share of the moves that `rounds` were meant for, at least 1."""
    return max(1, min(rounds, round(rounds * share)))


def _visits(arrays: ProblemArrays) -> int:
    return arrays.shape[0] * int(arrays.max_steps[0])
