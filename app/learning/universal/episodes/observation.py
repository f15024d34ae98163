"""What a UAV sees at its turn, whatever the size of the problem: one row a target, and one of its own.

Every number is a ratio: distances over the span, rewards over the largest level, times over the time it
takes a UAV of mean speed to cross the span, amounts over other amounts. So nothing depends on units, and
nothing depends on how UAVs, targets or materials are numbered, but for the order in which UAVs act.

What a UAV must know of the others to fill its rows: where they are, what they carry, how far they can still
fly, and that they have not returned. It is the same for all UAVs and can be broadcast once a turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.universal.network.architecture import RIVAL_FEATURES
from app.simulation.arrays import Flags, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.legs import UNREACHABLE
from app.simulation.simulator import earned_now, leg_home, leg_to, verdict
from app.simulation.visit import (
    ALLOWED,
    air_length,
    departure_after,
    flown_with_return,
    is_late,
    is_out_of_range,
    left_of,
    leg,
    leg_time,
    way_home,
)
from app.simulation.worth import cost_of, earned_by

FOLLOW_UPS = 16
"""Near targets considered for the visit after the next."""

LARGEST_LEVEL = 1e6
"""Bound of the level of a target that needs nothing, against those that do: keeps single precision finite."""

_FAR = 10.0
"""Spans that a leg is long at most; a leg that does not exist is that long."""

FORBIDDEN = -np.inf
"""Value of a visit that is not allowed."""


class VisitGains(NamedTuple):
    """What each episode's UAVs could earn at each target now; kept up to date turn by turn.

    Attributes
    ----------
    span, level, time
        (P,) scales of each problem: distances, rewards, times.
    near
        (P, N, L) the targets nearest to each target.
    net
        (B, M, N) reward of a visit now; FORBIDDEN where it is not allowed.
    unloaded
        (B, M, N) amounts it would unload, all materials together.
    acted
        (B, M) UAVs that have acted in this step; the roll-out keeps it.
    first, second
        (M,) scratch: the best and the second best of each UAV's visits.
    """

    span: Floats
    level: Floats
    time: Floats
    near: Integers
    net: Floats
    unloaded: Floats
    acted: Flags
    first: Floats
    second: Floats


def scales(arrays: ProblemArrays) -> tuple[Floats, Floats, Floats]:
    """Return what distances, rewards and times are divided by, (P,) each; never 0."""
    far = np.maximum(_longest(arrays.start_target), _longest(arrays.between))
    span = np.maximum(np.maximum(far, _longest(arrays.home)), arrays.uavs["start_home"].max(axis=1))
    span = np.where(span > 0, span, 1.0)
    level = np.where(arrays.areas["need_total"] > 0, arrays.areas["level"], 0.0).max(axis=1)
    flying = ~arrays.ret
    speed = np.where(flying, arrays.uavs["speed"], 0.0).sum(axis=1) / np.maximum(flying.sum(axis=1), 1)
    return span, np.where(level > 0, level, 1.0), span / np.where(speed > 0, speed, 1.0)


def _longest(legs: Floats) -> Floats:
    """Return the longest leg of each problem that there is, (P,)."""
    return legs.max(axis=tuple(range(1, legs.ndim)), where=legs < UNREACHABLE, initial=0.0)


def nearness(arrays: ProblemArrays, span: Floats) -> Float32s:
    """Return how far targets are apart, in spans, (P, N, N); of UAVs that fly other legs the nearest."""
    apart = arrays.between.min(axis=1) / span[:, None, None]
    return np.minimum(apart, _FAR).astype(np.float32)


def new_gains(arrays: ProblemArrays, batch: int) -> VisitGains:
    """Make the gains of `batch` episodes; :func:`look` fills it.

    Parameters
    ----------
    arrays
        A stack of P problems.
    batch
        B.
    """
    m, n, _ = arrays.shape
    span, level, time = scales(arrays)
    length = max(1, min(FOLLOW_UPS, n - 1))
    between = np.where(arrays.areas["need_total"][:, None, :] > 0, arrays.between.min(axis=1), np.inf)
    between[:, np.arange(n), np.arange(n)] = np.inf
    near = np.argsort(between, axis=2, kind="stable")[:, :, :length]
    return VisitGains(
        span=span,
        level=level,
        time=time,
        near=np.ascontiguousarray(near, dtype=np.int64),
        net=np.empty((batch, m, n)),
        unloaded=np.empty((batch, m, n)),
        acted=np.zeros((batch, m), np.bool_),
        first=np.empty(m),
        second=np.empty(m),
    )


@compiled
def look(arrays: ProblemArrays, episodes: Episodes, gains: VisitGains) -> None:
    """Work out everything of the gains for the present state of every episode."""
    for b in range(episodes.at.shape[0]):
        for i in range(episodes.at.shape[1]):
            for j in range(episodes.need.shape[1]):
                _value(arrays, episodes, gains, b, i, j)


@compiled
def look_again(
    arrays: ProblemArrays, episodes: Episodes, gains: VisitGains, b: int, i: int, action: int
) -> None:
    """Bring the gains up to date after UAV `i` of episode `b` took an action."""
    for j in range(episodes.need.shape[1]):
        _value(arrays, episodes, gains, b, i, j)
    if action < episodes.need.shape[1]:
        for other in range(episodes.at.shape[1]):
            _value(arrays, episodes, gains, b, other, action)


@compiled
def _value(arrays: ProblemArrays, episodes: Episodes, gains: VisitGains, b: int, i: int, j: int) -> None:
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
def squash(x: float) -> float:
    """Map any number into -1..1, nearly the same around 0."""
    return x / (1.0 + abs(x))


@compiled
def clip(x: float, low: float, high: float) -> float:
    """Bound a number."""
    return min(max(x, low), high)


@compiled
def observe(
    arrays: ProblemArrays,
    episodes: Episodes,
    gains: VisitGains,
    b: int,
    i: int,
    pair: Float32s,
    own: Float32s,
    rivals: Float32s,
) -> None:
    """Write what UAV `i` of episode `b` sees at its turn.

    Parameters
    ----------
    arrays, episodes, gains
        The gains is up to date.
    b, i
        Episode and UAV; it has not returned.
    pair
        (N, PAIR_FEATURES), overwritten; column 0 says whether the visit is allowed.
    own
        (OWN_FEATURES,), overwritten.
    rivals
        (N, M, RIVAL_FEATURES), overwritten: what each other UAV could do at each target; all 0 where it could
        do nothing.
    """
    p = episodes.problem[b]
    m, n = episodes.at.shape[1], episodes.need.shape[1]
    scale, span, time = gains.level[p], gains.span[p], gains.time[p]
    steps_left = arrays.max_steps[p] - episodes.step[b]
    load = 0.0
    for k in range(episodes.load.shape[2]):
        load += episodes.load[b, i, k]
    _best_two_of_each(episodes, gains, b)
    home_now = leg_home(arrays, episodes, b, i)

    allowed_visits, others_best = 0, 0.0
    for j in range(n):
        net = gains.net[b, i, j]
        allowed = net > FORBIDDEN
        allowed_visits += allowed
        d = leg_to(arrays, episodes, b, i, j)
        home_then = way_home(arrays, p, i, j)
        need = 0.0
        for k in range(episodes.need.shape[2]):
            need += episodes.need[b, j, k]
        unloaded = gains.unloaded[b, i, j]
        value = earned_now(arrays, episodes, b, i, j, unloaded) if unloaded > 0.0 else 0.0
        cost = cost_of(arrays, p, d)
        travel = leg_time(arrays, p, i, episodes.at[b, i], j, d)
        air = air_length(arrays, p, i, d, travel)
        reach = flown_with_return(arrays, p, i, j, episodes.flown[b, i] + air)
        deadline = arrays.areas[p, j].deadline

        best, second, rival, able, supply = FORBIDDEN, FORBIDDEN, -1, 0, 0.0
        for other in range(m):
            other_net = gains.net[b, other, j]
            seen = rivals[j, other]
            if other == i or other_net <= FORBIDDEN or (gains.acted[b, other] and steps_left <= 1):
                for f in range(RIVAL_FEATURES):
                    seen[f] = 0.0
                continue
            able += 1
            its_elsewhere = gains.second[other] if gains.first[other] <= other_net else gains.first[other]
            seen[0] = 1.0
            seen[1] = squash(other_net / scale)
            seen[2] = squash((other_net - max(its_elsewhere, 0.0)) / scale)
            seen[3] = gains.unloaded[b, other, j] / need
            seen[4] = 0.0 if gains.acted[b, other] else 1.0
            seen[5] = min(leg_to(arrays, episodes, b, other, j) / span, _FAR)
            supply += gains.unloaded[b, other, j]
            if other_net > best:
                best, second, rival = other_net, best, other
            elif other_net > second:
                second = other_net
        regret = 0.0
        if rival >= 0:
            elsewhere = gains.second[rival] if gains.first[rival] <= best else gains.first[rival]
            regret = best - max(elsewhere, 0.0)
            others_best = max(others_best, best)
        mine_elsewhere = gains.second[i] if gains.first[i] <= net else gains.first[i]
        follow_up = _follow_up(arrays, episodes, gains, b, i, j) if allowed and steps_left > 1 else 0.0

        row = pair[j]
        row[0] = 1.0 if allowed else 0.0
        row[1] = min(d / span, _FAR)
        row[2] = squash(cost / scale)
        row[3] = value / scale
        row[4] = squash(net / scale) if allowed else -1.0
        row[5] = unloaded / need if need > 0.0 else 0.0
        row[6] = unloaded / load if load > 0.0 else 0.0
        row[7] = need / arrays.areas[p, j].need_total if arrays.areas[p, j].need_total > 0.0 else 0.0
        row[8] = min(arrays.areas[p, j].level / scale, LARGEST_LEVEL)
        row[9] = clip((arrays.uavs[p, i].voyage - reach) / span, -1.0, 3.0)
        row[10] = home_then / span
        row[11] = min((d + home_then - home_now) / span, _FAR)
        row[12] = 1.0 if deadline < np.inf else 0.0
        row[13] = (
            clip((deadline - episodes.clock[b, i] - travel) / time, -2.0, 4.0) if deadline < np.inf else 0.0
        )
        row[14] = clip(arrays.areas[p, j].service / time, 0.0, 4.0)
        row[15] = clip(travel / time, 0.0, 4.0)
        row[16] = squash(best / scale) if able > 0 else -1.0
        row[17] = squash(second / scale) if able > 1 else -1.0
        row[18] = squash((net - max(best, 0.0)) / scale) if allowed else -1.0
        row[19] = able / m
        row[20] = min(supply / need, 1.0) if need > 0.0 else 0.0
        row[21] = squash(follow_up / scale)
        row[22] = squash((net + follow_up) / scale) if allowed else -1.0
        row[23] = squash(regret / scale)
        row[24] = 1.0 if rival >= 0 and not gains.acted[b, rival] else 0.0
        row[25] = squash((net - max(mine_elsewhere, 0.0)) / scale) if allowed else -1.0
        row[26] = value / (value + cost) if value > 0.0 else 0.0
        row[27] = 1.0 if need > 0.0 and unloaded >= need * (1.0 - 1e-9) else 0.0
        row[28] = 1.0 if load > 0.0 and unloaded >= load * (1.0 - 1e-9) else 0.0
        row[29] = min(supply / max(need - unloaded, 1e-300), 1.0) if need - unloaded > 0.0 else 1.0

    _observe_self(arrays, episodes, gains, b, i, own)
    own[0] = allowed_visits / n
    own[1] = squash(gains.first[i] / scale) if allowed_visits > 0 else -1.0
    own[2] = squash(others_best / scale)


@compiled
def _observe_self(
    arrays: ProblemArrays, episodes: Episodes, gains: VisitGains, b: int, i: int, own: Float32s
) -> None:
    """Write what does not belong to one target; entries 0 to 2 are the caller's."""
    p = episodes.problem[b]
    m, n, materials = episodes.at.shape[1], episodes.need.shape[1], episodes.load.shape[2]
    scale, span, time = gains.level[p], gains.span[p], gains.time[p]
    steps = arrays.max_steps[p]
    steps_left = steps - episodes.step[b]
    load = start_load = most = swarm = 0.0
    out = place = 0
    for other in range(m):
        place += gains.acted[b, other]
        carried = 0.0
        for k in range(materials):
            carried += episodes.load[b, other, k]
        if other == i:
            load = carried
        if not episodes.ret[b, other]:
            out += 1
            swarm += carried
            most = max(most, carried)
    needed = covered = 0.0
    for k in range(materials):
        start_load += arrays.load[p, i, k]
        need_k = supply_k = 0.0
        for j in range(n):
            need_k += episodes.need[b, j, k]
        for other in range(m):
            if not episodes.ret[b, other]:
                supply_k += episodes.load[b, other, k]
        needed += need_k
        covered += min(need_k, supply_k)
    home_now = leg_home(arrays, episodes, b, i)
    left = arrays.uavs[p, i].voyage - episodes.flown[b, i]
    own[3] = load / most if most > 0.0 else 0.0
    own[4] = load / start_load if start_load > 0.0 else 0.0
    own[5] = clip(left / span, 0.0, 4.0)
    own[6] = home_now / span
    own[7] = squash(arrays.terms[p].weight * home_now / scale) if arrays.terms[p].charge_return else 0.0
    own[8] = 1.0 if arrays.terms[p].charge_return else 0.0
    own[9] = 1.0 if arrays.terms[p].return_to_base else 0.0
    own[10] = steps_left / steps
    own[11] = 1.0 / steps_left
    own[12] = 1.0 if steps_left == 1 else 0.0
    own[13] = clip(episodes.clock[b, i] / time, 0.0, 4.0)
    own[14] = clip(arrays.uavs[p, i].speed * time / span, 0.0, 4.0)
    own[15] = m / (m + n)
    own[16] = covered / needed if needed > 0.0 else 0.0
    own[17] = covered / swarm if swarm > 0.0 else 0.0
    own[18] = squash(arrays.terms[p].weight * span / scale)
    own[19] = out / m
    own[20] = (place + 0.5) / m
    own[21] = 1.0 / n


@compiled
def _best_two_of_each(episodes: Episodes, gains: VisitGains, b: int) -> None:
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


@compiled
def _follow_up(arrays: ProblemArrays, episodes: Episodes, gains: VisitGains, b: int, i: int, j: int) -> float:
    """Reward of the best visit after one to target `j`, 0 or more, by what is needed now."""
    p = episodes.problem[b]
    d = leg_to(arrays, episodes, b, i, j)
    time = leg_time(arrays, p, i, episodes.at[b, i], j, d)
    flown = episodes.flown[b, i] + air_length(arrays, p, i, d, time)
    clock = departure_after(arrays, p, j, episodes.clock[b, i] + time)
    best = 0.0
    for q in range(gains.near.shape[2]):
        then = gains.near[p, j, q]
        way = leg(arrays, p, i, j, then)
        time = leg_time(arrays, p, i, j, then, way)
        air = air_length(arrays, p, i, way, time)
        if is_out_of_range(arrays, p, i, then, flown + air) or is_late(
            clock + time, arrays.areas[p, then].deadline
        ):
            continue
        unloaded = 0.0
        for k in range(episodes.load.shape[2]):
            load = episodes.load[b, i, k]
            kept = left_of(load, min(load, episodes.need[b, j, k]), arrays.load[p, i, k])
            unloaded += min(kept, episodes.need[b, then, k])
        if unloaded > 0.0:
            best = max(best, earned_by(arrays, p, then, unloaded) - cost_of(arrays, p, way))
    return best
