"""Moves about flights: a flight is what a UAV does from a reload to the next one."""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import NONE, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.visit import START, leg
from app.solvers.local_search.change import Change, propose
from app.solvers.local_search.neighbourhood import Neighbourhood, base_after, draw, target_after
from app.solvers.local_search.routes import Routes

_INTO_BEST = 0.4
"""Probability of a visit at the best place of a route, which may have many."""

_LONGEST = 3
"""Visits that a new flight begins with, at most."""


@compiled
def draw_flight_move(
    arrays: ProblemArrays,
    routes: Routes,
    near: Neighbourhood,
    change: Change,
    rng: np.random.Generator,
    i: int,
) -> bool:
    """Propose a random move about the flights of UAV `i`; False where what was drawn is not possible."""
    kind = rng.random()
    if routes.length[i] > 1 and kind < _INTO_BEST:
        return _insert_at_best(arrays, routes, near, change, rng, i)
    kind = (kind - _INTO_BEST) / (1.0 - _INTO_BEST) if kind >= _INTO_BEST else rng.random()
    s = _draw_reload(routes, near, rng, i)
    if kind < (0.6 if s == NONE else 0.3):
        return _insert_flight(routes, near, change, rng, i)
    if s == NONE or kind < 0.45:
        return _reload(routes, near, change, rng, i)
    if kind < 0.6:
        return _drop(routes, change, i, s, s + 1)
    if kind < 0.7:
        return _exchange_base(routes, near, change, rng, i, s)
    if kind < 0.8:
        return _drop(routes, change, i, s, _end_of_flight(routes, near, i, s))
    if kind < 0.9:
        return _shift_reload(routes, change, rng, i, s)
    return _hand_over(routes, near, change, rng, i, s)


@compiled
def _insert_at_best(
    arrays: ProblemArrays,
    routes: Routes,
    near: Neighbourhood,
    change: Change,
    rng: np.random.Generator,
    i: int,
) -> bool:
    """One more visit where the detour is least, to a target near a stop of the route."""
    length, steps = routes.length[i], routes.target.shape[1]
    j = target_after(routes, near, rng, i, draw(rng, length + 1))
    best, s = np.inf, NONE
    for place in range(min(length + 1, steps)):
        at = START if place == 0 else routes.target[i, place - 1]
        if at == j or (place < length and routes.target[i, place] == j):
            continue
        detour = leg(arrays, 0, i, at, j)
        if place < length:
            following = routes.target[i, place]
            detour += leg(arrays, 0, i, j, following) - leg(arrays, 0, i, at, following)
        # Which of those that are nearly as good is drawn, as loads and times count, too.
        detour *= 0.7 + 0.6 * rng.random()
        if detour < best:
            best, s = detour, place
    if s == NONE:
        return False
    new = min(length + 1, steps)
    change.target[0, s] = j
    for q in range(s + 1, new):
        change.target[0, q] = routes.target[i, q - 1]
    propose(routes, change, 0, i, s, new)
    return True


@compiled
def is_reload(routes: Routes, near: Neighbourhood, i: int, s: int) -> bool:
    """Whether stop `s` of UAV `i` is a reload: bases have the last numbers."""
    return routes.target[i, s] >= routes.first.shape[0] - near.near_base.shape[1]


@compiled
def _draw_reload(routes: Routes, near: Neighbourhood, rng: np.random.Generator, i: int) -> int:
    """Draw a reload of UAV `i`, as its place in the route; NONE where there is none."""
    chosen, seen = NONE, 0
    for s in range(routes.length[i]):
        if is_reload(routes, near, i, s):
            seen += 1
            if draw(rng, seen) == 0:
                chosen = s
    return chosen


@compiled
def _end_of_flight(routes: Routes, near: Neighbourhood, i: int, s: int) -> int:
    """The place after the last visit of the flight that begins with reload `s`."""
    end = s + 1
    while end < routes.length[i] and not is_reload(routes, near, i, end):
        end += 1
    return end


@compiled
def _insert_flight(
    routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator, i: int
) -> bool:
    """A reload and some visits near it, mostly at the end; what is beyond the last step is lost."""
    length, steps = routes.length[i], routes.target.shape[1]
    s = length if rng.random() < 0.5 else draw(rng, length + 1)
    if s + 2 > steps:
        return False
    change.target[0, s] = base_after(routes, near, rng, i, s)
    end = min(s + 2 + draw(rng, _LONGEST), steps)
    for q in range(s + 1, end):
        u = rng.random()
        change.target[0, q] = near.near_target[
            change.target[0, q - 1], int(u * u * near.near_target.shape[1])
        ]
    new = min(end + length - s, steps)
    for q in range(end, new):
        change.target[0, q] = routes.target[i, s + q - end]
    propose(routes, change, 0, i, s, new)
    return True


@compiled
def _reload(routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator, i: int) -> bool:
    """A reload between two visits, or before the first; the last visit is lost where the route is full."""
    length, steps = routes.length[i], routes.target.shape[1]
    if length == 0:
        return False
    s = draw(rng, length)
    new = min(length + 1, steps)
    change.target[0, s] = base_after(routes, near, rng, i, s)
    for q in range(s + 1, new):
        change.target[0, q] = routes.target[i, q - 1]
    propose(routes, change, 0, i, s, new)
    return True


@compiled
def _drop(routes: Routes, change: Change, i: int, s: int, end: int) -> bool:
    """A stretch of the route less."""
    gone = end - s
    for q in range(s, routes.length[i] - gone):
        change.target[0, q] = routes.target[i, q + gone]
    propose(routes, change, 0, i, s, routes.length[i] - gone)
    return True


@compiled
def _exchange_base(
    routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator, i: int, s: int
) -> bool:
    """A reload at another base."""
    change.target[0, s] = base_after(routes, near, rng, i, s)
    if change.target[0, s] == routes.target[i, s]:
        return False
    for q in range(s + 1, routes.length[i]):
        change.target[0, q] = routes.target[i, q]
    propose(routes, change, 0, i, s, routes.length[i])
    return True


@compiled
def _shift_reload(routes: Routes, change: Change, rng: np.random.Generator, i: int, s: int) -> bool:
    """A reload sooner or later in the route: visits go from one flight to the other."""
    to = draw(rng, routes.length[i])
    if to == s:
        return False
    first = min(s, to)
    for q in range(first, routes.length[i]):
        change.target[0, q] = routes.target[i, q]
    if to < s:
        for q in range(to + 1, s + 1):
            change.target[0, q] = routes.target[i, q - 1]
    else:
        for q in range(s, to):
            change.target[0, q] = routes.target[i, q + 1]
    change.target[0, to] = routes.target[i, s]
    propose(routes, change, 0, i, first, routes.length[i])
    return True


@compiled
def _hand_over(
    routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator, i: int, s: int
) -> bool:
    """A flight of UAV `i` becomes the last one of another UAV."""
    i2 = near.active[draw(rng, len(near.active))]
    end = _end_of_flight(routes, near, i, s)
    into = routes.length[i2]
    if i2 == i or into + end - s > routes.target.shape[1]:
        return False
    for q in range(s, end):
        change.target[1, into + q - s] = routes.target[i, q]
    propose(routes, change, 1, i2, into, into + end - s)
    return _drop(routes, change, i, s, end)
