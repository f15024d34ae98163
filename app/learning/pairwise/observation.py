"""What the policy sees of a state: UAVs, areas, bases, and every pair of a UAV and a place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)
from app.simulation.arrays import NONE, Flags, Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.legs import UNREACHABLE
from app.simulation.simulator import earned_now, leg_home, leg_to, verdict
from app.simulation.visit import (
    ALLOWED,
    air_length,
    aloft_after,
    begin_after,
    departure_after,
    flown_with_return,
    is_late,
    is_out_of_range,
    is_watched,
    left_of,
    leg,
    leg_time,
    loaded_of,
    most_carried,
    time_home,
    way_home,
)
from app.simulation.worth import cost_of, earned_by

FOLLOW_UPS = 16
"""Near areas considered for the visit after the next."""

_FAR = 10.0
"""Spans that a leg is long at most; a leg that does not exist is that long."""

_LONG = 4.0
"""Crossings of the span that a time is long at most; so much is left where there is no limit."""

FORBIDDEN = -np.inf
"""Value of a visit that is not allowed."""


class Gains(NamedTuple):
    """What each episode's UAVs could earn at each area now; kept up to date action by action.

    Attributes
    ----------
    span, level, time
        (P,) scales of each problem: distances, rewards, times.
    near
        (P, N, L) the areas nearest to each area.
    net
        (B, M, N) reward of a visit now; ``FORBIDDEN`` where it is not allowed.
    unloaded
        (B, M, N) amounts it would unload, all materials together.
    reloads
        (B, M, D) whether a reload is allowed now.
    acted
        (B, M) UAVs that have acted in this step.
    chosen
        (B, N+1+D) highest number of a UAV that has chosen a place in this step; ``NONE`` where none has.
    first, second
        (M,) scratch: the best and the second best of each UAV's visits.
    """

    span: Floats
    level: Floats
    time: Floats
    near: Integers
    net: Floats
    unloaded: Floats
    reloads: Flags
    acted: Flags
    chosen: Integers
    first: Floats
    second: Floats


class Seen(NamedTuple):
    """What the policy sees of T states of M UAVs, N areas and D bases.

    Attributes
    ----------
    uavs, areas, bases
        (T, M, U), (T, N, A) and (T, D, B), columns as :mod:`~app.learning.pairwise.features` names them.
    visits, reloads
        (T, M, N, V) and (T, M, D, R).
    """

    uavs: Float32s
    areas: Float32s
    bases: Float32s
    visits: Float32s
    reloads: Float32s


def new_seen(states: int, arrays: ProblemArrays) -> Seen:
    """Make memory for what is seen of some states."""
    m, n, _ = arrays.shape
    d = arrays.n_bases
    return Seen(
        np.zeros((states, m, len(UavFeature)), np.float32),
        np.zeros((states, n, len(AreaFeature)), np.float32),
        np.zeros((states, d, len(BaseFeature)), np.float32),
        np.zeros((states, m, n, len(VisitFeature)), np.float32),
        np.zeros((states, m, d, len(ReloadFeature)), np.float32),
    )


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
    """Return how far places, areas then bases, are apart, in spans, (P, N+D, N+D); by the nearest class."""
    n = arrays.shape[1]
    apart = arrays.between.min(axis=1) / span[:, None, None]
    if arrays.n_bases:
        places = np.r_[0:n, n + 1 : n + 1 + arrays.n_bases]
        apart = apart[:, places][:, :, places]
    return np.minimum(apart, _FAR).astype(np.float32)


def new_gains(arrays: ProblemArrays, batch: int) -> Gains:
    """Make the gains of `batch` episodes; :func:`look` fills it."""
    m, n, _ = arrays.shape
    span, level, time = scales(arrays)
    length = max(1, min(FOLLOW_UPS, n - 1))
    between = arrays.between[:, :, :n, :n].min(axis=1)
    between = np.where(arrays.areas["need_total"][:, None, :] > 0, between, np.inf)
    between[:, np.arange(n), np.arange(n)] = np.inf
    near = np.argsort(between, axis=2, kind="stable")[:, :, :length]
    return Gains(
        span=span,
        level=level,
        time=time,
        near=np.ascontiguousarray(near, dtype=np.int64),
        net=np.empty((batch, m, n)),
        unloaded=np.empty((batch, m, n)),
        reloads=np.zeros((batch, m, arrays.n_bases), np.bool_),
        acted=np.zeros((batch, m), np.bool_),
        chosen=np.full((batch, n + 1 + arrays.n_bases), NONE, np.int64),
        first=np.empty(m),
        second=np.empty(m),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def look(arrays: ProblemArrays, episodes: Episodes, gains: Gains) -> None:
    """Work out everything of the gains for the present state of every episode."""
    for b in range(episodes.at.shape[0]):
        for i in range(episodes.at.shape[1]):
            look_at(arrays, episodes, gains, b, i)


@compiled
def look_at(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int) -> None:
    """Work out what UAV `i` of episode `b` could do now."""
    n = episodes.need.shape[1]
    for j in range(n):
        _value(arrays, episodes, gains, b, i, j)
    for d in range(gains.reloads.shape[2]):
        gains.reloads[b, i, d] = verdict(arrays, episodes, b, i, n + 1 + d) == ALLOWED


@compiled
def look_again(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int, action: int) -> None:
    """Bring the gains up to date after UAV `i` of episode `b` took an action."""
    gains.acted[b, i] = True
    if action != episodes.need.shape[1]:
        gains.chosen[b, action] = i
    look_at(arrays, episodes, gains, b, i)
    if action < episodes.need.shape[1]:
        for other in range(episodes.at.shape[1]):
            _value(arrays, episodes, gains, b, other, action)


@compiled
def begin_step(episodes: Episodes, gains: Gains, b: int) -> None:
    """Let nobody have acted but those who have returned."""
    for i in range(episodes.at.shape[1]):
        gains.acted[b, i] = episodes.ret[b, i]
    for j in range(gains.chosen.shape[1]):
        gains.chosen[b, j] = NONE


@compiled
def in_order(gains: Gains, b: int, i: int, j: int) -> bool:
    """Whether UAV `i` may choose a place after those that have chosen it in this step.

    In a plan the UAVs act in the order of their numbers, so at a place they have to do so here: otherwise
    what one unloads, or loads, would not be what it does in the plan.
    """
    return gains.chosen[b, j] < i


@compiled
def _value(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int, j: int) -> None:
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
def share(part: float, whole: float) -> float:
    """Return a part of a whole, at most 1; 0 of nothing."""
    return min(part / whole, 1.0) if whole > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def observe(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, seen: Seen, t: int) -> None:
    """Write what is seen of the present state of episode `b` into state `t` of what is seen.

    Parameters
    ----------
    arrays, episodes, gains
        The gains are up to date.
    b, t
        Episode, and where it is written.
    seen
        All of state `t` is overwritten.
    """
    _best_two_of_each(episodes, gains, b)
    soonest = np.inf
    for i in range(episodes.at.shape[1]):
        if not episodes.ret[b, i]:
            soonest = min(soonest, episodes.clock[b, i])
    soonest = 0.0 if soonest == np.inf else soonest
    _observe_areas(arrays, episodes, gains, b, soonest, seen.areas[t])
    _observe_visits(arrays, episodes, gains, b, seen.areas[t], seen.visits[t])
    _observe_bases(arrays, episodes, gains, b, seen.bases[t])
    _observe_reloads(arrays, episodes, gains, b, seen.reloads[t])
    _observe_uavs(arrays, episodes, gains, b, soonest, seen.reloads[t], seen.uavs[t])


@njit(cache=True, error_model="numpy")
def _observe_areas(
    arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, soonest: float, rows: Float32s
) -> None:
    p = episodes.problem[b]
    m, n, materials = episodes.at.shape[1], episodes.need.shape[1], episodes.load.shape[2]
    scale, span, time = gains.level[p], gains.span[p], gains.time[p]
    total = 0.0
    for j in range(n):
        for k in range(materials):
            total += episodes.need[b, j, k]
    for j in range(n):
        need = supply = 0.0
        for k in range(materials):
            need += episodes.need[b, j, k]
        able, best, second = 0, FORBIDDEN, FORBIDDEN
        for i in range(m):
            net = gains.net[b, i, j]
            if net <= FORBIDDEN:
                continue
            able += 1
            supply += gains.unloaded[b, i, j]
            if net > best:
                best, second = net, best
            elif net > second:
                second = net
        area = arrays.areas[p, j]
        row = rows[j]
        level = area.level / scale if area.need_total > 0.0 else 0.0
        row[AreaFeature.NEEDS] = 1.0 if need > 0.0 else 0.0
        row[AreaFeature.NEED_LEFT] = share(need, area.need_total)
        row[AreaFeature.NEED_SHARE] = share(need, total)
        row[AreaFeature.LEVEL] = level
        row[AreaFeature.LEVEL_DECADES] = clip(np.log10(max(level, 1e-9)) / 4.0, -1.0, 0.0)
        row[AreaFeature.WORTH] = level * share(need, area.need_total)
        row[AreaFeature.HAS_DEADLINE] = 1.0 if area.deadline < np.inf else 0.0
        row[AreaFeature.DEADLINE] = clip((area.deadline - soonest) / time, -1.0, _LONG)
        row[AreaFeature.EARLIEST] = clip((area.earliest - soonest) / time, 0.0, _LONG)
        row[AreaFeature.SERVICE] = clip(area.service / time, 0.0, _LONG)
        row[AreaFeature.ABLE] = able / m
        row[AreaFeature.SUPPLY] = squash(supply / need) if need > 0.0 else 0.0
        row[AreaFeature.BEST] = squash(best / scale) if able > 0 else -1.0
        row[AreaFeature.SECOND] = squash(second / scale) if able > 1 else -1.0
        row[AreaFeature.CHOSEN] = 1.0 if gains.chosen[b, j] != NONE else 0.0
        row[AreaFeature.NEIGHBOUR] = _FAR
        for q in range(gains.near.shape[2]):
            other = gains.near[p, j, q]
            wanted = 0.0
            for k in range(materials):
                wanted += episodes.need[b, other, k]
            if wanted > 0.0 and other != j:
                row[AreaFeature.NEIGHBOUR] = min(arrays.between[p, 0, j, other] / span, _FAR)
                break


@njit(cache=True, error_model="numpy")
def _observe_visits(
    arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, areas: Float32s, rows: Float32s
) -> None:
    p = episodes.problem[b]
    m, n, materials = episodes.at.shape[1], episodes.need.shape[1], episodes.load.shape[2]
    scale, span, time = gains.level[p], gains.span[p], gains.time[p]
    steps_left = arrays.max_steps[p] - episodes.step[b]
    supply, best, second, of_best = np.zeros(n), np.full(n, FORBIDDEN), np.full(n, FORBIDDEN), np.full(n, -1)
    for j in range(n):
        for i in range(m):
            net = gains.net[b, i, j]
            supply[j] += gains.unloaded[b, i, j]
            if net > best[j]:
                second[j], best[j], of_best[j] = best[j], net, i
            elif net > second[j]:
                second[j] = net
    for i in range(m):
        load = 0.0
        for k in range(materials):
            load += episodes.load[b, i, k]
        nearest = np.inf
        for j in range(n):
            if gains.net[b, i, j] > FORBIDDEN:
                nearest = min(nearest, leg_to(arrays, episodes, b, i, j))
        home_now = leg_home(arrays, episodes, b, i)
        for j in range(n):
            row = rows[i, j]
            if gains.net[b, i, j] <= FORBIDDEN:
                row[:] = 0.0
                row[VisitFeature.DISTANCE] = (
                    min(leg_to(arrays, episodes, b, i, j) / span, _FAR) if not episodes.ret[b, i] else _FAR
                )
                continue
            net, unloaded = gains.net[b, i, j], gains.unloaded[b, i, j]
            need = carried = 0.0
            for k in range(materials):
                need += episodes.need[b, j, k]
                if episodes.load[b, i, k] > 0.0:
                    carried += episodes.need[b, j, k]
            d = leg_to(arrays, episodes, b, i, j)
            cost = cost_of(arrays, p, d)
            value = net + cost
            travel = leg_time(arrays, p, i, episodes.at[b, i], j, d)
            arrival = episodes.clock[b, i] + travel
            wait = begin_after(arrays, p, j, arrival) - arrival
            end = departure_after(arrays, p, j, arrival)
            reach = flown_with_return(
                arrays, p, i, j, episodes.flown[b, i] + air_length(arrays, p, i, d, travel)
            )
            home_then = way_home(arrays, p, i, j)
            rival = second[j] if of_best[j] == i else best[j]
            elsewhere = gains.second[i] if gains.first[i] <= net else gains.first[i]
            follow_up, around = 0.0, 0.0
            if steps_left > 1:
                follow_up, around = _follow_up(arrays, episodes, gains, b, i, j)
            others = supply[j] - unloaded
            row[VisitFeature.ALLOWED] = 1.0 if in_order(gains, b, i, j) else 0.0
            row[VisitFeature.DISTANCE] = min(d / span, _FAR)
            row[VisitFeature.COST] = squash(cost / scale)
            row[VisitFeature.VALUE] = squash(value / scale)
            row[VisitFeature.NET] = squash(net / scale)
            row[VisitFeature.SHARE_OF_NEED] = share(unloaded, need)
            row[VisitFeature.SHARE_OF_LOAD] = share(unloaded, load)
            row[VisitFeature.RANGE_SLACK] = clip((arrays.uavs[p, i].voyage - reach) / span, -1.0, 3.0)
            row[VisitFeature.HOME_THEN] = min(home_then / span, _FAR)
            row[VisitFeature.DETOUR] = clip((d + home_then - home_now) / span, -_FAR, _FAR)
            row[VisitFeature.DEADLINE_SLACK] = clip(
                (arrays.areas[p, j].deadline - arrival) / time, -1.0, _LONG
            )
            row[VisitFeature.FLIGHT_TIME] = clip(travel / time, 0.0, _LONG)
            row[VisitFeature.WAIT] = clip(wait / time, 0.0, _LONG)
            row[VisitFeature.AIR_SLACK] = _air_left(arrays, episodes, b, i, j, arrival, end, time)
            row[VisitFeature.FOLLOW_UP] = squash(follow_up / scale)
            row[VisitFeature.NET_WITH_FOLLOW_UP] = squash((net + follow_up) / scale)
            row[VisitFeature.LEAD_OVER_RIVALS] = squash((net - max(rival, 0.0)) / scale)
            row[VisitFeature.LEAD_OVER_ELSEWHERE] = squash((net - max(elsewhere, 0.0)) / scale)
            row[VisitFeature.SHARE_OF_VALUE] = value / (value + cost) if value > 0.0 else 0.0
            row[VisitFeature.FILLS_NEED] = 1.0 if unloaded >= need * (1.0 - 1e-9) else 0.0
            row[VisitFeature.EMPTIES_LOAD] = 1.0 if unloaded >= load * (1.0 - 1e-9) else 0.0
            row[VisitFeature.REST_BY_RIVALS] = share(others, need - unloaded) if need > unloaded else 1.0
            row[VisitFeature.NET_BY_TIME] = squash(net / scale / (0.05 + (end - episodes.clock[b, i]) / time))
            row[VisitFeature.BEFORE] = _was_before(arrays, episodes, b, i, j)
            row[VisitFeature.AROUND] = squash(around / scale)
            row[VisitFeature.FARTHER] = min((d - nearest) / span, _FAR)
            row[VisitFeature.CHOSEN] = areas[j, AreaFeature.CHOSEN]
            row[VisitFeature.MATERIALS] = share(carried, need)


@compiled
def _air_left(
    arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int, arrival: float, end: float, time: float
) -> float:
    """Time in the air, or to be home by, that a visit and the way home leave, over crossings of the span."""
    p = episodes.problem[b]
    if not is_watched(arrays, p, i):
        return _LONG
    home = time_home(arrays, p, i, j)
    aloft = aloft_after(
        arrays, p, i, episodes.at[b, i], episodes.aloft[b, i], episodes.clock[b, i], arrival, end, j
    )
    left = min(arrays.uavs[p, i].endurance - aloft - home, arrays.uavs[p, i].until - end - home)
    return clip(left / time, -1.0, _LONG)


@compiled
def _was_before(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int) -> float:
    """1 where the visit is in ``start_plan`` and not made yet, and changes cost reward."""
    for w in range(episodes.kept.shape[2]):
        if arrays.before[episodes.problem[b], i, w] == j and not episodes.kept[b, i, w]:
            return 1.0
    return 0.0


@compiled
def _follow_up(
    arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int, j: int
) -> tuple[float, float]:
    """Reward of the best visit after one to area `j`, and of all near ones by nearness."""
    p = episodes.problem[b]
    d = leg_to(arrays, episodes, b, i, j)
    time = leg_time(arrays, p, i, episodes.at[b, i], j, d)
    flown = episodes.flown[b, i] + air_length(arrays, p, i, d, time)
    clock = departure_after(arrays, p, j, episodes.clock[b, i] + time)
    best = around = 0.0
    for q in range(gains.near.shape[2]):
        then = gains.near[p, j, q]
        unloaded = 0.0
        for k in range(episodes.load.shape[2]):
            load = episodes.load[b, i, k]
            kept = left_of(load, min(load, episodes.need[b, j, k]), most_carried(arrays, p, i, k))
            unloaded += min(kept, episodes.need[b, then, k])
        if unloaded <= 0.0:
            continue
        way = leg(arrays, p, i, j, then)
        time = leg_time(arrays, p, i, j, then, way)
        air = air_length(arrays, p, i, way, time)
        if is_out_of_range(arrays, p, i, then, flown + air) or is_late(
            clock + time, arrays.areas[p, then].deadline
        ):
            continue
        net = earned_by(arrays, p, then, unloaded) - cost_of(arrays, p, way)
        if net > 0.0:
            best = max(best, net)
            around += net * np.exp(-8.0 * way / gains.span[p])
    return best, around


@njit(cache=True, error_model="numpy")
def _observe_bases(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, rows: Float32s) -> None:
    p = episodes.problem[b]
    n, materials = episodes.need.shape[1], episodes.load.shape[2]
    for d in range(rows.shape[0]):
        needed = covered = 0.0
        for k in range(materials):
            need = 0.0
            for j in range(n):
                need += episodes.need[b, j, k]
            needed += need
            covered += min(need, episodes.stock[b, d, k])
        rows[d, BaseFeature.STOCK] = share(covered, needed)
        rows[d, BaseFeature.UNLIMITED] = 1.0 if episodes.stock[b, d, 0] == np.inf else 0.0
        rows[d, BaseFeature.TURNAROUND] = clip(arrays.bases[p, d].turnaround / gains.time[p], 0.0, _LONG)


@njit(cache=True, error_model="numpy")
def _observe_reloads(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, rows: Float32s) -> None:
    p = episodes.problem[b]
    m, n, materials = episodes.at.shape[1], episodes.need.shape[1], episodes.load.shape[2]
    scale, span, time = gains.level[p], gains.span[p], gains.time[p]
    then, wanted = np.empty(materials), np.zeros(materials)
    for k in range(materials):
        for j in range(n):
            wanted[k] += episodes.need[b, j, k]
    for i in range(m):
        for d in range(rows.shape[1]):
            row = rows[i, d]
            row[:] = 0.0
            if not gains.reloads[b, i, d]:
                row[ReloadFeature.DISTANCE] = _FAR
                continue
            place = n + 1 + d
            length = leg_to(arrays, episodes, b, i, place)
            travel = leg_time(arrays, p, i, episodes.at[b, i], place, length)
            clock = departure_after(arrays, p, place, episodes.clock[b, i] + travel)
            loaded = useful = load = full = 0.0
            for k in range(materials):
                more = loaded_of(episodes.load[b, i, k], arrays.full[p, i, k], episodes.stock[b, d, k])
                then[k] = episodes.load[b, i, k] + more
                loaded += more
                load += then[k]
                full += arrays.full[p, i, k]
                useful += max(0.0, min(then[k], wanted[k]) - min(episodes.load[b, i, k], wanted[k]))
            best, reached, needy = 0.0, 0, 0
            for j in range(n):
                unloaded = need = 0.0
                for k in range(materials):
                    need += episodes.need[b, j, k]
                    unloaded += min(then[k], episodes.need[b, j, k])
                needy += need > 0.0
                if unloaded <= 0.0:
                    continue
                way = leg(arrays, p, i, place, j)
                there = leg_time(arrays, p, i, place, j, way)
                late = is_late(clock + there, arrays.areas[p, j].deadline)
                if late or is_out_of_range(arrays, p, i, j, air_length(arrays, p, i, way, there)):
                    continue
                if is_watched(arrays, p, i):
                    end = departure_after(arrays, p, j, clock + there)
                    if end + time_home(arrays, p, i, j) > arrays.uavs[p, i].until:
                        continue
                reached += 1
                best = max(best, earned_by(arrays, p, j, unloaded) - cost_of(arrays, p, way))
            row[ReloadFeature.ALLOWED] = 1.0 if in_order(gains, b, i, place) else 0.0
            row[ReloadFeature.DISTANCE] = min(length / span, _FAR)
            row[ReloadFeature.COST] = squash(cost_of(arrays, p, length) / scale)
            row[ReloadFeature.FLIGHT_TIME] = clip(travel / time, 0.0, _LONG)
            row[ReloadFeature.TURNAROUND] = clip(arrays.bases[p, d].turnaround / time, 0.0, _LONG)
            row[ReloadFeature.LOADED] = share(loaded, full)
            row[ReloadFeature.LOAD_THEN] = share(load, full)
            row[ReloadFeature.LOADED_WANTED] = share(useful, full)
            row[ReloadFeature.BEST_THEN] = squash(best / scale)
            row[ReloadFeature.LEAD_OVER_NOW] = squash((best - max(gains.first[i], 0.0)) / scale)
            row[ReloadFeature.REACHED_THEN] = reached / needy if needy > 0 else 0.0
            row[ReloadFeature.RANGE_GAINED] = clip(episodes.flown[b, i] / span, 0.0, _LONG)
            row[ReloadFeature.TIME_LEFT] = clip((arrays.uavs[p, i].until - clock) / time, -1.0, _LONG)
            row[ReloadFeature.FARTHER_THAN_HOME] = clip(
                (length - leg_home(arrays, episodes, b, i)) / span, -1.0, _FAR
            )


@njit(cache=True, error_model="numpy")
def _observe_uavs(
    arrays: ProblemArrays,
    episodes: Episodes,
    gains: Gains,
    b: int,
    soonest: float,
    reloads: Float32s,
    rows: Float32s,
) -> None:
    p = episodes.problem[b]
    m, n, materials = episodes.at.shape[1], episodes.need.shape[1], episodes.load.shape[2]
    scale, span, time = gains.level[p], gains.span[p], gains.time[p]
    terms = arrays.terms[p]
    steps = arrays.max_steps[p]
    steps_left = steps - episodes.step[b]
    need, supply = np.zeros(materials), np.zeros(materials)
    most = needed = covered = swarm = 0.0
    out = acted = 0
    for i in range(m):
        carried = 0.0
        for k in range(materials):
            carried += episodes.load[b, i, k]
            if not episodes.ret[b, i]:
                supply[k] += episodes.load[b, i, k]
        if not episodes.ret[b, i]:
            out += 1
            acted += gains.acted[b, i]
            most = max(most, carried)
            swarm += carried
    for k in range(materials):
        for j in range(n):
            need[k] += episodes.need[b, j, k]
        needed += need[k]
        covered += min(need[k], supply[k])
    for i in range(m):
        row = rows[i]
        load = full = wanted = 0.0
        for k in range(materials):
            load += episodes.load[b, i, k]
            full += most_carried(arrays, p, i, k)
            wanted += min(episodes.load[b, i, k], need[k])
        visits = 0
        for j in range(n):
            visits += gains.net[b, i, j] > FORBIDDEN
        returns, best_then = 0.0, 0.0
        for d in range(reloads.shape[1]):
            returns = max(returns, reloads[i, d, ReloadFeature.ALLOWED])
            best_then = max(best_then, reloads[i, d, ReloadFeature.BEST_THEN])
        is_out = not episodes.ret[b, i]
        home_now = leg_home(arrays, episodes, b, i) if is_out else 0.0
        uav = arrays.uavs[p, i]
        aloft = _LONG
        if is_watched(arrays, p, i):
            left = min(uav.endurance - episodes.aloft[b, i], uav.until - episodes.clock[b, i])
            aloft = clip(left / time, -1.0, _LONG)
        row[UavFeature.OUT] = 1.0 if is_out else 0.0
        row[UavFeature.ACTED] = 1.0 if gains.acted[b, i] else 0.0
        row[UavFeature.VISITS] = visits / n
        row[UavFeature.BEST] = squash(gains.first[i] / scale) if visits > 0 else -1.0
        row[UavFeature.SECOND] = squash(gains.second[i] / scale) if visits > 1 else -1.0
        row[UavFeature.LOAD_OF_MOST] = share(load, most)
        row[UavFeature.LOAD_LEFT] = share(load, full)
        row[UavFeature.LOAD_WANTED] = share(wanted, load)
        row[UavFeature.RANGE_LEFT] = clip((uav.voyage - episodes.flown[b, i]) / span, 0.0, _LONG)
        row[UavFeature.HOME] = min(home_now / span, _FAR)
        row[UavFeature.HOME_COST] = (
            squash(cost_of(arrays, p, home_now) / scale) if terms.charge_return else 0.0
        )
        row[UavFeature.CLOCK] = clip(episodes.clock[b, i] / time, 0.0, _LONG)
        row[UavFeature.AHEAD] = clip((episodes.clock[b, i] - soonest) / time, 0.0, _LONG)
        row[UavFeature.SPEED] = clip(uav.speed * time / span, 0.0, _LONG)
        row[UavFeature.AIR_LEFT] = aloft
        row[UavFeature.RELOADS] = returns
        row[UavFeature.AFTER_RELOAD] = best_then
        row[UavFeature.STEPS_LEFT] = steps_left / steps
        row[UavFeature.ONE_OVER_STEPS] = 1.0 / max(steps_left, 1)
        row[UavFeature.LAST_STEP] = 1.0 if steps_left <= 1 else 0.0
        row[UavFeature.RETURN_CHARGED] = 1.0 if terms.charge_return else 0.0
        row[UavFeature.MUST_RETURN] = 1.0 if terms.return_to_base else 0.0
        row[UavFeature.UAVS_OF_ALL] = m / (m + n)
        row[UavFeature.ONE_OVER_AREAS] = 1.0 / n
        row[UavFeature.COVERED] = share(covered, needed)
        row[UavFeature.SUPPLY_WANTED] = share(covered, swarm)
        row[UavFeature.DISTANCE_WEIGHT] = squash(terms.weight * span / scale)
        row[UavFeature.SWARM_OUT] = out / m
        row[UavFeature.SWARM_ACTED] = acted / m
        row[UavFeature.DECAY] = squash(terms.decay * time)
        row[UavFeature.BONUS] = squash(terms.bonus)
        row[UavFeature.MAKESPAN_WEIGHT] = squash(terms.makespan * time / scale)
        row[UavFeature.CHANGE_WEIGHT] = squash(terms.change / scale)
        row[UavFeature.HAS_BASES] = 1.0 if reloads.shape[1] > 0 else 0.0


@compiled
def _best_two_of_each(episodes: Episodes, gains: Gains, b: int) -> None:
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
