"""Routes with contracts: what a UAV alone reckons that a stop more, or one less, is worth to it.

A UAV flies its route alone through the compiled simulator. It counts on what no other contract delivers,
and on what its own contracts deliver. What others do to areas and stocks meanwhile, the makespan and
changes of an earlier plan are known only when all routes are flown together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, new_episodes, promised, verdict
from app.simulation.visit import ALLOWED, START, airborne, left_of, ready

NO_BASE = -1
"""In place of a base: a stop is reached without a reload before it."""

_FORBIDDEN = -np.inf


class Spare(NamedTuple):
    """Two settled routes, as :class:`Market` has them: (2, S), (2, S), (2,), (2,) and (2, S, K)."""

    path: Integers
    contract: Integers
    length: Integers
    worth: Floats
    delivered: Floats


class Market(NamedTuple):
    """All UAVs' routes, and what is still open.

    Attributes
    ----------
    arrays
        A stack of one problem.
    episodes
        One episode, in which single UAVs fly.
    path, contract
        (M, S) the stops of each route, and the number of the contract that each belongs to: a stop and the
        reload before it have one number. 0 is what a UAV was committed to from the beginning.
    length
        (M,) stops of each route.
    worth
        (M,) what each route earns by its UAV's reckoning.
    settled, settled_length, delivered
        (M, S), (M,) and (M, S, K): the routes that others know of, and what each stop of them delivers.
    left
        (N, K) what no settled route delivers.
    trial, trial_contract, amounts
        (S + 2,), (S + 2,) and (S + 2, K): a route that is tried, and what it delivers.
    flights
        (1,) routes flown so far.
    spare
        Two UAVs' routes, put aside.
    """

    arrays: ProblemArrays
    episodes: Episodes
    path: Integers
    contract: Integers
    length: Integers
    worth: Floats
    settled: Integers
    settled_length: Integers
    delivered: Floats
    left: Floats
    trial: Integers
    trial_contract: Integers
    amounts: Floats
    flights: Integers
    spare: Spare


def new_market(arrays: ProblemArrays) -> Market:
    """Open a market for a stack of one problem: nothing is contracted but what UAVs are committed to."""
    m, _, k = arrays.shape
    steps = int(arrays.max_steps[0])
    market = Market(
        arrays,
        new_episodes(arrays, 1),
        np.zeros((m, steps), np.int64),
        np.zeros((m, steps), np.int64),
        np.zeros(m, np.int64),
        np.zeros(m),
        np.zeros((m, steps), np.int64),
        np.zeros(m, np.int64),
        np.zeros((m, steps, k)),
        arrays.need[0].copy(),
        np.zeros(steps + 2, np.int64),
        np.zeros(steps + 2, np.int64),
        np.zeros((steps + 2, k)),
        np.zeros(1, np.int64),
        Spare(
            np.zeros((2, steps), np.int64),
            np.zeros((2, steps), np.int64),
            np.zeros(2, np.int64),
            np.zeros(2),
            np.zeros((2, steps, k)),
        ),
    )
    clear(market)
    return market


@compiled
def clear(market: Market) -> None:
    """Cancel all contracts, but keep what UAVs are committed to."""
    arrays, episodes = market.arrays, market.episodes
    home = arrays.need.shape[1]
    for j in range(home):
        for k in range(market.left.shape[1]):
            market.left[j, k] = arrays.need[0, j, k]
    for i in range(market.path.shape[0]):
        market.length[i] = market.settled_length[i] = 0
        market.worth[i] = fly_trial(market, i, 0, False)
        for _ in range(market.path.shape[1]):
            prepare(market, i, 0)
            for place in range(market.length[i]):
                act(arrays, episodes, 0, i, market.path[i, place])
            j = promised(arrays, episodes, 0, i)
            if j == home:
                break
            market.path[i, market.length[i]] = j
            market.contract[i, market.length[i]] = 0
            market.length[i] += 1
        settle(market, i)


@compiled
def prepare(market: Market, i: int, length: int) -> None:
    """Put UAV `i` back to where it begins, before it flies the first stops of the trial."""
    arrays, episodes = market.arrays, market.episodes
    home, materials = arrays.need.shape[1], market.left.shape[1]
    episodes.at[0, i] = START
    episodes.flown[0, i] = arrays.uavs[0, i].dis
    episodes.clock[0, i] = ready(arrays, 0, i)
    episodes.aloft[0, i] = airborne(arrays, 0, i)
    episodes.visits[0, i] = 0
    episodes.ret[0, i] = arrays.ret[0, i]
    for k in range(materials):
        episodes.load[0, i, k] = arrays.load[0, i, k]
    for d in range(episodes.stock.shape[1]):
        for k in range(materials):
            episodes.stock[0, d, k] = arrays.stock[0, d, k]
    for place in range(length):
        j = market.trial[place]
        if j < home:
            for k in range(materials):
                episodes.need[0, j, k] = market.left[j, k]
    for place in range(market.settled_length[i]):
        j = market.settled[i, place]
        if j < home:
            for k in range(materials):
                # Areas that are not on the trial are not looked at.
                episodes.need[0, j, k] += market.delivered[i, place, k]


@compiled
def fly_trial(market: Market, i: int, length: int, skips: bool) -> float:
    """Fly the trial with UAV `i` alone, and write what it delivers.

    Parameters
    ----------
    market
        The market.
    i
        The UAV.
    length
        Stops of the trial.
    skips
        Whether stops that are not allowed are left out of the trial; ``amounts[S + 1, 0]`` has how many.

    Returns
    -------
    float
        What it earns; minus infinity where a stop is not allowed and none may be left out.
    """
    arrays, episodes = market.arrays, market.episodes
    home, materials = arrays.need.shape[1], market.left.shape[1]
    prepare(market, i, length)
    market.flights[0] += 1
    earned, kept = 0.0, 0
    for place in range(length):
        j = market.trial[place]
        if verdict(arrays, episodes, 0, i, j) != ALLOWED:
            if not skips:
                return _FORBIDDEN
            continue
        market.trial[kept], market.trial_contract[kept] = j, market.trial_contract[place]
        for k in range(materials):
            market.amounts[kept, k] = episodes.need[0, j, k] if j < home else 0.0
        earned += act(arrays, episodes, 0, i, j)
        if j < home:
            for k in range(materials):
                market.amounts[kept, k] -= episodes.need[0, j, k]
        kept += 1
    market.amounts[market.amounts.shape[0] - 1, 0] = length - kept
    return earned + act(arrays, episodes, 0, i, home)


@compiled
def settle(market: Market, i: int) -> int:
    """Make the route of UAV `i` known: what it delivers is no longer open.

    Stops that are not allowed any more, because another route that was settled before delivers there, are
    left out; how many is returned.
    """
    steps, materials = market.path.shape[1], market.left.shape[1]
    home = market.arrays.need.shape[1]
    copy_to_trial(market, i)
    market.worth[i] = fly_trial(market, i, market.length[i], True)
    lost = int(market.amounts[market.amounts.shape[0] - 1, 0])
    give_back(market, i)
    market.length[i] -= lost
    market.settled_length[i] = market.length[i]
    for place in range(min(steps, market.length[i])):
        j = market.trial[place]
        market.path[i, place] = market.settled[i, place] = j
        market.contract[i, place] = market.trial_contract[place]
        for k in range(materials):
            amount = market.amounts[place, k]
            market.delivered[i, place, k] = amount
            if j < home and amount > 0.0:
                requested = market.arrays.requested[0, j, k]
                market.left[j, k] = left_of(market.left[j, k], amount, requested)
    return lost


@compiled
def give_back(market: Market, i: int) -> None:
    """Open what the settled route of UAV `i` delivers, and forget that route."""
    home = market.arrays.need.shape[1]
    for place in range(market.settled_length[i]):
        j = market.settled[i, place]
        if j < home:
            for k in range(market.left.shape[1]):
                market.left[j, k] += market.delivered[i, place, k]
    market.settled_length[i] = 0


@compiled
def copy_to_trial(market: Market, i: int) -> None:
    """Make the route of UAV `i` the trial."""
    for place in range(market.length[i]):
        market.trial[place] = market.path[i, place]
        market.trial_contract[place] = market.contract[i, place]


@compiled
def is_open(market: Market, i: int, j: int) -> bool:
    """Whether an area needs something that UAV `i` ever carries."""
    for k in range(market.left.shape[1]):
        if market.left[j, k] > 0.0 and (
            market.arrays.load[0, i, k] > 0.0 or market.arrays.full[0, i, k] > 0.0
        ):
            return True
    return False


@compiled
def bid(market: Market, i: int, j: int) -> tuple[float, int, int]:
    """Return what area `j` is worth more to UAV `i` than its route without it, and how it is flown to.

    Returns
    -------
    gain, place, base
        The largest gain, minus infinity where it cannot be flown to; its place in the route; and the base at
        which the UAV reloads before it, or :data:`NO_BASE`.
    """
    best, best_place, best_base = _FORBIDDEN, 0, NO_BASE
    length, steps = market.length[i], market.path.shape[1]
    for base in range(-1, market.arrays.stock.shape[1]):
        added = 1 if base == NO_BASE else 2
        if length + added > steps:
            continue
        for place in range(length + 1):
            put(market, i, j, place, base)
            gain = fly_trial(market, i, length + added, False) - market.worth[i]
            if gain > best:
                best, best_place, best_base = gain, place, base
    return best, best_place, best_base


@compiled
def put(market: Market, i: int, j: int, place: int, base: int) -> None:
    """Make the route of UAV `i` the trial, with area `j`, and the base before it, at a place."""
    added = 0
    for before in range(place):
        market.trial[before], market.trial_contract[before] = (
            market.path[i, before], market.contract[i, before],
        )  # fmt: skip
    if base != NO_BASE:
        market.trial[place], added = market.arrays.need.shape[1] + 1 + base, 1
    market.trial[place + added] = j
    for after in range(place, market.length[i]):
        market.trial[after + added + 1] = market.path[i, after]
        market.trial_contract[after + added + 1] = market.contract[i, after]


@compiled
def take(market: Market, i: int, j: int, place: int, base: int, number: int) -> None:
    """Put area `j` into the route of UAV `i` at a place, as contract `number`; it is not settled yet."""
    put(market, i, j, place, base)
    added = 1 if base == NO_BASE else 2
    for part in range(added):
        market.trial_contract[place + part] = number
    market.length[i] += added
    for each in range(market.length[i]):
        market.path[i, each] = market.trial[each]
        market.contract[i, each] = market.trial_contract[each]
    market.worth[i] = fly_trial(market, i, market.length[i], False)


@compiled
def drop(market: Market, i: int, first: int, last: int) -> None:
    """Take contracts with numbers from `first` to `last` out of the route of UAV `i`; it is not settled yet.

    So are stops that are not allowed without them.
    """
    kept = 0
    for place in range(market.length[i]):
        if not first <= market.contract[i, place] <= last:
            market.trial[kept] = market.path[i, place]
            market.trial_contract[kept] = market.contract[i, place]
            kept += 1
    market.worth[i] = fly_trial(market, i, kept, True)
    market.length[i] = kept - int(market.amounts[market.amounts.shape[0] - 1, 0])
    for place in range(market.length[i]):
        market.path[i, place] = market.trial[place]
        market.contract[i, place] = market.trial_contract[place]


@compiled
def put_aside(market: Market, i: int, place: int) -> None:
    """Copy the settled route of UAV `i` to one of the two places of ``spare``."""
    spare = market.spare
    spare.length[place], spare.worth[place] = market.length[i], market.worth[i]
    for at in range(market.length[i]):
        spare.path[place, at], spare.contract[place, at] = market.path[i, at], market.contract[i, at]
        for k in range(market.left.shape[1]):
            spare.delivered[place, at, k] = market.delivered[i, at, k]


@compiled
def put_back(market: Market, i: int, place: int) -> None:
    """Make the route of a place of ``spare`` the one of UAV `i` again, which has given its own back."""
    spare, arrays = market.spare, market.arrays
    market.length[i] = market.settled_length[i] = spare.length[place]
    market.worth[i] = spare.worth[place]
    for at in range(market.length[i]):
        j = spare.path[place, at]
        market.path[i, at] = market.settled[i, at] = j
        market.contract[i, at] = spare.contract[place, at]
        for k in range(market.left.shape[1]):
            amount = spare.delivered[place, at, k]
            market.delivered[i, at, k] = amount
            if j < arrays.need.shape[1] and amount > 0.0:
                market.left[j, k] = left_of(market.left[j, k], amount, arrays.requested[0, j, k])
