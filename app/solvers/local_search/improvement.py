"""Rounds of annealing in pieces: as many moves as were asked for, or as time allows, on any number of cores.

Under a time limit that is long enough for several rounds, half of it goes to rounds that begin hot, and the
rest to short ones that begin warm, from plans between the best that there were.

Where the stop criterion says how long it leaves, the temperature falls with the time, so that a search is
cold when its time is up, however fast the machine is. Without a time limit it falls with the moves alone, and
the same generators give the same plans.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np

from app.simulation.legs import UNREACHABLE
from app.solvers.local_search.annealing import (
    ROUNDING,
    Prices,
    Search,
    actions_of,
    anneal,
    drop_idle_reloads,
    drop_useless,
    set_routes,
)
from app.solvers.local_search.combination import Combination
from app.solvers.local_search.effort import large_moves, moves_a_second, rounds_for
from app.solvers.local_search.relinking import LEAST_UAVS, Elite
from app.solvers.local_search.sharing import Team, moves_at_once, pays
from app.solvers.local_search.temperatures import coldest_by_distance, gains, neighbour_leg
from app.solvers.protocol import StopCriterion

_PIECE_S = 0.002
"""Seconds between two looks at the stop criterion, about."""

_TOLD = 32
"""Times that progress is told, beside the ends of the rounds."""

_COLLECTED_FROM = 0.3
"""Share of a round after which routes are good enough to be collected."""

_FREE = 0.002
"""Cost of a leg between neighbours, in common gains, below which distance is as good as free."""

_FREE_HOT, _FREE_COLD = 0.3, 0.01
"""Temperatures there: rewards of plans lie further apart."""


_PATIENT_MOVES_A_STOP = 2_000
"""With fewer moves for each stop of the plan that it begins from, a round begins colder."""

_PARENTS = 6
"""Rounds, at least, whose plans are relinked; there has to be time for so many that begin as hot as any."""

_HOT_SHARE = 0.5
"""Share of the time that goes to them."""

_WARM = 0.45
"""Heat with which a round begins from a plan between two: 0 is cold, 1 hot."""

_WARM_SHARE = 0.02
"""Share of the time, and of the moves, that such a round takes."""


class Cooling(NamedTuple):
    """Temperatures of a round and the price of a useless visit, in what visits earn.

    The hottest is in largest gains, the rest in common ones; see
    :func:`~app.solvers.local_search.temperatures.gains`.

    Attributes
    ----------
    hot, cold
        The temperature falls geometrically from one to the other: from where the largest gains are decided
        on to where the common ones are, or what distances cost if that is less.
    penalty
        What a visit that unloads nothing costs during the search.
    guide
        What a leg between neighbours costs during the search where distance is as good as free; its time
        where there are deadlines, otherwise its distance.
    far
        What the way from the UAVs to the targets costs at most by that.
    """

    hot: float = 0.1
    cold: float = 0.005
    penalty: float = 0.03
    guide: float = 0.003
    far: float = 0.05


class _Span(NamedTuple):
    """What a round may take: moves, and the seconds on :func:`time.monotonic` from when to when."""

    moves: int
    begin: float
    end: float

    def share(self, done: int) -> float:
        """Return how much of it is over, by moves or by time, whichever is further."""
        by_moves = done / self.moves
        if self.end == np.inf:
            return by_moves
        return max(by_moves, (time.monotonic() - self.begin) / max(self.end - self.begin, 1e-9))


Watch = Callable[[float, int], None]
"""Takes the share of the work done and the number of rounds ended."""


def improve(
    search: Search,
    rng: np.random.Generator,
    moves: int,
    rounds: int,
    cooling: Cooling,
    stop: StopCriterion,
    watch: Watch,
) -> None:
    """Anneal on one core; see :func:`improve_together`."""
    improve_together([search], [rng], [stop], moves, rounds, cooling, watch)


def improve_together(
    searches: Sequence[Search],
    generators: Sequence[np.random.Generator],
    stops: Sequence[StopCriterion],
    moves: int,
    rounds: int,
    cooling: Cooling,
    watch: Watch,
) -> None:
    """Anneal from the searches' current plans, a thread each.

    Where a plan has UAVs enough, the threads share it out among them; otherwise each has its own, and after a
    round all go on from the best one.

    Parameters
    ----------
    searches
        Of one problem, at least one. Changed: the incumbent of the first is the best plan of all searches, of
        all rounds and of before.
    generators
        The only source of randomness, one a search.
    stops
        One a search, asked every few milliseconds. When the first one's says so, all is over; another's ends
        its search until the next round. Unless the first has a time limit, it does not change what the moves
        before it were.
    moves, rounds
        How many moves each search tries, over all rounds, at least 1. Where less time is left than they
        would take, there are fewer rounds in proportion. Where their routes are combined, which takes some of
        the time, their number changes with what the first one finds.
    cooling
        Temperatures.
    watch
        Told now and then, and after each round.
    """
    stop = stops[0]
    begin, left = time.monotonic(), stop.seconds_left()
    possible = float(moves)
    if left < math.inf:
        possible = min(possible, left * moves_a_second(searches[0].arrays, searches[0].routes.length))
        rounds = rounds_for(rounds, possible / max(moves, 1))
    combination = Combination(searches, rounds, left)
    searches = combination.searches
    first = searches[0]
    idle = not (len(first.near.active) and len(first.near.wanted))
    number, tried = 0, 0
    with ThreadPoolExecutor(max(1, len(searches) - 1)) as threads:
        if not combination.on and pays(first, len(searches), possible / rounds):
            team = Team(searches, generators, stops, threads)
            crews = [_Crew(team.anneal, first, stop, len(searches))]
        else:
            crews = [
                _Crew(partial(_alone, search, rng), search, ends)
                for search, rng, ends in zip(searches, generators, stops, strict=True)
            ]
        alone = left < math.inf and not idle and not combination.on and crews[0].threads == 1
        enough = _heat(_HOT_SHARE / _PARENTS * possible, int(first.routes.length.sum())) == 1.0
        relinks = alone and enough and len(first.near.active) >= LEAST_UAVS
        hot, elite = 1.0, Elite()
        if relinks:
            hot, rounds = _HOT_SHARE, max(_PARENTS, round(_HOT_SHARE * rounds))
        while number < rounds and not combination.proven and not stop():
            now, end = time.monotonic(), np.inf
            count = round(hot * moves) * (number + 1) // rounds - tried
            if count > 0 and not idle:
                if left < math.inf:
                    end = now + (begin + hot * left - combination.seconds - now) / (rounds - number)

                def tell(share: float, number: int = number, rounds: int = rounds) -> None:
                    watch(hot * (number + share) / rounds, number)

                _together(threads, crews, _Span(count, now, end), cooling, [1.0] * len(crews), tell)
                tried += count
                if not stop():
                    rounds = combination.after_round(number + 1, rounds, stop)
                _share_best(crews, elite if relinks else None)
            number += 1
            watch(1.0 if combination.proven else hot * number / rounds, number)
        if relinks:
            whole = _Span(moves, begin, begin + left)
            _relinked_rounds(threads, crews, generators, elite, cooling, whole, tried, number, watch)
    drop_idle_reloads(first)


def _relinked_rounds(
    threads: ThreadPoolExecutor, crews: Sequence[_Crew], generators: Sequence[np.random.Generator],
    elite: Elite, cooling: Cooling, whole: _Span, tried: int, ended: int, watch: Watch,
) -> None:  # fmt: skip
    """Make short rounds from plans between the best, for what is left of the moves and of the time."""
    most, longest = max(1, round(_WARM_SHARE * whole.moves)), _WARM_SHARE * (whole.end - whole.begin)
    while tried < whole.moves and not crews[0].stop():
        now = time.monotonic()
        seconds = whole.end - now
        # What is left at the end is not worth a round of its own.
        if seconds > 1.5 * longest:
            seconds = longest
        span = _Span(min(whole.moves - tried, most), now, now + seconds)
        heats = []
        for crew, rng in zip(crews, generators, strict=True):
            useless = cooling.penalty * gains(crew.search.arrays, crew.search.routes)[1]
            heats.append(_WARM if elite.relink(crew.search, rng, useless, crews[0].stop) else 1.0)
        _together(threads, crews, span, cooling, heats, _silent)
        tried += span.moves
        ended += 1
        _share_best(crews, elite)
        watch(min(1.0, whole.share(tried)), ended)


class _Crew(NamedTuple):
    """Who makes the moves of a round.

    Attributes
    ----------
    anneal
        Takes the moves of each thread, after how many of them to ask whether to stop, the temperatures,
        prices, whether routes are collected, and the probability of a large move.
    search
        Whose plan it is.
    stop
        Ends the round.
    threads
        How many share the plan.
    """

    anneal: Callable[[int, int, float, float, Prices, bool, float], None]
    search: Search
    stop: StopCriterion
    threads: int = 1


def _alone(
    search: Search, rng: np.random.Generator, moves: int, _at_once: int, hot: float, cold: float,
    prices: Prices, collecting: bool, large: float,
) -> None:  # fmt: skip
    anneal(search, rng, moves, hot, cold, prices, collecting, large)


def _together(
    threads: ThreadPoolExecutor, crews: Sequence[_Crew], span: _Span, cooling: Cooling,
    heats: Sequence[float], tell: Callable[[float], None],
) -> None:  # fmt: skip
    """One round of each plan; the first one's tells how far it is."""
    others = [
        threads.submit(_round, crew, span, cooling, heat, _silent)
        for crew, heat in zip(crews[1:], heats[1:], strict=True)
    ]
    _round(crews[0], span, cooling, heats[0], tell)
    for other in others:
        other.result()


def _round(crew: _Crew, span: _Span, cooling: Cooling, heat: float, tell: Callable[[float], None]) -> None:
    """One round of one plan, which is legal at its end; with heat 0 it begins cold, with 1 hot."""
    search = crew.search
    largest, scale = gains(search.arrays, search.routes)
    leg = neighbour_leg(search.arrays, search.near)
    coldest = coldest_by_distance(search.arrays, leg, cooling.cold * scale)
    haste, thrift = 0.0, 0.0
    if float(search.arrays.terms["weight"][0]) * leg < _FREE * scale:
        cooling = cooling._replace(hot=_FREE_HOT, cold=_FREE_COLD)
        haste, thrift = _guides(search, cooling.guide * scale, cooling.far * scale, leg)
        coldest = cooling.cold * scale
    prices = Prices(cooling.penalty * scale, haste, thrift)
    a_second = moves_a_second(search.arrays, search.routes.length)
    at_once = max(100, round(_PIECE_S * a_second))
    done, share, told = 0, span.share(0), 0.0
    stops, expected = int(search.routes.length.sum()), float(span.moves)
    if span.end < np.inf:
        expected = min(expected, a_second * (span.end - span.begin))
    alone = crew.threads == 1
    piece = at_once if alone else moves_at_once(expected, a_second)
    step = piece / span.moves
    large, cost = large_moves(search.routes.length)
    while done < span.moves and share < 1.0 and not crew.stop():
        count = min(piece, span.moves - done)
        warmth = heat if span.end == np.inf else heat * _heat(crew.threads * expected, stops)
        begin = cooling.hot * (cooling.cold / cooling.hot) ** (1.0 - warmth)
        ratio = coldest / (begin * largest)
        hot, cold = (begin * ratio**part * largest for part in (share, min(share + step, 1.0)))
        collecting = share >= _COLLECTED_FROM and search.pool.size[0] < len(search.pool.uav)
        made, at_a_time = (max(1, round(each / cost)) for each in (count, at_once))
        crew.anneal(made, at_a_time, hot, cold, prices, collecting, large)
        done += count
        now = span.share(done)
        expected = done / max(now, 1e-9)
        piece = at_once if alone else moves_at_once(expected, a_second)
        # The next piece is expected to bring it as far as this one did.
        share, step = now, max(now - share, count / span.moves)
        if share - told >= 1.0 / _TOLD:
            told = share
            tell(min(share, 1.0))
    drop_useless(search)


def _heat(moves: float, stops: int) -> float:
    """Return how hot a round begins, from 0 to 1: colder where it has few moves for each stop.

    Heat that there is no time to undo only costs (``tests/benchmarks/LOG.md``).
    """
    return min(1.0, math.cbrt(moves / (_PATIENT_MOVES_A_STOP * max(stops, 1))))


def _share_best(crews: Sequence[_Crew], elite: Elite | None) -> None:
    """Note the plans of a round, and let all go on from the best incumbent; of equals the first one's."""
    searches = [crew.search for crew in crews]
    if elite is not None:
        for search in searches:
            elite.add(search)
    if len(searches) == 1:
        return
    most = max(float(search.best[0]) for search in searches)
    enough = most - ROUNDING * abs(most)
    best = next(search for search in searches if search.best[0] >= enough)
    actions = actions_of(best)
    for search in searches:
        if search is not best and search.best[0] < enough:
            set_routes(search, actions)


def _silent(_share: float) -> None:
    """Only the first search tells how far it is."""


def _guides(search: Search, cost: float, most: float, leg: float) -> tuple[float, float]:
    """Return what a unit of time and of distance costs during the search.

    Parameters
    ----------
    search
        The search.
    cost
        What a leg between neighbours is to cost.
    most
        What the way from the UAVs to the targets may cost at most, in the mean: where targets lie close
        together and far away, it is many times as long, and must not cost what a visit earns.
    leg
        Length of a leg between neighbours.
    """
    arrays, near = search.arrays, search.near
    if leg == 0.0:
        return 0.0, 0.0
    ways = arrays.start_target[0][np.ix_(near.active, near.wanted)]
    if (ways >= UNREACHABLE).any():
        ways = ways[ways < UNREACHABLE]
    far = float(ways.mean()) if ways.size else 0.0
    rate = min(cost / leg, most / far) if far > 0.0 else cost / leg
    if (
        np.isfinite(arrays.areas["deadline"][0][near.wanted]).any()
        or arrays.uavs["watched"][0, near.active].any()
    ):
        return rate * float(arrays.uavs["speed"][0][near.active].mean()), 0.0
    return 0.0, max(0.0, rate - float(arrays.terms["weight"][0]))
