"""What the moves of a search draw from: targets and bases that are near, nearest first.

So the cost of a move does not grow with N.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import Flags, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.legs import UNREACHABLE
from app.simulation.visit import START, leg, way_home
from app.simulation.worth import cost_of, earned_by
from app.solvers.local_search.routes import Routes

NEAR = 24
"""Length of the lists of near targets."""

FAR_SHARE = 0.05
"""Probability that a target is drawn from all of them instead."""


class Neighbourhood(NamedTuple):
    """What the moves draw from.

    Attributes
    ----------
    active
        UAVs that may be sent, (A,).
    wanted
        Targets that need anything, (W,).
    near_target
        (L, T) the targets nearest to a target or base, itself left out.
    near_start
        (M, T) the targets nearest to where a UAV is.
    near_base, near_base_at_start
        (L, D) and (M, D) bases, nearest first, from a target or base, and from where a UAV is.
    reluctant
        (M,) UAVs for which one visit alone, to some of these, earns less than its way costs.
    own
        (M,) UAVs whose routes may be changed.
    """

    active: Integers
    wanted: Integers
    near_target: Integers
    near_start: Integers
    near_base: Integers
    near_base_at_start: Integers
    reluctant: Flags
    own: Flags


def neighbourhood(arrays: ProblemArrays) -> Neighbourhood:
    """Make the lists for the first problem of a stack; ``active`` or ``wanted`` may be empty."""
    wanted = np.flatnonzero(arrays.areas["need_total"][0] > 0)
    length = max(1, min(NEAR, len(wanted) - 1))
    between = arrays.between[0].min(axis=0)
    np.fill_diagonal(between, np.inf)
    near_start = nearest(arrays.start_target[0], wanted, length)
    bases = np.arange(arrays.shape[1] + 1, arrays.between.shape[2])
    loads = (arrays.load[0] > 0).any(axis=1)
    if len(bases):
        usable = arrays.kept_range[0][:, bases] < UNREACHABLE
        loads |= usable.any(axis=1) & (arrays.full[0] > 0).any(axis=1)
    reluctant = np.zeros(len(near_start), np.bool_)
    if len(wanted):
        _find_reluctant(arrays, near_start, reluctant)
    return Neighbourhood(
        active=np.flatnonzero(~arrays.ret[0] & loads),
        wanted=wanted,
        near_target=nearest(between, wanted, length),
        near_start=near_start,
        near_base=nearest(between, bases, len(bases)),
        near_base_at_start=nearest(arrays.start_target[0], bases, len(bases)),
        reluctant=reluctant,
        own=np.ones(len(near_start), np.bool_),
    )


def nearest(distance: np.ndarray, wanted: Integers, length: int) -> Integers:
    """(rows, length) wanted columns of least distance, least first; zeros where there are none."""
    if not len(wanted):
        return np.zeros((len(distance), length), np.int64)
    among = distance[:, wanted]
    if length < among.shape[1]:
        part = np.argpartition(among, length - 1, axis=1)[:, :length]
    else:
        part = np.broadcast_to(np.arange(among.shape[1]), among.shape)
    order = np.argsort(np.take_along_axis(among, part, axis=1), axis=1, kind="stable")
    return np.ascontiguousarray(wanted[np.take_along_axis(part, order, axis=1)])


@compiled
def _find_reluctant(arrays: ProblemArrays, near_start: Integers, reluctant: Flags) -> None:
    """Work out :attr:`Neighbourhood.reluctant`, all False before."""
    for i in range(len(near_start)):
        for j in near_start[i]:
            unloaded = 0.0
            for k in range(arrays.load.shape[2]):
                unloaded += min(arrays.load[0, i, k], arrays.need[0, j, k])
            way = leg(arrays, 0, i, START, j)
            if arrays.terms[0].charge_return:
                way += way_home(arrays, 0, i, j) - way_home(arrays, 0, i, START)
            if unloaded > 0.0 and earned_by(arrays, 0, j, unloaded) < cost_of(arrays, 0, way):
                reluctant[i] = True
                break


@compiled
def draw(rng: np.random.Generator, n: int) -> int:
    """Draw a number from 0..n-1."""
    return int(rng.random() * n)


@compiled
def target_after(routes: Routes, near: Neighbourhood, rng: np.random.Generator, i: int, s: int) -> int:
    """Draw a target to fly to after the first `s` visits of UAV `i`; nearer ones more often."""
    if rng.random() < FAR_SHARE:
        return near.wanted[draw(rng, len(near.wanted))]
    u = rng.random()
    if s == 0:
        return near.near_start[i, int(u * u * near.near_start.shape[1])]
    return near.near_target[routes.target[i, s - 1], int(u * u * near.near_target.shape[1])]


@compiled
def base_after(routes: Routes, near: Neighbourhood, rng: np.random.Generator, i: int, s: int) -> int:
    """Draw a base to fly to after the first `s` stops of UAV `i`; nearer ones more often."""
    u = rng.random()
    place = int(u * u * near.near_base.shape[1])
    return near.near_base_at_start[i, place] if s == 0 else near.near_base[routes.target[i, s - 1], place]
