"""What every UAV could earn at every area now: kept up to date action by action, not worked out anew.

Also what distances, rewards and times are divided by.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.universal.episodes.observation import FORBIDDEN, scales
from app.simulation.arrays import NONE, Flags, Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import earned_now, leg_to, verdict
from app.simulation.visit import ALLOWED
from app.simulation.worth import cost_of

FOLLOW_UPS = 16
"""Near areas considered for the visit after the next."""

FAR = 10.0
"""Spans that a leg is long at most; a leg that does not exist is that long."""


class Gains(NamedTuple):
    """What each episode's UAVs could earn at each area now; kept up to date action by action.

    Attributes
    ----------
    span, level, time
        (P,) scales of each problem: distances, rewards, times.
    near
        (P, N, L) the areas nearest to each area.
    net
        (B, M, N) reward of a visit now; ``FORBIDDEN`` where it is not allowed.
    unloaded
        (B, M, N) amounts it would unload, all materials together.
    reloads
        (B, M, D) whether a reload is allowed now.
    acted
        (B, M) UAVs that have acted in this step.
    chosen
        (B, N+1+D) highest number of a UAV that has chosen a place in this step; ``NONE`` where none has.
    first, second
        (M,) scratch: the best and the second best of each UAV's visits.
    """

    span: Floats
    level: Floats
    time: Floats
    near: Integers
    net: Floats
    unloaded: Floats
    reloads: Flags
    acted: Flags
    chosen: Integers
    first: Floats
    second: Floats


def nearness(arrays: ProblemArrays, span: Floats) -> Float32s:
    """Return how far places, areas then bases, are apart, in spans, (P, N+D, N+D); by the nearest class."""
    n = arrays.shape[1]
    apart = arrays.between.min(axis=1) / span[:, None, None]
    if arrays.n_bases:
        places = np.r_[0:n, n + 1 : n + 1 + arrays.n_bases]
        apart = apart[:, places][:, :, places]
    return np.minimum(apart, FAR).astype(np.float32)


def new_gains(arrays: ProblemArrays, batch: int) -> Gains:
    """Make the gains of `batch` episodes; :func:`look` fills it."""
    m, n, _ = arrays.shape
    span, level, time = scales(arrays)
    length = max(1, min(FOLLOW_UPS, n - 1))
    between = arrays.between[:, :, :n, :n].min(axis=1)
    between = np.where(arrays.areas["need_total"][:, None, :] > 0, between, np.inf)
    between[:, np.arange(n), np.arange(n)] = np.inf
    near = np.argsort(between, axis=2, kind="stable")[:, :, :length]
    return Gains(
        span=span,
        level=level,
        time=time,
        near=np.ascontiguousarray(near, dtype=np.int64),
        net=np.empty((batch, m, n)),
        unloaded=np.empty((batch, m, n)),
        reloads=np.zeros((batch, m, arrays.n_bases), np.bool_),
        acted=np.zeros((batch, m), np.bool_),
        chosen=np.full((batch, n + 1 + arrays.n_bases), NONE, np.int64),
        first=np.empty(m),
        second=np.empty(m),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def look(arrays: ProblemArrays, episodes: Episodes, gains: Gains) -> None:
    """Work out everything of the gains for the present state of every episode."""
    for b in range(episodes.at.shape[0]):
        for i in range(episodes.at.shape[1]):
            look_at(arrays, episodes, gains, b, i)


@compiled
def look_at(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int) -> None:
    """Work out what UAV `i` of episode `b` could do now."""
    n = episodes.need.shape[1]
    for j in range(n):
        _value(arrays, episodes, gains, b, i, j)
    for d in range(gains.reloads.shape[2]):
        gains.reloads[b, i, d] = verdict(arrays, episodes, b, i, n + 1 + d) == ALLOWED


@compiled
def look_again(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int, action: int) -> None:
    """Bring the gains up to date after UAV `i` of episode `b` took an action."""
    gains.acted[b, i] = True
    if action != episodes.need.shape[1]:
        gains.chosen[b, action] = max(i, gains.chosen[b, action])
    look_at(arrays, episodes, gains, b, i)
    if action < episodes.need.shape[1]:
        for other in range(episodes.at.shape[1]):
            _value(arrays, episodes, gains, b, other, action)


@compiled
def begin_step(episodes: Episodes, gains: Gains, b: int) -> None:
    """Let nobody have acted but those who have returned."""
    for i in range(episodes.at.shape[1]):
        gains.acted[b, i] = episodes.ret[b, i]
    for j in range(gains.chosen.shape[1]):
        gains.chosen[b, j] = NONE


@compiled
def in_order(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int, j: int) -> bool:
    """Whether UAV `i` may choose a place after those that have chosen it in this step.

    In a plan the UAVs act in the order of their numbers, so at a place they have to do so here: otherwise
    what one unloads, or loads, would not be what it does in the plan. Where there is enough for everybody, of
    need or of stock, it is the same in any order.
    """
    if gains.chosen[b, j] < i:
        return True
    p, n = episodes.problem[b], episodes.need.shape[1]
    for k in range(episodes.load.shape[2]):
        load = episodes.load[b, i, k]
        if j > n:
            if arrays.full[p, i, k] - load > episodes.stock[b, j - n - 1, k]:
                return False
        elif arrays.need[p, j, k] > 0.0 and load > episodes.need[b, j, k]:
            return False
    # Of first shares that earn more, everybody's part depends on the order.
    return j > n or arrays.terms[p].bonus == 0.0


@compiled
def _value(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int, j: int) -> None:
    p = episodes.problem[b]
    if verdict(arrays, episodes, b, i, j) != ALLOWED:
        gains.net[b, i, j], gains.unloaded[b, i, j] = FORBIDDEN, 0.0
        return
    unloaded = 0.0
    for k in range(episodes.load.shape[2]):
        unloaded += min(episodes.load[b, i, k], episodes.need[b, j, k])
    cost = cost_of(arrays, p, leg_to(arrays, episodes, b, i, j))
    gains.net[b, i, j] = earned_now(arrays, episodes, b, i, j, unloaded) - cost
    gains.unloaded[b, i, j] = unloaded


@compiled
def best_two_of_each(episodes: Episodes, gains: Gains, b: int) -> None:
    """Fill the scratch space with the best and second best visit of every UAV."""
    for other in range(episodes.at.shape[1]):
        first, second = FORBIDDEN, FORBIDDEN
        for j in range(episodes.need.shape[1]):
            net = gains.net[b, other, j]
            if net > first:
                first, second = net, first
            elif net > second:
                second = net
        gains.first[other], gains.second[other] = first, second
