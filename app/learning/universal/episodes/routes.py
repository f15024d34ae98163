"""Plans as routes, one a UAV: what they earn when each is flown as far as the others let it."""

from __future__ import annotations

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, close, reset_one, verdict
from app.simulation.visit import ALLOWED, START, airborne, ready

NOBODY = -1


@njit(cache=True, nogil=True, error_model="numpy")
def fly_routes(
    arrays: ProblemArrays,
    episodes: Episodes,
    routes: Integers,
    place: Integers,
    plan: Integers,
    without: int = NOBODY,
) -> float:
    """Fly routes without the visits that are not allowed; return what that earns.

    Parameters
    ----------
    arrays, episodes
        A stack of one problem, and one episode of it, overwritten.
    routes
        (M, S) targets in the order of their visits, then N.
    place
        (M,) scratch.
    plan
        (S, M), overwritten with what was flown.
    without
        UAV that has not moved in the end, or ``NOBODY``; its column of the plan is left as it is.
    """
    m, steps = routes.shape
    home = arrays.need.shape[1]
    reset_one(arrays, episodes, 0)
    place[:] = 0
    earned = 0.0
    for s in range(steps):
        for i in range(m):
            if i == without:
                continue
            p = place[i]
            while p < steps and routes[i, p] < home:
                if verdict(arrays, episodes, 0, i, routes[i, p]) == ALLOWED:
                    break
                p += 1
            action = routes[i, p] if p < steps else home
            place[i] = p + 1
            plan[s, i] = action
            earned += act(arrays, episodes, 0, i, action)
    if without == NOBODY:
        return earned + close(arrays, episodes, 0)
    for i in range(m):
        if i != without:
            earned += act(arrays, episodes, 0, i, home)
    return earned


@njit(cache=True, nogil=True, error_model="numpy")
def fly_last(
    arrays: ProblemArrays, episodes: Episodes, i: int, route: Integers, loads: Floats, needs: Floats
) -> float:
    """Return what UAV `i`, which has not moved, would earn on a route (S,) after all others; nothing changes.

    Parameters
    ----------
    arrays, episodes, route
        As :func:`fly_routes` has them.
    loads, needs
        (K,) and (S, K), scratch.
    """
    home, materials = arrays.need.shape[1], episodes.load.shape[2]
    flown, satisfaction, distance = episodes.flown[0, i], episodes.satisfaction[0], episodes.distance[0]
    for k in range(materials):
        loads[k] = episodes.load[0, i, k]
    earned, visits = 0.0, 0
    for s in range(len(route)):
        j = route[s]
        if j == home:
            break
        for k in range(materials):
            needs[s, k] = episodes.need[0, j, k]
        visits += 1
        if verdict(arrays, episodes, 0, i, j) == ALLOWED:
            earned += act(arrays, episodes, 0, i, j)
    earned += act(arrays, episodes, 0, i, home)
    for s in range(visits - 1, -1, -1):
        for k in range(materials):
            episodes.need[0, route[s], k] = needs[s, k]
    for k in range(materials):
        episodes.load[0, i, k] = loads[k]
    episodes.at[0, i], episodes.flown[0, i], episodes.visits[0, i] = START, flown, 0
    episodes.clock[0, i], episodes.aloft[0, i] = ready(arrays, 0, i), airborne(arrays, 0, i)
    episodes.kept[0, i, :] = False
    episodes.ret[0, i] = arrays.ret[0, i]
    episodes.satisfaction[0], episodes.distance[0] = satisfaction, distance
    return earned
