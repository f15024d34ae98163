"""The decoder: from random keys to a legal plan, on the compiled simulator.

A vector of keys has a number from 0 to 1 for every UAV and stop. The plan is built turn by turn as the
greedy rule's is, with one difference: what a visit earns is weighted with twice its key before what it
costs is taken off. So a key of a half everywhere is the greedy rule, a key of 0 keeps a UAV away from an
area, and a large one draws it there (weight coding: Julstrom 1997; random keys: Bean 1994).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import (
    act,
    close,
    earned_now,
    leg_home,
    leg_to,
    new_episodes,
    promised,
    reset_one,
    verdict,
)
from app.simulation.visit import ALLOWED, loaded_of, way_home
from app.simulation.worth import cost_of, most_earned_by, worths

NEUTRAL = 0.5
"""The key with which a visit counts for what it earns."""

_ROUNDING = 1e-12
"""Relative error that sums of amounts and earnings may have, and more."""


class Flight(NamedTuple):
    """What it takes to fly one vector of keys after the other.

    Attributes
    ----------
    arrays
        A stack of one problem.
    episodes
        One episode, overwritten by every flight.
    needed, left
        (N,) what each area needs of all materials, and what of it is left.
    unit
        (1,) what a unit of material earns in the mean: by it a reload is judged.
    actions
        (S, M) the plan of the last flight.
    """

    arrays: ProblemArrays
    episodes: Episodes
    needed: Floats
    left: Floats
    unit: Floats
    actions: Integers


def new_flight(arrays: ProblemArrays) -> Flight:
    """Prepare flights of a stack of one problem."""
    needed = arrays.need[0].sum(axis=1)
    worth = worths(arrays)[needed > 0]
    steps, m = int(arrays.max_steps[0]), arrays.shape[0]
    return Flight(
        arrays,
        new_episodes(arrays, 1),
        needed,
        np.empty_like(needed),
        np.array([worth.mean() if len(worth) else 0.0]),
        np.empty((steps, m), np.int64),
    )


@compiled
def fly_all(flight: Flight, keys: Floats, reward: Floats, first: int, last: int) -> None:
    """Fly some of several vectors of keys, (P, M, N + D), and write what they earn, (P,)."""
    for p in range(first, last):
        reward[p] = fly(flight, keys, p)


@compiled
def fly(flight: Flight, keys: Floats, p: int) -> float:
    """Fly one of several vectors of keys, leave its plan in ``flight.actions`` and return its reward.

    Parameters
    ----------
    flight
        Scratch space.
    keys
        (P, M, N + D): of every UAV, those of the areas, then those of the bases.
    p
        Which vector.
    """
    arrays, episodes = flight.arrays, flight.episodes
    home = arrays.need.shape[1]
    steps, m = flight.actions.shape
    reset_one(arrays, episodes, 0)
    for j in range(home):
        flight.left[j] = flight.needed[j]
    reward, flying = 0.0, True
    for s in range(steps):
        anybody = False
        for i in range(m):
            action = home
            if flying:
                action = promised(arrays, episodes, 0, i)
                if action == home:
                    action = _chosen(flight, keys, p, i)
                reward += act(arrays, episodes, 0, i, action)
                if action != home:
                    anybody = True
                if action < home:
                    flight.left[action] = episodes.need[0, action].sum()
            flight.actions[s, i] = action
        flying = anybody
    return reward + close(arrays, episodes, 0)


@compiled
def _chosen(flight: Flight, keys: Floats, p: int, i: int) -> int:
    """Return the stop that draws UAV `i` most now, or N where none is worth its cost."""
    arrays, episodes = flight.arrays, flight.episodes
    home = arrays.need.shape[1]
    best, chosen = 0.0, home
    if episodes.ret[0, i]:
        return chosen
    carried = episodes.load[0, i].sum()
    charged = arrays.terms[0].charge_return
    back = leg_home(arrays, episodes, 0, i) if charged else 0.0
    for j in range(home):
        most = min(carried, flight.left[j]) * (1.0 + _ROUNDING)
        if most <= 0.0:
            continue
        weight = 2.0 * keys[p, i, j]
        way = leg_to(arrays, episodes, 0, i, j)
        if charged:
            way += way_home(arrays, 0, i, j) - back
        cost = cost_of(arrays, 0, way)
        # What it earns at most is known at once, and mostly too little.
        if weight * most_earned_by(arrays, 0, j, most) - cost <= best:
            continue
        if verdict(arrays, episodes, 0, i, j) != ALLOWED:
            continue
        unloaded = 0.0
        for k in range(episodes.load.shape[2]):
            unloaded += min(episodes.load[0, i, k], episodes.need[0, j, k])
        gain = weight * earned_now(arrays, episodes, 0, i, j, unloaded)
        if gain - cost > best + _ROUNDING * gain:
            best, chosen = gain - cost, j
    for d in range(arrays.stock.shape[1]):
        base = home + 1 + d
        weight = 2.0 * (keys[p, i, home + d] - NEUTRAL)
        if weight <= 0.0 or verdict(arrays, episodes, 0, i, base) != ALLOWED:
            continue
        loaded = 0.0
        for k in range(episodes.load.shape[2]):
            loaded += loaded_of(episodes.load[0, i, k], arrays.full[0, i, k], episodes.stock[0, d, k])
        gain = weight * flight.unit[0] * loaded
        cost = cost_of(arrays, 0, leg_to(arrays, episodes, 0, i, base) - back)
        if gain - cost > best:
            best, chosen = gain - cost, base
    return chosen
