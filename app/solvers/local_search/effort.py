"""How many moves a search is given where nobody says: by the size of its problem; a time limit cuts it."""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import Integers, ProblemArrays
from app.solvers.column_generation.pool import often_whole

_MOVES_A_VISIT = 40_000
"""Moves for each visit there can be; more find little."""

_ROUND_A_VISIT = 5_000
"""Moves of a round for each visit there can be: cooling faster costs more than another round brings."""

_COMBINED_ROUND = 90
"""Moves of a round for each pair of visits of a plan, where the routes of all rounds are combined."""

_LONGEST_COMBINED = 10.0
"""Mean visits of a route up to which routes are combined."""

_LEAST_VISITS = 30
"""Visits, at least, by which such a round is measured."""

_MOST = 8_600_000
"""Bound of the moves times what one costs; about 2 s."""


_LARGE_SHARE = 0.5
"""Share of the time that goes to large moves (``tests/benchmarks/LOG.md``)."""

_LARGE_COST, _LARGE_COST_A_STOP = 3.0, 0.6
"""What a large move costs, in small ones, and for each stop of a route."""

_SPEED = 6e6
"""Moves a second times what one costs, on a core of 2024."""

_SPEED_STOPS, _SLOWDOWN = 100, 0.25
"""Stops of a plan from which moves become slower, as what they look at leaves the processor's cache, and with
which power of the stops."""

_PATIENCE = 25
"""Times the default moves that a search goes on where a time limit allows it."""


def move_cost(arrays: ProblemArrays) -> float:
    """Cost of a move, 1 at least: it grows with materials and with the length of routes, not with M or N."""
    return 1.0 + arrays.shape[2] / 16 + int(arrays.max_steps[0]) / 20


def large_moves(lengths: Integers) -> tuple[float, float]:
    """Return how probable a large move is, and how many small ones a move costs then in the mean.

    Parameters
    ----------
    lengths
        (M,) stops of the routes: a large move looks at all of one or two.
    """
    cost = _LARGE_COST + _LARGE_COST_A_STOP * _mean_stops(lengths)
    probability = _LARGE_SHARE / (_LARGE_SHARE + (1.0 - _LARGE_SHARE) * cost)
    return probability, 1.0 + probability * (cost - 1.0)


def moves_a_second(arrays: ProblemArrays, lengths: Integers) -> float:
    """Return about how many moves a second are tried on one core, with routes (M,) so long."""
    slowdown = max(1.0, int(lengths.sum()) / _SPEED_STOPS) ** _SLOWDOWN
    return _SPEED / move_cost(arrays) / slowdown


def moves_within_limit(arrays: ProblemArrays) -> int:
    """Return the moves after which a search gives up although there is time left."""
    return _PATIENCE * default_moves(arrays)


def default_moves(arrays: ProblemArrays) -> int:
    """Return the moves for a problem."""
    return round(min(_MOVES_A_VISIT * _visits(arrays), _MOST / move_cost(arrays)))


def default_restarts(arrays: ProblemArrays, moves: int, lengths: Integers) -> int:
    """Return in how many rounds more than one the moves are made, from a plan with routes (M,) so long."""
    combined = is_combined(arrays, lengths)
    a_round = combined_round(int(lengths.sum())) if combined else _ROUND_A_VISIT * _visits(arrays)
    return max(0, moves // a_round - 1)


def is_combined(arrays: ProblemArrays, lengths: Integers) -> bool:
    """Whether the routes of several rounds are combined, where plans have routes (M,) so long.

    Where UAVs carry enough for what they visit, and few sets of areas are a route.
    """
    return often_whole(arrays) and _mean_stops(lengths) <= _LONGEST_COMBINED


def combined_round(visits: int) -> int:
    """Return the moves of a round where routes of several rounds are combined, of plans of so many visits."""
    return _COMBINED_ROUND * max(visits, _LEAST_VISITS) ** 2


def rounds_for(rounds: int, share: float) -> int:
    """Return in how many rounds to do a share of the moves that `rounds` were meant for, at least 1."""
    return max(1, min(rounds, round(rounds * share)))


def _mean_stops(lengths: Integers) -> float:
    """Mean length of the routes of UAVs that fly."""
    return float(lengths.sum()) / max(1, int(np.count_nonzero(lengths)))


def _visits(arrays: ProblemArrays) -> int:
    return arrays.shape[0] * int(arrays.max_steps[0])
