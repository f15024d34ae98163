"""One day of the colony: UAVs respond to areas by thresholds, and compete in a circle for those they share.

Every turn each UAV responds to the area whose stimulus calls it, with a probability that its threshold for
the area sets (Bonabeau, Theraulaz and Deneubourg 1996). Of the UAVs that respond to one area the most
stimulated flies there; the others respond anew to what is left then, round after round, until nobody
competes (the circular competition of Yang et al., the paper's [6]).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled, merged
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, earned_now, leg_home, leg_to, new_episodes, reset_one, verdict
from app.simulation.visit import ALLOWED, loaded_of, way_home
from app.simulation.worth import cost_of, worths
from app.solvers.genetic import Flight, decode

_NOBODY = -1


class Colony(NamedTuple):
    """What a day takes.

    Attributes
    ----------
    arrays
        A stack of one problem.
    episodes
        One episode, in which the day is lived.
    flight
        Where the plan of the day is flown again, turn by turn of the specification.
    unit
        (1,) what a unit of material earns in the mean: by it a reload is judged.
    stimulus, response
        (N + D,) of each stop for the UAV that is asked, and with which probability it responds to that.
    answer
        (M,) the stop that each UAV responds to in this round; N where to none.
    strength
        (M,) the stimulus that it responds to.
    waiting
        (M,) UAVs that are still in the competition of this turn.
    stops
        (M,) stops of each UAV's list.
    lists
        (S, M) what each UAV has won, in order; N ends it.
    """

    arrays: ProblemArrays
    episodes: Episodes
    flight: Flight
    unit: Floats
    stimulus: Floats
    response: Floats
    answer: Integers
    strength: Floats
    waiting: Integers
    stops: Integers
    lists: Integers


def new_colony(arrays: ProblemArrays) -> Colony:
    """Prepare days of a stack of one problem."""
    m, n, _ = arrays.shape
    shape = (int(arrays.max_steps[0]), m)
    flight = Flight(arrays, new_episodes(arrays, 1), np.empty(m, np.int64), np.empty(shape, np.int64))
    worth = worths(arrays)[arrays.need[0].sum(axis=1) > 0]
    return Colony(
        arrays,
        new_episodes(arrays, 1),
        flight,
        np.array([worth.mean() if len(worth) else 0.0]),
        np.empty(n + arrays.n_bases),
        np.empty(n + arrays.n_bases),
        np.empty(m, np.int64),
        np.empty(m),
        np.empty(m, np.int64),
        np.empty(m, np.int64),
        np.empty(shape, np.int64),
    )


@njit(cache=True, error_model="numpy")
def live(
    colony: Colony, resistance: Floats, steepness: float, rng: np.random.Generator, first: int, last: int
) -> float:
    """Live some turns of a day; after the last one leave its plan in ``colony.flight.actions``.

    Parameters
    ----------
    colony
        Scratch space.
    resistance
        (M, N + D) the threshold of each UAV for each area and base, above 0, to the power of the steepness.
    steepness
        Exponent of the response.
    rng
        The only source of randomness.
    first, last
        The first turn, and the one after the last.

    Returns
    -------
    float
        What the plan earns; 0 before the day is over.
    """
    arrays, episodes, home = colony.arrays, colony.episodes, colony.arrays.need.shape[1]
    steps, m = colony.lists.shape
    if first == 0:
        reset_one(arrays, episodes, 0)
        colony.lists[:] = home
        colony.stops[:] = 0
    for _ in range(first, last):
        colony.waiting[:] = 1
        responses = 1
        while responses > 0:
            responses = 0
            for i in range(m):
                colony.answer[i] = home
                if colony.waiting[i] == 1:
                    respond(colony, resistance, steepness, rng.random(), rng.random(), i)
                    # Who responds to nothing waits for the next turn.
                    colony.waiting[i] = int(colony.answer[i] != home)
                    responses += colony.waiting[i]
            award(colony)
    return float(decode(colony.flight, colony.lists)) if last == steps else 0.0


@compiled
def respond(
    colony: Colony, resistance: Floats, steepness: float, which: float, whether: float, i: int
) -> None:
    """Write which stop UAV `i` responds to, and how strongly; both draws are from 0 to 1."""
    most = feel(colony, i)
    if most <= 0.0:
        return
    total, ignored = 0.0, 1.0
    for c in range(colony.stimulus.shape[0]):
        colony.response[c] = 0.0
        if colony.stimulus[c] > 0.0:
            pull = (colony.stimulus[c] / most) ** steepness
            colony.response[c] = pull / (pull + resistance[i, c])
            total += colony.response[c]
            ignored *= 1.0 - colony.response[c]
    # It responds to something with the probability that it does not ignore all of them.
    if whether < ignored and colony.stops[i] > 0:
        return
    left, chosen = which * total, _NOBODY
    for c in range(colony.stimulus.shape[0]):
        if colony.response[c] > 0.0:
            chosen = c
            left -= colony.response[c]
            if left < 0.0:
                break
    if chosen != _NOBODY:
        colony.answer[i] = chosen if chosen < colony.arrays.need.shape[1] else chosen + 1
        colony.strength[i] = colony.stimulus[chosen]


@merged
def feel(colony: Colony, i: int) -> float:
    """Write the stimulus of every stop for UAV `i`, 0 or more, and return the largest."""
    arrays, home = colony.arrays, colony.arrays.need.shape[1]
    most = 0.0
    for c in range(colony.stimulus.shape[0]):
        j = c if c < home else c + 1
        colony.stimulus[c] = max(0.0, worth_of(arrays, colony.episodes, colony.unit[0], i, j))
        most = max(most, colony.stimulus[c])
    return most


@merged
def worth_of(arrays: ProblemArrays, episodes: Episodes, unit: float, i: int, j: int) -> float:
    """Return what stop `j` is worth to UAV `i` now: what it earns less what it costs; 0 where not allowed."""
    if episodes.ret[0, i] or verdict(arrays, episodes, 0, i, j) != ALLOWED:
        return 0.0
    way = leg_to(arrays, episodes, 0, i, j)
    home = arrays.need.shape[1]
    amount = 0.0
    if j > home:
        for k in range(episodes.load.shape[2]):
            amount += loaded_of(
                episodes.load[0, i, k], arrays.full[0, i, k], episodes.stock[0, j - home - 1, k]
            )
        return unit * amount - cost_of(arrays, 0, way)
    if arrays.terms[0].charge_return:
        way += way_home(arrays, 0, i, j) - leg_home(arrays, episodes, 0, i)
    for k in range(episodes.load.shape[2]):
        amount += min(episodes.load[0, i, k], episodes.need[0, j, k])
    return earned_now(arrays, episodes, 0, i, j, amount) - cost_of(arrays, 0, way)


@compiled
def award(colony: Colony) -> None:
    """Let of those that respond to one stop the most stimulated fly there; the others stay in the circle."""
    arrays, home = colony.arrays, colony.arrays.need.shape[1]
    m = colony.answer.shape[0]
    for i in range(m):
        j = colony.answer[i]
        if j == home:
            continue
        winner = i
        for other in range(i + 1, m):
            if colony.answer[other] == j and colony.strength[other] > colony.strength[winner]:
                winner = other
        for other in range(i, m):
            if colony.answer[other] == j:
                colony.answer[other] = home
        act(arrays, colony.episodes, 0, winner, j)
        colony.lists[colony.stops[winner], winner] = j
        colony.stops[winner] += 1
        colony.waiting[winner] = 0
