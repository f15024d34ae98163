"""What is seen of UAVs, bases, and of both together: reloads."""

from __future__ import annotations

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.pairwise.features import BaseFeature, ReloadFeature, UavFeature
from app.learning.pairwise.gains import FAR, Gains, in_order
from app.learning.pairwise.seen import LONG, share
from app.learning.universal.episodes.observation import FORBIDDEN, clip, squash
from app.simulation.arrays import ProblemArrays
from app.simulation.compilation import njit
from app.simulation.episodes import Episodes
from app.simulation.simulator import leg_home, leg_to
from app.simulation.visit import (
    air_length,
    departure_after,
    is_late,
    is_out_of_range,
    is_watched,
    leg,
    leg_time,
    loaded_of,
    most_carried,
    time_home,
)
from app.simulation.worth import cost_of, earned_by


@njit(cache=True, error_model="numpy")
def observe_bases(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, rows: Float32s) -> None:
    """Write what is seen of the bases in episode `b` into rows (D, B)."""
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
        rows[d, BaseFeature.TURNAROUND] = clip(arrays.bases[p, d].turnaround / gains.time[p], 0.0, LONG)


@njit(cache=True, error_model="numpy")
def observe_reloads(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, rows: Float32s) -> None:
    """Write what is seen of UAVs and bases together in episode `b` into rows (M, D, R)."""
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
                row[ReloadFeature.DISTANCE] = FAR
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
            row[ReloadFeature.ALLOWED] = 1.0 if in_order(arrays, episodes, gains, b, i, place) else 0.0
            row[ReloadFeature.DISTANCE] = min(length / span, FAR)
            row[ReloadFeature.COST] = squash(cost_of(arrays, p, length) / scale)
            row[ReloadFeature.FLIGHT_TIME] = clip(travel / time, 0.0, LONG)
            row[ReloadFeature.TURNAROUND] = clip(arrays.bases[p, d].turnaround / time, 0.0, LONG)
            row[ReloadFeature.LOADED] = share(loaded, full)
            row[ReloadFeature.LOAD_THEN] = share(load, full)
            row[ReloadFeature.LOADED_WANTED] = share(useful, full)
            row[ReloadFeature.BEST_THEN] = squash(best / scale)
            row[ReloadFeature.LEAD_OVER_NOW] = squash((best - max(gains.first[i], 0.0)) / scale)
            row[ReloadFeature.REACHED_THEN] = reached / needy if needy > 0 else 0.0
            row[ReloadFeature.RANGE_GAINED] = clip(episodes.flown[b, i] / span, 0.0, LONG)
            row[ReloadFeature.TIME_LEFT] = clip((arrays.uavs[p, i].until - clock) / time, -1.0, LONG)
            row[ReloadFeature.FARTHER_THAN_HOME] = clip(
                (length - leg_home(arrays, episodes, b, i)) / span, -1.0, FAR
            )


@njit(cache=True, error_model="numpy")
def observe_uavs(
    arrays: ProblemArrays,
    episodes: Episodes,
    gains: Gains,
    b: int,
    soonest: float,
    reloads: Float32s,
    rows: Float32s,
) -> None:
    """Write what is seen of the UAVs in episode `b` into rows (M, U).

    `soonest` is the earliest clock of a UAV that is out; `reloads` is what :func:`observe_reloads` wrote.
    """
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
        aloft = LONG
        if is_watched(arrays, p, i):
            left = min(uav.endurance - episodes.aloft[b, i], uav.until - episodes.clock[b, i])
            aloft = clip(left / time, -1.0, LONG)
        row[UavFeature.OUT] = 1.0 if is_out else 0.0
        row[UavFeature.ACTED] = 1.0 if gains.acted[b, i] else 0.0
        row[UavFeature.VISITS] = visits / n
        row[UavFeature.BEST] = squash(gains.first[i] / scale) if visits > 0 else -1.0
        row[UavFeature.SECOND] = squash(gains.second[i] / scale) if visits > 1 else -1.0
        row[UavFeature.LOAD_OF_MOST] = share(load, most)
        row[UavFeature.LOAD_LEFT] = share(load, full)
        row[UavFeature.LOAD_WANTED] = share(wanted, load)
        row[UavFeature.RANGE_LEFT] = clip((uav.voyage - episodes.flown[b, i]) / span, 0.0, LONG)
        row[UavFeature.HOME] = min(home_now / span, FAR)
        row[UavFeature.HOME_COST] = (
            squash(cost_of(arrays, p, home_now) / scale) if terms.charge_return else 0.0
        )
        row[UavFeature.CLOCK] = clip(episodes.clock[b, i] / time, 0.0, LONG)
        row[UavFeature.AHEAD] = clip((episodes.clock[b, i] - soonest) / time, 0.0, LONG)
        row[UavFeature.SPEED] = clip(uav.speed * time / span, 0.0, LONG)
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
