"""Plans as routes, one a UAV: what they earn when each is flown as far as the others let it.

A route is a UAV's targets and reloads in their order, then N.
"""

from __future__ import annotations

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes, copy_episode
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
    without: int,
) -> float:
    """Fly routes without the visits and reloads that are not allowed; return what that earns.

    Left out are reloads, too, after which nobody needs what the route still visits in that flight.

    Parameters
    ----------
    arrays, episodes
        A stack of one problem, and one episode of it, overwritten.
    routes
        (M, S).
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
            while p < steps and routes[i, p] != home:
                worthwhile = routes[i, p] < home or _is_of_use(arrays, episodes, routes[i], p)
                if worthwhile and verdict(arrays, episodes, 0, i, routes[i, p]) == ALLOWED:
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


@compiled
def _is_of_use(arrays: ProblemArrays, episodes: Episodes, route: Integers, p: int) -> bool:
    """Whether, after the reload at place `p` of a route, it comes to a target that needs something."""
    home = arrays.need.shape[1]
    for s in range(p + 1, len(route)):
        j = route[s]
        if j >= home:
            return False
        for k in range(episodes.need.shape[2]):
            if episodes.need[0, j, k] > 0.0:
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def fly_last(
    arrays: ProblemArrays, episodes: Episodes, i: int, route: Integers, loads: Floats, needs: Floats
) -> float:
    """Return what UAV `i`, which has not moved, would earn on a route (S,) after all others; nothing changes.

    Parameters
    ----------
    arrays, route
        As :func:`fly_routes` has them.
    episodes
        As there, and where there are bases one more, in which the first is kept meanwhile.
    loads, needs
        (K,) and (S, K), scratch.
    """
    if arrays.stock.shape[1] > 0:
        copy_episode(episodes, 0, episodes, 1)
        earned = _fly_on(arrays, episodes, i, route)
        copy_episode(episodes, 1, episodes, 0)
        return earned
    home, materials = arrays.need.shape[1], episodes.load.shape[2]
    flown, satisfaction, distance = episodes.flown[0, i], episodes.satisfaction[0], episodes.distance[0]
    for k in range(materials):
        loads[k] = episodes.load[0, i, k]
    visits = 0
    while visits < len(route) and route[visits] != home:
        for k in range(materials):
            needs[visits, k] = episodes.need[0, route[visits], k]
        visits += 1
    earned = _fly_on(arrays, episodes, i, route)
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


@compiled
def _fly_on(arrays: ProblemArrays, episodes: Episodes, i: int, route: Integers) -> float:
    """Let UAV `i` take what is allowed of a route, and return; return what that earns."""
    home, earned = arrays.need.shape[1], 0.0
    for s in range(len(route)):
        if route[s] == home:
            break
        if verdict(arrays, episodes, 0, i, route[s]) == ALLOWED:
            earned += act(arrays, episodes, 0, i, route[s])
    return earned + act(arrays, episodes, 0, i, home)
