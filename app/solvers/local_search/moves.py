"""The moves: each proposes new routes for one or two UAVs, drawn at random near what it starts from."""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import NONE, ProblemArrays
from app.simulation.decorators import compiled
from app.solvers.local_search.change import Change, propose
from app.solvers.local_search.flights import draw_flight_move
from app.solvers.local_search.neighbourhood import Neighbourhood, draw, target_after
from app.solvers.local_search.routes import Routes

FLIGHT_SHARE = 0.35
"""Probability of a move about reloads, where there are bases."""


@compiled
def draw_move(
    arrays: ProblemArrays, routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator
) -> bool:
    """Propose a random move; False where what was drawn is not possible."""
    change.uav[0], change.uav[1] = NONE, NONE
    i = near.active[draw(rng, len(near.active))]
    if near.near_base.shape[1] > 0 and rng.random() < FLIGHT_SHARE:
        return draw_flight_move(arrays, routes, near, change, rng, i)
    kind = rng.random()
    if routes.length[i] == 0 and near.reluctant[i] and kind < 0.5:
        return _depart(routes, near, change, rng, i)
    if routes.length[i] == 0 or kind < 0.15:
        return _insert(routes, near, change, rng, i)
    if kind < 0.25:
        return _remove(routes, change, rng, i)
    if kind < 0.45:
        return _replace(routes, near, change, rng, i)
    if kind < 0.49:
        return _reverse(routes, change, rng, i)
    if kind < 0.54:
        return _shift(routes, change, rng, i)
    if kind < 0.60:
        return _eject(routes, near, change, rng, i)
    other = _near_visit(routes, near, rng, i)
    if other == NONE:
        return False
    m = routes.length.shape[0]
    i2, s2 = other % m, other // m
    if kind < 0.74:
        return _relocate(routes, change, rng, i, i2, s2)
    if kind < 0.87:
        return _swap(routes, change, rng, i, i2, s2)
    return _swap_tails(routes, change, rng, i, i2, s2)


@compiled
def _near_visit(routes: Routes, near: Neighbourhood, rng: np.random.Generator, i: int) -> int:
    """Draw a visit of another UAV near a visit of UAV `i`, as its slot; NONE where there is none."""
    j = target_after(routes, near, rng, i, draw(rng, routes.length[i] + 1))
    slot = routes.first[j]
    if slot == NONE:
        return NONE
    while routes.following[slot] != NONE and rng.random() < 0.5:
        slot = routes.following[slot]
    return slot if slot % routes.length.shape[0] != i else NONE


@compiled
def _insert(routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator, i: int) -> bool:
    """One more visit, anywhere in the route; a full route loses its last one."""
    length, steps = routes.length[i], routes.target.shape[1]
    s = draw(rng, min(length + 1, steps))
    new = min(length + 1, steps)
    change.target[0, s] = target_after(routes, near, rng, i, s)
    for q in range(s + 1, new):
        change.target[0, q] = routes.target[i, q - 1]
    propose(routes, change, 0, i, s, new)
    return True


@compiled
def _depart(routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator, i: int) -> bool:
    """A whole route for a UAV that has none: where one visit does not pay for the way, several may."""
    length = 1 + draw(rng, routes.target.shape[1])
    change.target[0, 0] = target_after(routes, near, rng, i, 0)
    for s in range(1, length):
        u = rng.random()
        change.target[0, s] = near.near_target[
            change.target[0, s - 1], int(u * u * near.near_target.shape[1])
        ]
    propose(routes, change, 0, i, 0, length)
    return True


@compiled
def _remove(routes: Routes, change: Change, rng: np.random.Generator, i: int) -> bool:
    """One visit less."""
    length = routes.length[i]
    s = draw(rng, length)
    for q in range(s, length - 1):
        change.target[0, q] = routes.target[i, q + 1]
    propose(routes, change, 0, i, s, length - 1)
    return True


@compiled
def _replace(routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator, i: int) -> bool:
    """Another target in place of one; near the one before it, or near the one it replaces."""
    length = routes.length[i]
    s = draw(rng, length)
    change.target[0, s] = target_after(routes, near, rng, i, s if rng.random() < 0.5 else s + 1)
    if change.target[0, s] == routes.target[i, s]:
        return False
    for q in range(s + 1, length):
        change.target[0, q] = routes.target[i, q]
    propose(routes, change, 0, i, s, length)
    return True


@compiled
def _reverse(routes: Routes, change: Change, rng: np.random.Generator, i: int) -> bool:
    """A stretch of the route the other way round."""
    length = routes.length[i]
    if length < 2:
        return False
    a, b = draw(rng, length), draw(rng, length)
    a, b = min(a, b), max(a, b)
    if a == b:
        return False
    for q in range(a, length):
        change.target[0, q] = routes.target[i, a + b - q if q <= b else q]
    propose(routes, change, 0, i, a, length)
    return True


@compiled
def _shift(routes: Routes, change: Change, rng: np.random.Generator, i: int) -> bool:
    """A visit moves to another place in its route."""
    length = routes.length[i]
    if length < 3:
        return False
    a, b = draw(rng, length), draw(rng, length)
    if abs(a - b) < 2:
        return False
    for q in range(min(a, b), length):
        change.target[0, q] = routes.target[i, q]
    if a < b:
        for q in range(a, b):
            change.target[0, q] = routes.target[i, q + 1]
    else:
        for q in range(b + 1, a + 1):
            change.target[0, q] = routes.target[i, q - 1]
    change.target[0, b] = routes.target[i, a]
    propose(routes, change, 0, i, min(a, b), length)
    return True


@compiled
def _eject(routes: Routes, near: Neighbourhood, change: Change, rng: np.random.Generator, i: int) -> bool:
    """One more visit at one place of the route for one less at another: where range or time are used up."""
    length = routes.length[i]
    if length < 2:
        return False
    out, s = draw(rng, length), draw(rng, length)
    if s == out:
        return False
    # The new visit follows the one that is now number s, or number s - 1, of those that stay.
    begin = min(out, s)
    put = target_after(routes, near, rng, i, s if s < out else s + 1)
    to = begin
    for q in range(begin, length):
        if s < out and q == s:
            change.target[0, to] = put
            to += 1
        if q != out:
            change.target[0, to] = routes.target[i, q]
            to += 1
        if s > out and q == s:
            change.target[0, to] = put
            to += 1
    propose(routes, change, 0, i, begin, length)
    return True


@compiled
def _relocate(routes: Routes, change: Change, rng: np.random.Generator, i: int, i2: int, s2: int) -> bool:
    """A visit of UAV `i` moves to UAV `i2`, before or after its visit `s2`."""
    steps = routes.target.shape[1]
    if routes.length[i2] >= steps:
        return False
    length, length2 = routes.length[i], routes.length[i2]
    s, into = draw(rng, length), s2 + draw(rng, 2)
    for q in range(s, length - 1):
        change.target[0, q] = routes.target[i, q + 1]
    change.target[1, into] = routes.target[i, s]
    for q in range(into + 1, length2 + 1):
        change.target[1, q] = routes.target[i2, q - 1]
    propose(routes, change, 0, i, s, length - 1)
    propose(routes, change, 1, i2, into, length2 + 1)
    return True


@compiled
def _swap(routes: Routes, change: Change, rng: np.random.Generator, i: int, i2: int, s2: int) -> bool:
    """A visit of UAV `i` and visit `s2` of UAV `i2` change places."""
    s = draw(rng, routes.length[i])
    if routes.target[i, s] == routes.target[i2, s2]:
        return False
    change.target[0, s], change.target[1, s2] = routes.target[i2, s2], routes.target[i, s]
    for q in range(s + 1, routes.length[i]):
        change.target[0, q] = routes.target[i, q]
    for q in range(s2 + 1, routes.length[i2]):
        change.target[1, q] = routes.target[i2, q]
    propose(routes, change, 0, i, s, routes.length[i])
    propose(routes, change, 1, i2, s2, routes.length[i2])
    return True


@compiled
def _swap_tails(routes: Routes, change: Change, rng: np.random.Generator, i: int, i2: int, s2: int) -> bool:
    """What UAV `i` does from a visit on, and UAV `i2` from visit `s2` on, change places."""
    steps = routes.target.shape[1]
    s = draw(rng, routes.length[i] + 1)
    tail, tail2 = routes.length[i] - s, routes.length[i2] - s2
    if s + tail2 > steps or s2 + tail > steps:
        return False
    for q in range(tail2):
        change.target[0, s + q] = routes.target[i2, s2 + q]
    for q in range(tail):
        change.target[1, s2 + q] = routes.target[i, s + q]
    propose(routes, change, 0, i, s, s + tail2)
    propose(routes, change, 1, i2, s2, s2 + tail)
    return True
