"""What the policy sees of a state: UAVs, areas, bases, and every pair of a UAV and a place."""

from __future__ import annotations

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.pairwise.features import AreaFeature, VisitFeature
from app.learning.pairwise.gains import FAR, Gains, best_two_of_each, in_order
from app.learning.pairwise.seen import LONG, Seen, share
from app.learning.pairwise.uav_observation import observe_bases, observe_reloads, observe_uavs
from app.learning.universal.episodes.observation import FORBIDDEN, clip, squash
from app.simulation.arrays import NONE, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import leg_home, leg_to
from app.simulation.visit import (
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
    most_carried,
    time_home,
    way_home,
)
from app.simulation.worth import cost_of, earned_by


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
    best_two_of_each(episodes, gains, b)
    soonest = np.inf
    for i in range(episodes.at.shape[1]):
        if not episodes.ret[b, i]:
            soonest = min(soonest, episodes.clock[b, i])
    soonest = 0.0 if soonest == np.inf else soonest
    _observe_areas(arrays, episodes, gains, b, soonest, seen.areas[t])
    _observe_visits(arrays, episodes, gains, b, seen.areas[t], seen.visits[t])
    observe_bases(arrays, episodes, gains, b, seen.bases[t])
    observe_reloads(arrays, episodes, gains, b, seen.reloads[t])
    observe_uavs(arrays, episodes, gains, b, soonest, seen.reloads[t], seen.uavs[t])


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
        row[AreaFeature.DEADLINE] = clip((area.deadline - soonest) / time, -1.0, LONG)
        row[AreaFeature.EARLIEST] = clip((area.earliest - soonest) / time, 0.0, LONG)
        row[AreaFeature.SERVICE] = clip(area.service / time, 0.0, LONG)
        row[AreaFeature.ABLE] = able / m
        row[AreaFeature.SUPPLY] = squash(supply / need) if need > 0.0 else 0.0
        row[AreaFeature.BEST] = squash(best / scale) if able > 0 else -1.0
        row[AreaFeature.SECOND] = squash(second / scale) if able > 1 else -1.0
        row[AreaFeature.CHOSEN] = 1.0 if gains.chosen[b, j] != NONE else 0.0
        row[AreaFeature.NEIGHBOUR] = FAR
        for q in range(gains.near.shape[2]):
            other = gains.near[p, j, q]
            wanted = 0.0
            for k in range(materials):
                wanted += episodes.need[b, other, k]
            if wanted > 0.0 and other != j:
                row[AreaFeature.NEIGHBOUR] = min(arrays.between[p, 0, j, other] / span, FAR)
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
                    min(leg_to(arrays, episodes, b, i, j) / span, FAR) if not episodes.ret[b, i] else FAR
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
            row[VisitFeature.ALLOWED] = 1.0 if in_order(arrays, episodes, gains, b, i, j) else 0.0
            row[VisitFeature.DISTANCE] = min(d / span, FAR)
            row[VisitFeature.COST] = squash(cost / scale)
            row[VisitFeature.VALUE] = squash(value / scale)
            row[VisitFeature.NET] = squash(net / scale)
            row[VisitFeature.SHARE_OF_NEED] = share(unloaded, need)
            row[VisitFeature.SHARE_OF_LOAD] = share(unloaded, load)
            row[VisitFeature.RANGE_SLACK] = clip((arrays.uavs[p, i].voyage - reach) / span, -1.0, 3.0)
            row[VisitFeature.HOME_THEN] = min(home_then / span, FAR)
            row[VisitFeature.DETOUR] = clip((d + home_then - home_now) / span, -FAR, FAR)
            row[VisitFeature.DEADLINE_SLACK] = clip(
                (arrays.areas[p, j].deadline - arrival) / time, -1.0, LONG
            )
            row[VisitFeature.FLIGHT_TIME] = clip(travel / time, 0.0, LONG)
            row[VisitFeature.WAIT] = clip(wait / time, 0.0, LONG)
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
            row[VisitFeature.FARTHER] = min((d - nearest) / span, FAR)
            row[VisitFeature.CHOSEN] = areas[j, AreaFeature.CHOSEN]
            row[VisitFeature.MATERIALS] = share(carried, need)


@compiled
def _air_left(
    arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int, arrival: float, end: float, time: float
) -> float:
    """Time in the air, or to be home by, that a visit and the way home leave, over crossings of the span."""
    p = episodes.problem[b]
    if not is_watched(arrays, p, i):
        return LONG
    home = time_home(arrays, p, i, j)
    aloft = aloft_after(
        arrays, p, i, episodes.at[b, i], episodes.aloft[b, i], episodes.clock[b, i], arrival, end, j
    )
    left = min(arrays.uavs[p, i].endurance - aloft - home, arrays.uavs[p, i].until - end - home)
    return clip(left / time, -1.0, LONG)


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
        if then == j:
            continue
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
