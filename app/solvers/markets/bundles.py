"""The consensus-based bundle algorithm: Choi, Brunet and How 2009, Algorithms 2 and 3, and Table I.

Every UAV builds a bundle, its most wanted areas one after the other, and tells those in reach what it bids,
and which UAV it takes for the winner of which area. One that is outbid gives that area back, and what it put
into its bundle after it. Bids are warped so that they never rise within a bundle, whatever routes are worth
(Johnson, Choi, Ponda and How 2012). A UAV that believes something else than before builds its bundle from its
beginning, so that a bundle is always the one for what is believed now: where a bid falls, an earlier choice
may be possible again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import Flags, Floats, Integers
from app.simulation.decorators import compiled, inlined
from app.solvers.markets.network import Network
from app.solvers.markets.routes import Market, bid, drop, is_open, settle, take
from app.solvers.protocol import StopCriterion

NOBODY = -1

_QUIET_IF_LOST = 5
"""How many times as many rounds nothing must change where messages may be lost."""

_SLICE_BIDS, _SLICE_BELIEFS = 20_000, 1_000_000
"""Places of routes that are tried, and beliefs compared, between two looks at the stop criterion."""

_FIRST = 1
"""Contracts of the bundle are numbered from it; 0 are those that stay."""


class Beliefs(NamedTuple):
    """What each UAV believes.

    Attributes
    ----------
    winner, highest
        (M, N) whom it takes for the winner of each area, and that one's bid.
    heard
        (M, M) the round from which it has the latest word of each UAV.
    """

    winner: Integers
    highest: Floats
    heard: Integers


class Bidders(NamedTuple):
    """What each UAV keeps to itself.

    Attributes
    ----------
    bundle, size
        (M, S) and (M,): areas in the order in which it chose them, contracts ``_FIRST`` and so on; how many.
    claimed
        (M, N) what it bid for the areas of its bundle when it last built one; 0 for others.
    gain, place, base
        (M, S, N) what an area adds to the route of so many areas of the bundle, and how it is flown to.
    known
        (M,) for how many areas of the bundle, from none on, these are known.
    stale
        (M,) whether it believes something else than when it last built its bundle.
    """

    bundle: Integers
    size: Integers
    claimed: Floats
    gain: Floats
    place: Integers
    base: Integers
    known: Integers
    stale: Flags


def new_beliefs(m: int, n: int) -> Beliefs:
    """Return what is believed before anybody has spoken."""
    return Beliefs(np.full((m, n), NOBODY, np.int64), np.zeros((m, n)), np.full((m, m), -1, np.int64))


def new_bidders(m: int, n: int, steps: int) -> Bidders:
    """Return UAVs with empty bundles."""
    return Bidders(
        np.zeros((m, steps), np.int64),
        np.zeros(m, np.int64),
        np.zeros((m, n)),
        np.zeros((m, steps, n)),
        np.zeros((m, steps, n), np.int64),
        np.zeros((m, steps, n), np.int64),
        np.zeros(m, np.int64),
        np.ones(m, np.bool_),
    )


class Bundles:
    """One market by bundles.

    Parameters
    ----------
    most_rounds
        Rounds of messages after which every UAV flies what it believes to have won.
    network
        Carries the messages, and counts them.

    Attributes
    ----------
    conflicts
        Stops that two UAVs believed to have won, and that the later one left out.
    rounds
        Rounds of messages so far.
    """

    def __init__(self, most_rounds: int, network: Network) -> None:
        self._most_rounds, self._network = most_rounds, network
        self.conflicts, self.rounds = 0, 0

    def agree(self, market: Market, order: Integers, stop: StopCriterion) -> None:  # noqa: ARG002 - bundles need none
        """Auction what is open; then what is left of it, as a new auction, until nobody bids."""
        while not stop() and self._auction(market, stop):
            pass

    def _auction(self, market: Market, stop: StopCriterion) -> bool:
        """Hold one auction, in which an area has one winner; say whether anything was won."""
        m, steps = market.path.shape
        bidders = new_bidders(m, len(market.left), steps)
        market.contract[:] = 0
        self._consent(market, new_beliefs(m, len(market.left)), bidders, stop)
        for i in range(m):
            self.conflicts += settle(market, i)
        market.contract[:] = 0
        return bool(bidders.size.any())

    def _consent(self, market: Market, beliefs: Beliefs, bidders: Bidders, stop: StopCriterion) -> None:
        """Build bundles and exchange beliefs until nothing changes."""
        network = self._network
        m, n = beliefs.winner.shape
        links = np.argwhere(network.hears)
        # As many bundles and messages are looked at between two questions as take a few milliseconds.
        bundles = max(1, _SLICE_BIDS // (n * bidders.bundle.shape[1] ** 2))
        messages = max(1, _SLICE_BELIEFS // n)
        on_the_way: list[tuple[Integers, Beliefs]] = []
        needed = (network.delay + 1) * (_QUIET_IF_LOST if network.loss else 1)
        quiet = 0
        for now in range(self._most_rounds):
            changed = False
            for first in range(0, m, bundles):
                if stop():
                    return
                changed |= build_all(market, beliefs, bidders, first, min(m, first + bundles), now)
            if not len(links):
                return
            said = Beliefs(beliefs.winner.copy(), beliefs.highest.copy(), beliefs.heard.copy())
            on_the_way.append((links[network.arriving((len(links),))], said))
            network.sent += len(links)
            self.rounds += 1
            if len(on_the_way) > network.delay:
                arrived, said = on_the_way.pop(0)
                when = now - network.delay
                for first in range(0, len(arrived), messages):
                    if stop():
                        return
                    some = np.ascontiguousarray(arrived[first : first + messages])
                    changed |= hear_all(beliefs, said, some, when, bidders.stale)
            quiet = 0 if changed else quiet + 1
            if quiet >= needed:
                return


@compiled
def build_all(market: Market, beliefs: Beliefs, bidders: Bidders, first: int, last: int, now: int) -> bool:
    """Let some UAVs build their bundles in round `now`; say whether one claims something else than before."""
    changed = False
    for i in range(first, last):
        if bidders.stale[i]:
            changed |= build(market, beliefs, bidders, i)
        beliefs.heard[i, i] = now
    return changed


@compiled
def hear_all(beliefs: Beliefs, said: Beliefs, links: Integers, when: int, stale: Flags) -> bool:
    """Deliver messages of round `when` over links, (L, 2): receiver, sender; say whether one has news."""
    changed = False
    for link in range(links.shape[0]):
        if hear(beliefs, said, links[link, 0], links[link, 1], when):
            changed = stale[links[link, 0]] = True
    return changed


@inlined
def build(market: Market, beliefs: Beliefs, bidders: Bidders, i: int) -> bool:
    """Build the bundle of UAV `i` (Algorithm 3); say whether it claims something else than before."""
    for j in range(beliefs.winner.shape[1]):
        if beliefs.winner[i, j] == i:
            beliefs.winner[i, j], beliefs.highest[i, j] = NOBODY, 0.0
    bidders.stale[i] = False
    most, size = np.inf, 0
    while size < bidders.bundle.shape[1]:
        if size == bidders.known[i]:
            value(market, bidders, i, size)
        chosen = most_wanted(beliefs, bidders, i, size, most)
        if chosen == NOBODY:
            break
        if size >= bidders.size[i] or bidders.bundle[i, size] != chosen:
            shorten(market, bidders, i, size)
            place, base = bidders.place[i, size, chosen], bidders.base[i, size, chosen]
            take(market, i, chosen, place, base, _FIRST + size)
            bidders.bundle[i, size] = chosen
            bidders.size[i] = size + 1
        most = min(most, bidders.gain[i, size, chosen])
        beliefs.winner[i, chosen], beliefs.highest[i, chosen] = i, most
        size += 1
    shorten(market, bidders, i, size)
    changed = False
    for j in range(beliefs.winner.shape[1]):
        claim = beliefs.highest[i, j] if beliefs.winner[i, j] == i else 0.0
        changed |= claim != bidders.claimed[i, j]
        bidders.claimed[i, j] = claim
    return changed


@inlined
def value(market: Market, bidders: Bidders, i: int, size: int) -> None:
    """Work out what every area adds to the route of UAV `i` with the first areas of its bundle."""
    shorten(market, bidders, i, size)
    for j in range(market.left.shape[0]):
        bidders.gain[i, size, j] = 0.0
        if is_open(market, i, j):
            gain, place, base = bid(market, i, j)
            bidders.gain[i, size, j], bidders.place[i, size, j], bidders.base[i, size, j] = gain, place, base
    bidders.known[i] = size + 1


@compiled
def shorten(market: Market, bidders: Bidders, i: int, size: int) -> None:
    """Give back what is in the bundle of UAV `i` beyond the first areas."""
    if size < bidders.size[i]:
        drop(market, i, _FIRST + size, _FIRST + bidders.size[i])
        bidders.size[i] = size
        bidders.known[i] = min(bidders.known[i], size + 1)


@compiled
def most_wanted(beliefs: Beliefs, bidders: Bidders, i: int, size: int, most: float) -> int:
    """Return the area that adds most, of those that UAV `i` outbids others for; NOBODY where none does."""
    best, chosen = 0.0, NOBODY
    for j in range(beliefs.winner.shape[1]):
        gain = bidders.gain[i, size, j]
        # Bids are those of the route so far, and never above the one before.
        if not gain > best or beliefs.winner[i, j] == i:
            continue
        if beats(min(gain, most), i, beliefs.highest[i, j], beliefs.winner[i, j]):
            best, chosen = gain, j
    return chosen


@compiled
def beats(bid_: float, i: int, other_bid: float, other: int) -> bool:
    """Whether a bid of UAV `i` is above another one's; of equal bids that of the first UAV is."""
    return bid_ > other_bid or (bid_ == other_bid and other != NOBODY and i < other)


@compiled
def hear(beliefs: Beliefs, said: Beliefs, i: int, k: int, when: int) -> bool:
    """Let UAV `i` hear what UAV `k` said in round `when`; say whether it believes something else now.

    The cases are those of Table I, by whom the sender and the receiver take for the winner.
    """
    changed = False
    for j in range(beliefs.winner.shape[1]):
        theirs, mine = said.winner[k, j], beliefs.winner[i, j]
        update, reset = False, False
        higher = beats(said.highest[k, j], theirs, beliefs.highest[i, j], mine) if theirs != NOBODY else False
        if theirs == k:
            if mine == i:
                update = higher
            elif mine in (k, NOBODY):
                update = True
            else:
                update = higher or newer(beliefs, said, i, k, mine)
        elif theirs == i:
            if mine == k:
                reset = True
            elif mine not in (i, NOBODY):
                reset = newer(beliefs, said, i, k, mine)
        elif theirs == NOBODY:
            if mine == k:
                update = True
            elif mine not in (i, NOBODY):
                update = newer(beliefs, said, i, k, mine)
        else:
            fresh = newer(beliefs, said, i, k, theirs)
            if mine == i:
                update = fresh and higher
            elif mine == k:
                update, reset = fresh, not fresh
            elif mine in (theirs, NOBODY):
                update = fresh
            else:
                fresh_mine = newer(beliefs, said, i, k, mine)
                update = fresh and (fresh_mine or higher)
                reset = not update and fresh_mine and not fresh
        if update and (mine != theirs or beliefs.highest[i, j] != said.highest[k, j]):
            changed = True
            beliefs.winner[i, j], beliefs.highest[i, j] = theirs, said.highest[k, j]
        elif reset:
            changed = True
            beliefs.winner[i, j], beliefs.highest[i, j] = NOBODY, 0.0
    for other in range(beliefs.heard.shape[1]):
        if other != i:
            beliefs.heard[i, other] = max(beliefs.heard[i, other], said.heard[k, other])
    beliefs.heard[i, k] = max(beliefs.heard[i, k], when)
    return changed


@compiled
def newer(beliefs: Beliefs, said: Beliefs, i: int, k: int, of: int) -> bool:
    """Whether UAV `k` had later word of another one than UAV `i` has."""
    return bool(said.heard[k, of] > beliefs.heard[i, of])
