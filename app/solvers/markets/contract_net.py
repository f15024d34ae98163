"""The contract net protocol: announcement, bids, award, and exchange of contracts.

Smith 1980; with exchange, as the paper's [7] extends it, after Sandholm 1998: a contract is handed on, or
two are swapped, where the two UAVs together gain by it. An area of which something is left is announced
again.
"""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import Floats, Integers
from app.simulation.decorators import compiled, inlined
from app.solvers.markets.network import Network
from app.solvers.markets.routes import (
    Market,
    bid,
    drop,
    give_back,
    is_open,
    put_aside,
    put_back,
    settle,
    take,
)
from app.solvers.protocol import StopCriterion

_LEAST_GAIN = 1e-12
"""Share of a worth below which a gain is rounding."""


_SLICE_STOPS = 2_000
"""Places of routes that are tried between two looks at the stop criterion; an exchange has many of them."""


class ContractNet:
    """One market by announcements.

    Parameters
    ----------
    manager
        (N,) the UAV that announces each area.
    network
        Carries the messages, and counts them.

    Attributes
    ----------
    conflicts
        Always 0: an area has one manager, so nobody is promised what another one has.
    rounds
        Announcements of areas; each takes a few messages one after the other.
    """

    def __init__(self, manager: Integers, network: Network) -> None:
        self._manager, self._network = manager, network
        self._contracts, self._slice = 0, 1
        self.conflicts, self.rounds = 0, 0

    def agree(self, market: Market, order: Integers, stop: StopCriterion) -> None:
        """Announce areas in an order, (N,), until nobody bids; then exchange contracts until nobody gains."""
        # Below it are numbers of contracts that the market was left with.
        self._contracts = max(self._contracts, market.path.shape[1])
        self._slice = max(1, _SLICE_STOPS // market.path.shape[1] ** 2)
        open_areas = list(order)
        while open_areas and not stop():
            open_areas = [j for j in open_areas if not stop() and self._announce(market, int(j), stop)]
        improved = True
        while improved and not stop():
            improved = False
            for i in range(len(market.length)):
                if stop():
                    return
                improved |= self._exchange(market, i, stop)

    def _announce(self, market: Market, j: int, stop: StopCriterion) -> bool:
        """Announce an area; say whether somebody was awarded it, so that it is worth asking again."""
        network, manager = self._network, int(self._manager[j])
        heard = network.neighbours(manager)
        heard = heard[network.arriving(heard.shape)]
        network.sent += len(network.neighbours(manager))
        self.rounds += 1
        asked = np.array([manager, *heard])
        gains, ways = np.empty(len(asked)), np.empty((len(asked), 2), np.int64)
        for first in range(0, len(asked), self._slice):
            if stop():
                return False
            bids(market, j, asked, gains, ways, first, min(first + self._slice, len(asked)))
        answered = network.arriving(heard.shape)
        network.sent += int((gains[1:] > 0.0).sum())
        gains[1:][~answered] = 0.0
        top = int(np.argmax(gains))
        winner = int(asked[top]) if gains[top] > 0.0 else -1
        if winner < 0:
            return False
        if winner != manager:
            network.sent += 1
            if not network.arriving((1,))[0]:
                # The award is lost, so nobody flies there; the manager announces again.
                return True
        self._contracts += 1
        take(market, winner, j, int(ways[top, 0]), int(ways[top, 1]), self._contracts)
        settle(market, winner)
        return True

    def _exchange(self, market: Market, i: int, stop: StopCriterion) -> bool:
        """Let UAV `i` offer each of its contracts to those that hear it; say whether one changed hands."""
        network, improved = self._network, False
        numbers = np.unique(market.contract[i, : market.length[i]])
        for number in numbers[numbers > 0]:
            heard = network.neighbours(i)
            network.sent += len(heard)
            asked = heard[network.arriving(heard.shape)]
            for first in range(0, len(asked), self._slice):
                if stop():
                    return improved
                some = asked[first : first + self._slice]
                self._contracts += 2
                found = exchange_with(market, i, int(number), some, self._contracts)
                network.sent += found + 1 if found < len(some) else len(some)
                if found < len(some):
                    # The contract is handed over.
                    network.sent += 1
                    improved = True
                    break
        return improved


@compiled
def bids(
    market: Market, j: int, asked: Integers, gains: Floats, ways: Integers, first: int, last: int
) -> None:
    """Ask some UAVs, (A,), what area `j` is worth to them: (A,) gains, 0 where nothing, and (A, 2) how."""
    for a in range(first, last):
        i = asked[a]
        gains[a] = 0.0
        if is_open(market, i, j):
            gain, place, base = bid(market, i, j)
            if gain > _LEAST_GAIN * abs(market.worth[i]):
                gains[a], ways[a, 0], ways[a, 1] = gain, place, base


@compiled
def exchange_with(market: Market, i: int, number: int, others: Integers, new: int) -> int:
    """Offer a contract to one UAV after the other; return which place among them takes it, or how many."""
    for place in range(others.shape[0]):
        if exchange(market, i, number, others[place], new):
            return place
    return int(others.shape[0])


@inlined
def exchange(market: Market, i: int, number: int, other: int, new: int) -> bool:
    """Hand a contract of UAV `i` on to another, or swap it for one of the other's, if both gain together.

    Parameters
    ----------
    market
        The market.
    i, number
        Who offers, and which contract.
    other
        Who takes it.
    new
        Number of the contract there; the number before it is free too.

    Returns
    -------
    bool
        Whether it changed hands. If not, both routes are as they were.
    """
    changed = try_exchange(market, i, number, other, 0, new)
    previous = 0
    for place in range(market.length[other]):
        offered = market.contract[other, place]
        # A reload and the stop after it are one contract.
        if not changed and offered not in (0, previous):
            changed = try_exchange(market, i, number, other, offered, new)
        previous = offered
    return changed


@compiled
def try_exchange(market: Market, i: int, number: int, other: int, offered: int, new: int) -> bool:
    """Do one such exchange; `offered` is the other's contract, or 0 where it gives none."""
    j = area_of(market, i, number)
    back = area_of(market, other, offered) if offered > 0 else -1
    if j < 0 or (offered > 0 and back < 0):
        return False
    before = market.worth[i] + market.worth[other]
    put_aside(market, i, 0)
    put_aside(market, other, 1)
    drop(market, i, number, number)
    settle(market, i)
    if offered > 0:
        drop(market, other, offered, offered)
        settle(market, other)
    gain, place, base = bid(market, other, j)
    if gain > 0.0:
        take(market, other, j, place, base, new)
        settle(market, other)
        if offered > 0:
            gain, place, base = bid(market, i, back)
            if gain > 0.0:
                take(market, i, back, place, base, new - 1)
                settle(market, i)
        if market.worth[i] + market.worth[other] > before + _LEAST_GAIN * abs(before):
            return True
    # What one of them has since may be what the other one had.
    give_back(market, i)
    give_back(market, other)
    put_back(market, i, 0)
    put_back(market, other, 1)
    return False


@compiled
def area_of(market: Market, i: int, number: int) -> int:
    """Return the area of a contract of UAV `i`; -1 where it has none of that number."""
    for place in range(market.length[i]):
        if market.contract[i, place] == number and market.path[i, place] < market.arrays.need.shape[1]:
            return int(market.path[i, place])
    return -1
