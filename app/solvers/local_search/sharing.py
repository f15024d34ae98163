"""A plan shared out among threads: each changes the routes of some UAVs, and then they are put together.

The UAVs of a part fly to targets that lie near each other, and only targets of the part are put into their
routes. So what one thread does seldom changes what another one's visits unload; where it does, the routes
earn less together than each thread thought, and the annealing goes on from that. Shares differ each time
(Taillard and Voss, "POPMUSIC", in Essays and Surveys in Metaheuristics, 2002, of improving a solution part by
part).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from typing import NamedTuple

import numpy as np

from app.simulation.arrays import NONE, Flags, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.solvers.local_search.annealing import Prices, Search, anneal, keep_best, set_route, worth
from app.solvers.local_search.neighbourhood import Neighbourhood, draw, nearest
from app.solvers.local_search.routes import Routes, copy_routes, empty_routes
from app.solvers.protocol import StopCriterion

_NEIGHBOURS = 8
"""Targets around one to which a part grows next."""

_LEAST_UAVS = 8
"""UAVs for each thread, at least."""

_MOVES_A_STOP = 6_000
"""Moves of all threads for each stop of the plan up to which they share it."""

_PIECES = 250
"""Times that a plan is shared out anew in a round, about."""

_LEAST_S = 0.004
"""Seconds of work between two of them, at least."""


class Parts(NamedTuple):
    """The part of each UAV, (M,), and of each target, (L,); NONE where nothing is to be changed."""

    uav: Integers
    target: Integers


class _Before(NamedTuple):
    """Routes before a part of the work, (M, S) and (M,), and what their plan was worth."""

    target: Integers
    length: Integers
    value: float

    def differs_from(self, routes: Routes) -> Flags:
        """Whose routes are others now, (M,)."""
        stops = np.arange(self.target.shape[1]) < self.length[:, None]
        others = ((routes.target != self.target) & stops).any(axis=1)
        return np.asarray((routes.length != self.length) | others)


class Team:
    """Threads that share a plan.

    Parameters
    ----------
    searches
        Of one problem, a thread each; the first has the plan. All are changed.
    generators
        The only source of randomness, one a search.
    stops
        One a search: when the first one's says so, all end; another's lets its thread go.
    threads
        Where all but the first run.
    """

    def __init__(
        self,
        searches: Sequence[Search],
        generators: Sequence[np.random.Generator],
        stops: Sequence[StopCriterion],
        threads: Executor,
    ) -> None:
        self._searches, self._generators, self._stops = searches, generators, stops
        self._threads = threads
        self._spare = empty_routes(searches[0].arrays)

    def anneal(
        self,
        moves: int,
        at_once: int,
        hot: float,
        cold: float,
        prices: Prices,
        collecting: bool,
        large: float,
    ) -> None:
        """Anneal the first search's plan; see :func:`~app.solvers.local_search.annealing.anneal`.

        Parameters
        ----------
        moves, at_once
            Of each thread, and after how many of them a stop criterion is asked.
        hot, cold, prices, collecting, large
            As there.
        """
        first, rng = self._searches[0], self._generators[0]
        there = [True, *(not stop() for stop in self._stops[1:])]
        nears = share_out(first, rng, sum(there))
        crew = [
            (search._replace(near=nears.pop(0)), rng, stop)
            for search, rng, stop, is_there in zip(
                self._searches, self._generators, self._stops, there, strict=True
            )
            if is_there
        ]
        before = _Before(first.routes.target.copy(), first.routes.length.copy(), worth(first, prices.useless))
        for search, _, _ in crew[1:]:
            _follow(search, first)

        def work(search: Search, rng: np.random.Generator, stop: StopCriterion) -> None:
            done, idle = 0, not (len(search.near.active) and len(search.near.wanted))
            while done < moves and not idle and not stop():
                count = min(at_once, moves - done)
                begin, end = (hot * (cold / hot) ** (made / moves) for made in (done, done + count))
                anneal(search, rng, count, begin, end, prices, collecting, large)
                done += count

        others = [self._threads.submit(work, *one) for one in crew[1:]]
        work(*crew[0])
        for other in others:
            other.result()
        if others:
            self._put_together([search for search, _, _ in crew], before, prices)

    def _put_together(self, searches: list[Search], before: _Before, prices: Prices) -> None:
        """Give the first search the plan and the incumbent that all have found."""
        first, gains = searches[0], [worth(search, prices.useless) - before.value for search in searches]
        leading = int(np.argmax(gains))
        ours = searches[leading]
        for number, (search, gain) in enumerate(zip(searches, gains, strict=True)):
            if number == leading:
                continue
            copy_routes(ours.routes, self._spare)
            expected = worth(ours, prices.useless) + gain
            for i in map(int, np.flatnonzero(search.near.own & before.differs_from(search.routes))):
                set_route(ours, i, search.routes.target[i, : search.routes.length[i]])
            # More is lost where the two meet than the change was about.
            if expected - worth(ours, prices.useless) > abs(gain):
                copy_routes(self._spare, ours.routes)
        keep_best(ours)
        if leading:
            copy_routes(ours.routes, first.routes)
        best = max(searches, key=lambda search: float(search.best[0]))
        if best.best[0] > first.best[0]:
            np.copyto(first.best, best.best)
            np.copyto(first.best_target, best.best_target)
            np.copyto(first.best_length, best.best_length)


def pays(search: Search, threads: int, moves: float) -> bool:
    """Whether threads that share a plan find a better one than threads that have one each.

    They do where there are few moves for each stop (``tests/benchmarks/LOG.md``), unless all take from the
    same stocks.

    Parameters
    ----------
    search
        The search with the plan.
    threads, moves
        How many threads, and about how many moves each makes.
    """
    stops = max(1, int(search.routes.length.sum()))
    stocked = bool(np.isfinite(search.arrays.stock).any())
    enough = len(search.near.active) >= _LEAST_UAVS * threads
    return threads > 1 and enough and not stocked and threads * moves <= _MOVES_A_STOP * stops


def moves_at_once(expected: float, a_second: float) -> int:
    """Return after how many moves of each thread a plan is shared out anew.

    Parameters
    ----------
    expected
        Moves of the round.
    a_second
        How many a thread makes.
    """
    return max(1, round(max(expected / _PIECES, _LEAST_S * a_second)))


def share_out(search: Search, rng: np.random.Generator, parts: int) -> list[Neighbourhood]:
    """Divide UAVs and targets so that what lies together, and UAVs that meet there, are in one part.

    Returns
    -------
    list of Neighbourhood
        What the moves of each part draw from; some may be without UAVs or without targets.
    """
    routes, near = search.routes, search.near
    if parts == 1 or not (len(near.active) and len(near.wanted)):
        return [near] * parts
    found = Parts(np.full(len(routes.length), NONE), np.full(len(routes.first), NONE))
    queue, queued = np.empty(len(found.target), np.int64), np.empty(len(found.target), np.bool_)
    _share_out(routes, near, rng, parts, found, queue, queued)
    return [_narrowed(search.arrays, routes, near, found, part) for part in range(parts)]


@compiled
def _share_out(
    routes: Routes, near: Neighbourhood, rng: np.random.Generator, parts: int, found: Parts,
    queue: Integers, queued: Flags,
) -> None:  # fmt: skip
    """Fill in the parts; a queue of (L,) targets and (L,) flags are scratch space."""
    size = (len(near.wanted) + routes.length.sum()) / parts
    for part in range(parts - 1):
        seed = near.wanted[draw(rng, len(near.wanted))]
        _grow(routes, near, found, part, seed, size, queue, queued)
    for j in near.wanted:
        if found.target[j] == NONE:
            found.target[j] = parts - 1
    for i in near.active:
        if found.uav[i] == NONE:
            found.uav[i] = parts - 1 if routes.length[i] > 0 else found.target[near.near_start[i, 0]]


@compiled
def _add_neighbours(
    near: Neighbourhood, found: Parts, j: int, tail: int, queue: Integers, queued: Flags
) -> int:
    """Put the neighbours of a target that are in no part into the queue; return its new end."""
    for place in range(min(_NEIGHBOURS, near.near_target.shape[1])):
        neighbour = near.near_target[j, place]
        if not queued[neighbour] and found.target[neighbour] == NONE:
            queue[tail], queued[neighbour] = neighbour, True
            tail += 1
    return tail


@compiled
def _grow(
    routes: Routes, near: Neighbourhood, found: Parts, part: int, seed: int, size: float,
    queue: Integers, queued: Flags,
) -> None:  # fmt: skip
    """Take targets into a part, with the UAVs that visit them and all that these visit, until it is full.

    Its size counts targets and stops.
    """
    m, n_targets = len(routes.length), len(routes.first) - near.near_base.shape[1] - 1
    queued[:] = False
    queue[0], queued[seed] = seed, True
    head, tail, taken, unseen = 0, 1, 0.0, 0
    while taken < size:
        if head == tail:
            # Islands: the next one begins with any target.
            while unseen < len(near.wanted) and (
                queued[near.wanted[unseen]] or found.target[near.wanted[unseen]] != NONE
            ):
                unseen += 1
            if unseen == len(near.wanted):
                return
            queue[tail], queued[near.wanted[unseen]] = near.wanted[unseen], True
            tail += 1
        j = queue[head]
        head += 1
        if found.target[j] == NONE:
            found.target[j] = part
            taken += 1.0
        slot = routes.first[j]
        while slot != NONE:
            i = slot % m
            slot = routes.following[slot]
            if found.uav[i] != NONE:
                continue
            found.uav[i] = part
            taken += routes.length[i]
            for s in range(routes.length[i]):
                other = routes.target[i, s]
                if other < n_targets and found.target[other] == NONE:
                    found.target[other] = part
                    taken += 1.0
                    if not queued[other]:
                        queue[tail], queued[other] = other, True
                        tail += 1
        tail = _add_neighbours(near, found, j, tail, queue, queued)


def _narrowed(
    arrays: ProblemArrays, routes: Routes, near: Neighbourhood, parts: Parts, part: int
) -> Neighbourhood:
    """Return a neighbourhood without the other parts' UAVs and targets."""
    wanted = near.wanted[parts.target[near.wanted] == part]
    own = parts.uav == part
    near_target, near_start = near.near_target.copy(), near.near_start.copy()
    if len(wanted):
        bases = np.arange(len(near_target) - near.near_base.shape[1], len(near_target))
        from_bases = arrays.between[0][:, bases].min(axis=0)
        length = near_target.shape[1]
        near_target[bases] = np.resize(
            nearest(from_bases, wanted, min(length, len(wanted))), (len(bases), length)
        )
        anywhere = np.tile(wanted[np.arange(length) % len(wanted)], (len(near_target), 1))
        _keep_own(near_target, anywhere, wanted, parts.target, part)
        # Where none of the first targets is its own, those around the first stop are.
        at = np.where(routes.length > 0, routes.target[:, 0], near.near_start[:, 0])
        _keep_own(near_start, near_target[at], np.flatnonzero(own), parts.target, part)
    return near._replace(
        active=near.active[own[near.active]],
        wanted=wanted,
        near_target=near_target,
        near_start=near_start,
        own=own,
    )


@compiled
def _keep_own(lists: Integers, others: Integers, rows: Integers, part_of: Integers, part: int) -> None:
    """Leave the targets of a part in rows of lists, over and over until each is full.

    Parameters
    ----------
    lists
        (R, T) targets; changed.
    others
        (R, T) what a row without any of its own gets.
    rows
        Which rows.
    part_of, part
        (L,) the part of each target, and the part.
    """
    for r in rows:
        count = 0
        for place in range(lists.shape[1]):
            if part_of[lists[r, place]] == part:
                lists[r, count] = lists[r, place]
                count += 1
        for place in range(count, lists.shape[1]):
            lists[r, place] = lists[r, place - count] if count > 0 else others[r, place]


def _follow(search: Search, first: Search) -> None:
    """Give a search the plan of the first one, and the reward that its incumbent has to exceed."""
    copy_routes(first.routes, search.routes)
    np.copyto(search.best, first.best)
