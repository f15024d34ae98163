"""Branch and bound over visits of UAVs to targets, best bound first: the bound falls as long as it runs.

Children of a node say of one UAV and one target that it is on its route, or is not. What a node's prices
show to be too far from the incumbent leaves the pools of its children.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple, Protocol

import numpy as np

from app.simulation.arrays import Flags, Floats
from app.solvers.bound.instance import Instance, ceiling
from app.solvers.bound.master import IDLE, MasterSolution
from app.solvers.bound.relaxation import Pools, Priced, Relaxation
from app.solvers.bound.target_sets import TargetSets
from app.solvers.protocol import StopCriterion

PROVEN = 1e-9
"""Distance of bound and incumbent, in the instance's scale, that is no distance."""

_NEAR = 0.01
"""Prices need not be better than this where the node will be branched anyway, see ``Relaxation.tighten``."""

_WHOLE = 1e-6
"""Distance from 0 or 1 at which a share of the master's solution counts as whole."""


class Node(NamedTuple):
    """A part of the search tree: its pools, and the prices and the bound it begins with."""

    pools: Pools
    prices: Floats
    bound: float


class CloseNode(Protocol):
    """Ends a node without branching, where it can."""

    def __call__(self, priced: Priced, pools: Pools, visits: Floats | None, lower: float) -> float | None:
        """Return the best there is in the node, or None if that is not known.

        Parameters
        ----------
        priced, pools
            The node.
        visits
            (M, N) share of the master's optimum in which a UAV visits a target; None where it has none.
        lower
            What is known to be possible; a node that has nothing better may return anything up to it.
        """
        ...


def whole_routes(priced: Priced, pools: Pools, visits: Floats | None, lower: float) -> float | None:  # noqa: ARG001 - the signature is that of `CloseNode`
    """Close a node in whose optimum every UAV flies one route: its value is reached by planned unloading."""
    if visits is None or _is_fractional(visits).any():
        return None
    return priced.bound


class Tree:
    """The search tree of one problem.

    Parameters
    ----------
    instance, sets
        The problem and the sets of targets of each UAV.
    lower
        Reward of a plan that is known, in the instance's scale.
    close
        How nodes end.

    Attributes
    ----------
    lower
        The best that is known to be possible.
    attained
        Whether ``lower`` is known to be reached; False once a node ended without a solution.
    nodes
        Nodes looked at.
    """

    def __init__(
        self, instance: Instance, sets: tuple[TargetSets, ...], lower: float, close: CloseNode = whole_routes
    ) -> None:
        self.relaxation = Relaxation(instance, sets)
        self.lower = lower
        self.attained = True
        self.nodes = 0
        self._close = close
        self._made = 0
        self._heap: list[tuple[float, int, Node]] = []
        self._push(Node(self.relaxation.all_pools(), np.zeros(instance.worth.shape), ceiling(instance)))

    @property
    def bound(self) -> float:
        """Upper bound on every plan, in the instance's scale."""
        return max(self.lower, -self._heap[0][0]) if self._heap else self.lower

    @property
    def proven(self) -> bool:
        """Whether nothing better than ``lower`` is left."""
        return self.bound <= self.lower + PROVEN

    def run(self, stop: StopCriterion, most_nodes: int | None = None) -> None:
        """Go on until the bound is met, `stop` says so, or that many nodes have been looked at."""
        while not self.proven and not stop() and (most_nodes is None or self.nodes < most_nodes):
            self._look_at(heapq.heappop(self._heap)[2], stop)

    def _look_at(self, node: Node, stop: StopCriterion) -> None:
        relaxation = self.relaxation
        self.nodes += 1
        relaxation.restrict(node.pools)
        enough = self.lower + PROVEN
        priced, solution = relaxation.tighten(node.pools, node.prices, enough, stop, _NEAR)
        if priced is not None and solution is not None and not _is_fractional(self._visits(solution)).any():
            closer, solution = relaxation.tighten(node.pools, priced.prices, enough, stop)
            priced = priced if closer is None else closer
        if priced is None:
            self._push(node)
            return
        bound = min(priced.bound, node.bound)
        if bound <= self.lower + PROVEN:
            return
        pools = within_reach(priced, node.pools, relaxation.instance.idle, self.lower)
        here = Node(pools, priced.prices, bound)
        if solution is None and stop():
            self._push(here)
            return
        visits = None if solution is None else self._visits(solution)
        value = self._close(priced._replace(bound=bound), pools, visits, self.lower)
        if value is not None:
            self.lower = max(self.lower, value)
        elif stop():
            self._push(here)
        else:
            self._branch(here, visits)

    def _branch(self, node: Node, visits: Floats | None) -> None:
        i, bit = self._question(node.pools, visits)
        if i < 0:
            # Every UAV has one set left: nothing to ask, so the bound stays as it is, reached or not.
            self.lower, self.attained = max(self.lower, node.bound), False
            return
        has = (self.relaxation.sets[i].mask[node.pools.sets[i]] >> bit) & 1 == 1
        for answer in (True, False):
            pool = node.pools.sets[i][has == answer]
            idle = node.pools.idle[i] and not answer
            if len(pool) or idle:
                sets = (*node.pools.sets[:i], pool, *node.pools.sets[i + 1 :])
                flags = (*node.pools.idle[:i], idle, *node.pools.idle[i + 1 :])
                self._push(Node(Pools(sets, flags), node.prices, node.bound))

    def _question(self, pools: Pools, visits: Floats | None) -> tuple[int, int]:
        """Return the UAV and the target to ask about; -1 and -1 where all is known."""
        if visits is not None and _is_fractional(visits).any():
            uav, target = np.unravel_index(np.argmin(np.abs(visits - 0.5)), visits.shape)
            return int(uav), int(target)
        most, question = 0, (-1, -1)
        for i, pool in enumerate(pools.sets):
            ways = len(pool) + int(pools.idle[i])
            if ways > max(1, most):
                masks = self.relaxation.sets[i].mask[pool]
                shared = 0 if pools.idle[i] else int(np.bitwise_and.reduce(masks))
                asked = int(np.bitwise_or.reduce(masks)) & ~shared
                most, question = ways, (i, asked.bit_length() - 1)
        return question

    def _visits(self, solution: MasterSolution) -> Floats:
        visits = np.zeros(self.relaxation.instance.useful.shape)
        master = self.relaxation.master
        for column in np.flatnonzero(solution.mix > _WHOLE / 10):
            i, r = master.uav[column], master.route[column]
            if r != IDLE:
                own = self.relaxation.sets[i]
                visits[i, own.members[r, : own.size[r]]] += solution.mix[column]
        return visits

    def _push(self, node: Node) -> None:
        self._made += 1
        heapq.heappush(self._heap, (-node.bound, self._made, node))


def within_reach(priced: Priced, pools: Pools, idle: Floats, lower: float) -> Pools:
    """Drop what cannot be part of a plan that earns more than `lower`.

    A plan with that set earns no more than the bound less the set's slack.
    """
    room = priced.bound - lower
    return Pools(
        tuple(pool[priced.slack(i) <= room] for i, pool in enumerate(pools.sets)),
        tuple(may and float(priced.best[i] - idle[i]) <= room for i, may in enumerate(pools.idle)),
    )


def _is_fractional(visits: Floats) -> Flags:
    return np.minimum(visits, 1.0 - visits) > _WHOLE
