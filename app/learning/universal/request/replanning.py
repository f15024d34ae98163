"""Episodes of a few UAVs: the policy plans their routes anew, in what the others of a plan leave to them.

A whole episode that is better than a good plan everywhere is rare. So some UAVs near each other are taken out
of the plan, all others fly as they do in it, and what then is still needed and in stock, with those UAVs
alone, is a small problem, which a policy for every size plays as any other. Of each such group the best
episode stays; where it makes the plan better, the next group finds it so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from app.learning.universal.episodes.played import AnySizePolicy, exploration
from app.learning.universal.episodes.routes import NOBODY, fly_routes
from app.simulation.arrays import Flags, Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, earned_now, new_episodes, reach_verdict, reset_one, verdict
from app.simulation.stacks import part
from app.simulation.visit import ALLOWED, COMMITTED_ELSEWHERE, OUT_OF_RANGE, START, TOO_LONG_ALOFT, leg
from app.simulation.worth import cost_of
from app.solvers.protocol import StopCriterion, no_spare_threads
from app.solvers.stop import never

_FEWEST, _MOST = 2, 6
"""UAVs of a group."""

_NEAR_SHARE = 0.7
"""Share of the groups whose UAVs fly near each other; the others are any."""

_EPISODES = 8
"""Episodes of a group."""

_LEAST_GROUPS, _MOST_GROUPS = 8, 24
"""Groups of a round: all begin from the same plan."""

_ROUNDS = 3
"""Rounds that there are at least, where they have more groups than the least."""

_TARGETS = 48
"""Most targets of a group's problem; those that could earn most."""


class Residual(NamedTuple):
    """What the other UAVs of a plan leave to G groups.

    Attributes
    ----------
    arrays
        A stack of G problems of at most ``_MOST`` UAVs and ``_TARGETS`` targets.
    uavs
        (G, I) which UAVs of the whole problem they are; those that only fill the shape have returned.
    targets
        (G, J) which targets they are; those that only fill the shape need nothing.
    """

    arrays: ProblemArrays
    uavs: Integers
    targets: Integers


def round_of(episodes: int) -> int:
    """Return how many episodes a round has where there are to be so many in all."""
    groups = episodes // (_ROUNDS * _EPISODES)
    return _EPISODES * min(max(groups, _LEAST_GROUPS), _MOST_GROUPS)


def groups_of(arrays: ProblemArrays, plan: Integers, count: int, rng: np.random.Generator) -> Flags:
    """Choose groups of UAVs (G, M) that may still fly, most of them near each other in a plan (S, M).

    There are none where fewer than two UAVs may fly.
    """
    flying = np.flatnonzero(~arrays.ret[0])
    chosen = np.zeros((count, arrays.shape[0]), np.bool_)
    if len(flying) < _FEWEST:
        return chosen[:0]
    sizes = np.minimum(rng.integers(_FEWEST, _MOST + 1, count), len(flying))
    first, near = rng.choice(flying, count), rng.random(count) < _NEAR_SHARE
    gaps = np.empty((count, len(flying)))
    for g in range(count):
        _gaps(arrays, plan, first[g], flying, gaps[g])
    gaps = np.where(near[:, None], gaps * (0.3 + rng.random(gaps.shape)), rng.random(gaps.shape))
    gaps[flying == first[:, None]] = -1.0
    ranks = np.argsort(np.argsort(gaps, axis=1, kind="stable"), axis=1)
    chosen[:, flying] = ranks < sizes[:, None]
    return chosen


def residual_of(arrays: ProblemArrays, plan: Integers, groups: Flags, rng: np.random.Generator) -> Residual:
    """Leave groups (G, M), at least one, out of an allowed plan (S, M); their UAVs act in random orders."""
    count = len(groups)
    n = arrays.shape[1]
    episodes = new_episodes(arrays, count)
    worth = np.empty((count, n))
    for g in range(count):
        _leave(arrays, episodes, g, plan, groups[g], worth[g])
    within = int(min(_TARGETS, max(1, (worth > -np.inf).sum(axis=1).max())))
    targets = np.argsort(-worth, axis=1, kind="stable")[:, :within]
    uavs = np.argsort(np.where(groups, rng.random(groups.shape), 2.0), axis=1)[:, : groups.sum(axis=1).max()]
    row = np.arange(count)[:, None]
    worthwhile = worth[row, targets] > -np.inf
    need = episodes.need[row, targets]
    left = part(arrays, uavs, targets)
    left = left._replace(
        ret=left.ret | ~groups[row, uavs],
        need=np.where(worthwhile[:, :, None], need, 0.0),
        stock=episodes.stock,
    )
    return Residual(left, np.ascontiguousarray(uavs), np.ascontiguousarray(targets))


def replan(
    policy: AnySizePolicy,
    arrays: ProblemArrays,
    plan: Integers,
    episodes: int,
    rng: np.random.Generator,
    stop: StopCriterion = never,
    spare: Callable[[], int] = no_spare_threads,
) -> Integers:
    """Let a policy plan groups of UAVs anew, eight times each, all from the same plan.

    Parameters
    ----------
    policy
        Plays them.
    arrays
        A stack of one problem.
    plan
        (S, M), allowed.
    episodes
        B, at least 1; the last group may have fewer than eight.
    rng
        Chooses the groups and samples their actions.
    stop
        Asked before every turn.
    spare
        Asked at every turn how many threads more it may use then.

    Returns
    -------
    Integers
        (B + 1, S, M) allowed plans: that of every episode, and last the plan with the best episode of each
        group that makes it better, one after the other. None where fewer than two UAVs may fly.
    """
    groups = groups_of(arrays, plan, -(-episodes // _EPISODES), rng)
    if not len(groups):
        return np.empty((0, *plan.shape), np.int64)
    left, uavs, targets = residual_of(arrays, plan, groups, rng)
    which = np.repeat(np.arange(len(groups)), _EPISODES)[:episodes]
    epsilon = exploration(episodes)
    played = policy.play(left, which, rng, stop=stop, spare=spare, epsilon=epsilon).plans
    plans = np.empty((episodes + 1, *plan.shape), np.int64)
    _insert(arrays, new_episodes(arrays, 1), plan, left.ret, uavs, targets, which, played, plans)
    return plans


@njit(cache=True, nogil=True, error_model="numpy")
def _gaps(arrays: ProblemArrays, plan: Integers, one: int, flying: Integers, gaps: Floats) -> None:
    """Write how far the routes of some UAVs are from the route of one: from target to target, at the nearest.

    The place where a UAV is stands for a route without visits; two such routes are infinitely far apart.
    """
    n = arrays.need.shape[1]
    for q in range(len(flying)):
        other, gap = flying[q], np.inf
        for s in range(plan.shape[0]):
            j = plan[s, one]
            if j >= n:
                continue
            visited = False
            for t in range(plan.shape[0]):
                if plan[t, other] < n:
                    visited = True
                    gap = min(gap, leg(arrays, 0, other, j, plan[t, other]))
            if not visited:
                gap = min(gap, arrays.start_target[0, other, j])
        if gap == np.inf:
            for t in range(plan.shape[0]):
                if plan[t, other] < n:
                    gap = min(gap, arrays.start_target[0, one, plan[t, other]])
        gaps[q] = gap


@njit(cache=True, nogil=True, error_model="numpy")
def _leave(
    arrays: ProblemArrays, episodes: Episodes, g: int, plan: Integers, group: Flags, worth: Floats
) -> None:
    """Fly a plan without a group in episode `g`, and write what each target is worth to the group.

    That is minus infinite where none of its UAVs may go, now or later: loads and ranges only shrink, but for
    reloads. Else it is infinite where one went in the plan, and elsewhere the most that one would earn there
    now, or from where it is with a full load.
    """
    n, reloads = arrays.need.shape[1], episodes.stock.shape[1] > 0
    reset_one(arrays, episodes, g)
    for s in range(plan.shape[0]):
        for i in range(plan.shape[1]):
            j = plan[s, i]
            if j != n and not group[i] and verdict(arrays, episodes, g, i, j) == ALLOWED:
                act(arrays, episodes, g, i, j)
    for j in range(n):
        worth[j] = -np.inf
        for i in range(plan.shape[1]):
            if not group[i]:
                continue
            unloaded = 0.0
            for k in range(episodes.load.shape[2]):
                load = episodes.load[g, i, k]
                if reloads:
                    load = max(load, arrays.full[0, i, k])
                unloaded += min(load, episodes.need[g, j, k])
            if unloaded > 0.0 and _may_come(arrays, episodes, g, i, j):
                cost = cost_of(arrays, 0, leg(arrays, 0, i, START, j))
                worth[j] = max(worth[j], earned_now(arrays, episodes, g, i, j, unloaded) - cost)
    for i in range(plan.shape[1]):
        if group[i]:
            for s in range(plan.shape[0]):
                if plan[s, i] < n and worth[plan[s, i]] > -np.inf:
                    worth[plan[s, i]] = np.inf


@compiled
def _may_come(arrays: ProblemArrays, episodes: Episodes, g: int, i: int, j: int) -> bool:
    """Whether UAV `i` may go to target `j`, or might after what it is committed to, or after a reload."""
    if episodes.ret[g, i]:
        return False
    rule = reach_verdict(arrays, episodes, g, i, j)
    if episodes.stock.shape[1] > 0 and rule in (OUT_OF_RANGE, TOO_LONG_ALOFT):
        return True
    return rule in (ALLOWED, COMMITTED_ELSEWHERE)


@njit(cache=True, nogil=True, error_model="numpy")
def _insert(
    arrays: ProblemArrays,
    episodes: Episodes,
    plan: Integers,
    absent: Flags,
    uavs: Integers,
    targets: Integers,
    which: Integers,
    played: Integers,
    plans: Integers,
) -> None:
    """Write the whole plans of groups' episodes (B, S, I), and last the one that has the best of them."""
    steps, m = plan.shape
    n, home, groups = arrays.need.shape[1], targets.shape[1], len(uavs)
    place, flown, routes = np.empty(m, np.int64), plans[-1], np.ascontiguousarray(plan.T)
    known = fly_routes(arrays, episodes, routes, place, flown, NOBODY)
    rewards, best = np.full(groups, -np.inf), np.empty(groups, np.int64)
    for b in range(len(which)):
        g = which[b]
        routes[:] = plan.T
        for p in range(uavs.shape[1]):
            if not absent[g, p]:
                for s in range(steps):
                    j = played[b, s, p]
                    routes[uavs[g, p], s] = targets[g, j] if j < home else n + (j - home)
        reward = fly_routes(arrays, episodes, routes, place, plans[b], NOBODY)
        if reward > rewards[g]:
            rewards[g], best[g] = reward, b
    merged = plan.copy()
    for g in np.argsort(-rewards):
        routes[:] = merged.T
        for p in range(uavs.shape[1]):
            if not absent[g, p]:
                routes[uavs[g, p]] = plans[best[g], :, uavs[g, p]]
        reward = fly_routes(arrays, episodes, routes, place, flown, NOBODY)
        if reward > known + 1e-12 * abs(known):
            known = reward
            merged[:] = flown
    flown[:] = merged
