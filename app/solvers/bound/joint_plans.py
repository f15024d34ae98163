"""Every plan of a part of the search tree that could beat the incumbent, flown one after the other.

At the node's prices a plan earns at most the bound less the sum of its UAVs' slacks (README.md): so only
routes with little slack are combined, and only as long as their slacks leave something to gain. What a plan
earns is evaluated by the simulator, which knows which UAV unloads first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, close, new_episodes, reset_one, verdict
from app.simulation.visit import ALLOWED, START, airborne, leg, ready
from app.solvers.bound.instance import Instance
from app.solvers.bound.relaxation import Pools, Priced
from app.solvers.bound.target_sets import Members, TargetSets
from app.solvers.local_search.routes import lay
from app.solvers.protocol import StopCriterion

_MOST_ROUTES = 20_000
"""Routes of a UAV that are combined; a node with more is branched."""

_MOST_ORDERS = 3_000_000
"""Visits that are tried to find those routes; a node that would take more is branched."""

_MOST_PLANS = 200_000
"""Steps of the enumeration after which a node is rather branched: some tenths of a second."""

_PIECE = 2_000
"""Steps between two looks at the stop criterion: a few milliseconds."""


class JointPlans:
    """A :class:`~app.solvers.bound.tree.CloseNode` for plans that unload greedily.

    Attributes
    ----------
    actions
        (S, M) the best plan found, or None.
    """

    def __init__(self, instance: Instance, sets: tuple[TargetSets, ...], stop: StopCriterion) -> None:
        self.actions: Integers | None = None
        self._instance, self._sets, self._stop = instance, sets, stop
        self._episodes = new_episodes(instance.arrays, 1)

    def __call__(self, priced: Priced, pools: Pools, visits: Floats | None, lower: float) -> float | None:  # noqa: ARG002 - the signature is that of `CloseNode`
        """Fly all plans of the node; None if there are too many while something is left to ask."""
        arrays, m = self._instance.arrays, len(pools.sets)
        decided = all(len(pool) + int(idle) <= 1 for pool, idle in zip(pools.sets, pools.idle, strict=True))
        room = priced.bound - lower
        routes = []
        for i in range(m):
            found = self._routes(priced, pools, i, room)
            if found is None or self._stop():
                return None
            routes.append(found)
        offset = np.concatenate(([0], np.cumsum([len(found[1]) for found in routes]))).astype(np.int64)
        targets = np.concatenate([found[0] for found in routes])
        length = np.concatenate([found[1] for found in routes])
        slack = np.concatenate([found[2] for found in routes])
        order = np.argsort(np.diff(offset), kind="stable")
        cursor, spent = np.zeros(m + 1, np.int64), np.zeros(m + 1)
        cursor[0] = offset[order[0]]
        best, chosen, level = np.array([lower]), np.full(m, -1), np.zeros(1, np.int64)
        steps = 0
        while True:
            if _explore(
                arrays, self._episodes, order, offset, targets, length, slack, cursor, spent, level,
                priced.bound, self._instance.scale, best, chosen, _PIECE,
            ):  # fmt: skip
                break
            steps += _PIECE
            if self._stop() or (steps > _MOST_PLANS and not decided):
                self._keep(chosen, targets, length)
                return None
        self._keep(chosen, targets, length)
        return float(best[0])

    def _keep(self, chosen: Integers, targets: Members, length: Integers) -> None:
        if chosen[0] < 0:
            return
        steps, m = int(self._instance.arrays.max_steps[0]), len(chosen)
        self.actions = np.full((steps, m), self._instance.arrays.areas["level"].shape[1], np.int64)
        for i, q in enumerate(chosen):
            self.actions[: length[q], i] = targets[q, : length[q]]

    def _routes(
        self, priced: Priced, pools: Pools, i: int, room: float
    ) -> tuple[Members, Integers, Floats] | None:
        """Return targets, lengths and slacks of UAV `i`'s routes, least slack first."""
        instance, own, arrays = self._instance, self._sets[i], self._instance.arrays
        pool = pools.sets[i]
        # The pool may have lost sets since the prices were evaluated.
        worth = self._worth(priced, i, pool)
        targets, length, slack = _orders(
            arrays, i, own.members, own.size, own.cost, pool, priced.best[i] - worth, room, instance.price,
            _MOST_ROUTES, _MOST_ORDERS,
        )  # fmt: skip
        if len(length) >= _MOST_ROUTES:
            return None
        if pools.idle[i]:
            targets = np.concatenate([targets, np.zeros((1, targets.shape[1]), np.int16)])
            length = np.append(length, 0)
            slack = np.append(slack, priced.best[i] - instance.idle[i])
        first = np.argsort(slack, kind="stable")
        return targets[first], length[first], slack[first]

    def _worth(self, priced: Priced, i: int, pool: Integers) -> Floats:
        worth = np.full(len(self._sets[i].size), -np.inf)
        worth[priced.pools.sets[i]] = priced.values[i]
        return worth[pool]


@njit(cache=True, error_model="numpy")
def _orders(
    arrays: ProblemArrays,
    i: int,
    members: Members,
    size: Integers,
    cost: Floats,
    pool: Integers,
    slack: Floats,
    room: float,
    price: float,
    most: int,
    tries: int,
) -> tuple[Members, Integers, Floats]:
    """Return the legal orders of a UAV's sets whose slack fits the room; `most` where that is not all.

    It is not all where there are more, or finding them takes more than so many `tries`.
    """
    longest = arrays.max_steps[0]
    targets = np.zeros((most, longest), np.int16)
    length, loss = np.zeros(most, np.int64), np.zeros(most)
    found = 0
    order, used = np.zeros(longest + 1, np.int64), np.zeros(longest + 1, np.bool_)
    route = np.zeros(longest, np.int64)
    flown, clock, aloft = np.zeros(longest + 1), np.zeros(longest + 1), np.zeros(longest + 1)
    way = np.zeros(longest + 1)
    clock[0], aloft[0] = ready(arrays, 0, i), airborne(arrays, 0, i)
    for at in range(len(pool)):
        r, s = pool[at], size[pool[at]]
        if slack[at] > room:
            continue
        depth = 0
        order[0] = -1
        used[:] = False
        while depth >= 0:
            if order[depth] >= 0:
                used[order[depth]] = False
            t = order[depth] + 1
            while t < s:
                if not used[t]:
                    if tries == 0:
                        return targets, length, loss
                    tries -= 1
                    j = members[r, t]
                    route[depth] = j
                    way[depth + 1] = way[depth] + leg(
                        arrays, 0, i, START if depth == 0 else route[depth - 1], j
                    )
                    more = price * way[depth + 1] - cost[r]
                    fits = slack[at] + more <= room + 1e-12 * (abs(room) + cost[r])
                    if fits and lay(arrays, i, route, depth + 1, depth, flown, clock, aloft):
                        break
                t += 1
            if t >= s:
                depth -= 1
                continue
            order[depth] = t
            if depth + 1 == s:
                back = arrays.home[0, i, route[depth]] if arrays.terms[0].charge_return else 0.0
                total = slack[at] + price * (way[depth + 1] + back) - cost[r]
                if total <= room:
                    if found == most:
                        return targets, length, loss
                    for p in range(s):
                        targets[found, p] = members[r, order[p]]
                    length[found], loss[found] = s, total
                    found += 1
                continue
            used[t] = True
            depth += 1
            order[depth] = -1
    return targets[:found].copy(), length[:found].copy(), loss[:found].copy()


@compiled
def _fly(
    arrays: ProblemArrays, episodes: Episodes, choice: Integers, targets: Members, length: Integers
) -> float:
    """Return the reward of one plan, minus infinity if it is not legal."""
    reset_one(arrays, episodes, 0)
    m = arrays.load.shape[1]
    reward, s, going = 0.0, 0, True
    while going:
        going = False
        for i in range(m):
            q = choice[i]
            if s < length[q]:
                going = True
                j: Any = np.int64(targets[q, s])  # so the simulator is not compiled for short numbers too
                if verdict(arrays, episodes, 0, i, j) != ALLOWED:
                    return -np.inf
                reward += act(arrays, episodes, 0, i, j)
        s += 1
    return reward + close(arrays, episodes, 0)


@njit(cache=True, error_model="numpy")
def _explore(
    arrays: ProblemArrays,
    episodes: Episodes,
    order: Integers,
    offset: Integers,
    targets: Members,
    length: Integers,
    slack: Floats,
    cursor: Integers,
    spent: Floats,
    level: Integers,
    bound: float,
    scale: float,
    best: Floats,
    chosen: Integers,
    steps: int,
) -> bool:
    """Go on with the enumeration; True once it is complete.

    ``cursor[l]`` is the route of the l-th UAV in `order`, ``spent[l]`` the slack of those before it.
    """
    m = len(order)
    choice = np.zeros(m, np.int64)
    at = level[0]
    for before in range(at):
        choice[order[before]] = cursor[before]
    for _ in range(steps):
        if at == m:
            reward = _fly(arrays, episodes, choice, targets, length) / scale
            if reward > best[0] + 1e-12:
                best[0] = reward
                chosen[:] = choice
            at -= 1
            cursor[at] += 1
            continue
        i, q = order[at], cursor[at]
        if q >= offset[i + 1] or spent[at] + slack[q] > bound - best[0]:
            if at == 0:
                level[0] = 0
                return True
            at -= 1
            cursor[at] += 1
            continue
        choice[i] = q
        spent[at + 1] = spent[at] + slack[q]
        at += 1
        if at < m:
            cursor[at] = offset[order[at]]
    level[0] = at
    return False
