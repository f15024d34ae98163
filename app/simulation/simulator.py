"""The simulator: sections 2 to 4 of the specification, compiled, batch-first.

There is one truth about what a plan earns, and it is here: the genetic algorithm, the searches and the
learners all call these functions. Functions over one UAV's action take ``(arrays, episodes, b, …)``: the
stack of problems, the batch of episodes, and the episode's index; functions over a batch loop over them.
"""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import NONE, Flags, Integers, ProblemArrays
from app.simulation.decorators import compiled, merged
from app.simulation.episodes import Episodes
from app.simulation.visit import (
    ALLOWED,
    RETURNING,
    START,
    UNLOADS_NOTHING,
    air_length,
    airborne,
    aloft_after,
    begin_after,
    can_unload,
    departure_after,
    is_base,
    is_watched,
    left_of,
    leg,
    leg_time,
    loaded_of,
    most_carried,
    reach_rule,
    ready,
    time_home,
    way_home,
)
from app.simulation.worth import (
    bonus_of,
    closing_cost,
    cost_of,
    decays,
    discount,
    earned_by,
    has_bonus,
    has_closing_cost,
)


def new_episodes(arrays: ProblemArrays, batch: int, problem: Integers | None = None) -> Episodes:
    """Begin `batch` episodes.

    Parameters
    ----------
    arrays
        The stack of problems.
    batch
        B.
    problem
        (B,) index of each episode's problem; all the first one by default.
    """
    m, n, k = arrays.shape
    before = arrays.before.shape[2]
    episodes = Episodes(
        problem=np.zeros(batch, np.int64) if problem is None else np.ascontiguousarray(problem, np.int64),
        at=np.empty((batch, m), np.int64),
        flown=np.empty((batch, m)),
        clock=np.empty((batch, m)),
        aloft=np.empty((batch, m)),
        visits=np.empty((batch, m), np.int64),
        ret=np.empty((batch, m), np.bool_),
        load=np.empty((batch, m, k)),
        stock=np.empty((batch, arrays.n_bases, k)),
        need=np.empty((batch, n, k)),
        kept=np.empty((batch, m, before), np.bool_),
        satisfaction=np.empty(batch),
        distance=np.empty(batch),
        step=np.empty(batch, np.int64),
        done=np.empty(batch, np.bool_),
    )
    reset(arrays, episodes)
    return episodes


@compiled
def reset(arrays: ProblemArrays, episodes: Episodes) -> None:
    """Put every episode back to its beginning."""
    for b in range(episodes.problem.shape[0]):
        reset_one(arrays, episodes, b)


@compiled
def reset_one(arrays: ProblemArrays, episodes: Episodes, b: int) -> None:
    """Put episode `b` back to its beginning."""
    p = episodes.problem[b]
    materials = episodes.load.shape[2]
    for i in range(episodes.at.shape[1]):
        episodes.at[b, i] = START
        episodes.flown[b, i] = arrays.uavs[p, i].dis
        episodes.clock[b, i] = ready(arrays, p, i)
        episodes.aloft[b, i] = airborne(arrays, p, i)
        episodes.visits[b, i] = 0
        episodes.ret[b, i] = arrays.ret[p, i]
        for w in range(episodes.kept.shape[2]):
            episodes.kept[b, i, w] = False
        for k in range(materials):
            episodes.load[b, i, k] = arrays.load[p, i, k]
    for j in range(episodes.need.shape[1]):
        for k in range(materials):
            episodes.need[b, j, k] = arrays.need[p, j, k]
    for d in range(episodes.stock.shape[1]):
        for k in range(materials):
            episodes.stock[b, d, k] = arrays.stock[p, d, k]
    episodes.satisfaction[b] = 0.0
    episodes.distance[b] = 0.0
    episodes.step[b] = 0
    episodes.done[b] = not any_allowed(arrays, episodes, b)


@compiled
def leg_to(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int) -> float:
    """Distance from where UAV `i` is to stop `j` (rule 1 of section 3)."""
    return leg(arrays, episodes.problem[b], i, episodes.at[b, i], j)


@compiled
def leg_home(arrays: ProblemArrays, episodes: Episodes, b: int, i: int) -> float:
    """Distance from where UAV `i` is to where it lands."""
    return way_home(arrays, episodes.problem[b], i, episodes.at[b, i])


@merged
def verdict(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int) -> int:
    """Rule 2: ``ALLOWED``, or the rule that UAV `i` breaks now with a visit to `j`, or a reload there."""
    if episodes.ret[b, i]:
        return RETURNING
    if is_base(arrays, j):
        return reach_verdict(arrays, episodes, b, i, j)
    useful = False
    for k in range(episodes.load.shape[2]):
        if can_unload(episodes.load[b, i, k], episodes.need[b, j, k]):
            useful = True
            break
    if not useful:
        return UNLOADS_NOTHING
    return reach_verdict(arrays, episodes, b, i, j)


@merged
def reach_verdict(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int) -> int:
    """All of rule 2 but whether something is unloaded: ``ALLOWED``, or the rule that forbids the visit."""
    return reach_rule(
        arrays, episodes.problem[b], i, episodes.at[b, i], j,
        episodes.visits[b, i], episodes.flown[b, i], episodes.clock[b, i], episodes.aloft[b, i],
    )  # fmt: skip


@compiled
def promised(arrays: ProblemArrays, episodes: Episodes, b: int, i: int) -> int:
    """Return the target that UAV `i` is committed to next, if that visit is allowed; else N."""
    p, visits, home = episodes.problem[b], episodes.visits[b, i], arrays.need.shape[1]
    if visits < arrays.committed.shape[2]:
        j = arrays.committed[p, i, visits]
        if j not in (NONE, home) and verdict(arrays, episodes, b, i, j) == ALLOWED:
            return j
    return home


@merged
def act(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, action: int) -> float:
    """Let UAV `i` take an action that is allowed, and return what it earns (rules 1 and 3 to 5).

    A UAV that has returned stays home and earns nothing. What is lost at the end is not in it
    (:func:`closing`).
    """
    p, home = episodes.problem[b], arrays.need.shape[1]
    if action == home:
        if episodes.ret[b, i]:
            return 0.0
        d = leg_home(arrays, episodes, b, i)
        if episodes.visits[b, i] > 0:
            episodes.clock[b, i] += time_home(arrays, p, i, episodes.at[b, i])
        episodes.ret[b, i] = True
        episodes.at[b, i] = home
        episodes.flown[b, i] += d
        if not arrays.terms[p].charge_return:
            return 0.0
        episodes.distance[b] += d
        return -cost_of(arrays, p, d)
    if action > home:
        return reload(arrays, episodes, b, i, action)
    d = fly_to(arrays, episodes, b, i, action)
    earned = 0.0
    for k in range(episodes.load.shape[2]):
        load, need = episodes.load[b, i, k], episodes.need[b, action, k]
        unloaded = min(load, need)
        if unloaded > 0.0:
            # One of the two is used up; what is left of the other is seldom so little that it is rounding.
            if 0.0 < max(load, need) - unloaded < arrays.terms[p].crumb:
                earned += unload(arrays, episodes, b, i, action, k, unloaded)
            else:
                episodes.load[b, i, k], episodes.need[b, action, k] = load - unloaded, need - unloaded
                earned += earned_by(arrays, p, action, unloaded)
                if has_bonus(arrays, p):
                    earned += bonus_of(arrays, p, action, k, need, unloaded)
    if decays(arrays, p):
        earned *= discount(arrays, p, episodes.clock[b, i] - arrays.areas[p, action].service)
    episodes.satisfaction[b] += earned
    return earned - cost_of(arrays, p, d)


@compiled
def earned_now(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int, unloaded: float) -> float:
    """Satisfaction that an allowed visit of UAV `i` to target `j` would bring now (rule 5).

    `unloaded` is what it would unload, all materials together.
    """
    p = episodes.problem[b]
    earned = earned_by(arrays, p, j, unloaded)
    if has_bonus(arrays, p):
        for k in range(episodes.load.shape[2]):
            need = episodes.need[b, j, k]
            earned += bonus_of(arrays, p, j, k, need, min(episodes.load[b, i, k], need))
    if decays(arrays, p):
        at = episodes.at[b, i]
        arrival = episodes.clock[b, i] + leg_time(arrays, p, i, at, j, leg(arrays, p, i, at, j))
        earned *= discount(arrays, p, begin_after(arrays, p, j, arrival))
    return earned


@compiled
def reload(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int) -> float:
    """Land UAV `i` at base `j`, let it reload, and return what that earns, 0 or less (section 9)."""
    p, d = episodes.problem[b], j - arrays.need.shape[1] - 1
    length = fly_to_base(arrays, episodes, b, i, j)
    for k in range(episodes.load.shape[2]):
        loaded = loaded_of(episodes.load[b, i, k], arrays.full[p, i, k], episodes.stock[b, d, k])
        episodes.load[b, i, k] += loaded
        episodes.stock[b, d, k] -= loaded
    return -cost_of(arrays, p, length)


@compiled
def fly_to_base(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int) -> float:
    """Take UAV `i` to base `j` and through its turnaround; return the leg's length."""
    p, at = episodes.problem[b], episodes.at[b, i]
    length = leg(arrays, p, i, at, j)
    arrival = episodes.clock[b, i] + leg_time(arrays, p, i, at, j, length)
    episodes.clock[b, i] = departure_after(arrays, p, j, arrival)
    episodes.flown[b, i], episodes.aloft[b, i] = 0.0, 0.0
    episodes.at[b, i] = j
    episodes.visits[b, i] += 1
    episodes.distance[b] += length
    return length


@merged
def fly_to(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int) -> float:
    """Take UAV `i` to target `j` and through its service time (rules 1 and 3); return the leg's length."""
    p, at, clock = episodes.problem[b], episodes.at[b, i], episodes.clock[b, i]
    length = leg(arrays, p, i, at, j)
    time = leg_time(arrays, p, i, at, j, length)
    end = departure_after(arrays, p, j, clock + time)
    if is_watched(arrays, p, i):
        episodes.aloft[b, i] = aloft_after(
            arrays, p, i, at, episodes.aloft[b, i], clock, clock + time, end, j
        )
    episodes.clock[b, i] = end
    episodes.flown[b, i] += air_length(arrays, p, i, length, time)
    episodes.at[b, i] = j
    episodes.visits[b, i] += 1
    episodes.distance[b] += length
    for w in range(episodes.kept.shape[2]):
        if arrays.before[p, i, w] == j:
            episodes.kept[b, i, w] = True
    return length


@merged
def unload(arrays: ProblemArrays, episodes: Episodes, b: int, i: int, j: int, k: int, amount: float) -> float:
    """Unload an amount of material `k`, and return what it earns (rules 4 and 5)."""
    p, need = episodes.problem[b], episodes.need[b, j, k]
    episodes.load[b, i, k] = left_of(episodes.load[b, i, k], amount, most_carried(arrays, p, i, k))
    episodes.need[b, j, k] = left_of(need, amount, arrays.requested[p, j, k])
    earned = earned_by(arrays, p, j, amount)
    return earned + bonus_of(arrays, p, j, k, need, amount) if has_bonus(arrays, p) else earned


@compiled
def end_step(arrays: ProblemArrays, episodes: Episodes, b: int) -> float:
    """Close a decision step, and the episode with it when nothing more can be earned.

    An episode is over when all UAVs have returned, no UAV has an allowed visit or reload left, or S steps are
    closed.
    Then every UAV that is still out flies home.

    Returns
    -------
    float
        What the end costs, 0 or less: the legs home, the makespan and changes.
    """
    episodes.step[b] += 1
    p = episodes.problem[b]
    if episodes.step[b] < arrays.max_steps[p] and any_allowed(arrays, episodes, b):
        return 0.0
    episodes.done[b] = True
    return close(arrays, episodes, b)


@compiled
def close(arrays: ProblemArrays, episodes: Episodes, b: int) -> float:
    """Let every UAV that is still out fly home, and return what the end costs, 0 or less (section 10)."""
    charged = 0.0
    for i in range(episodes.ret.shape[1]):
        charged += act(arrays, episodes, b, i, arrays.need.shape[1])
    p = episodes.problem[b]
    if has_closing_cost(arrays, p):
        charged -= closing_cost(arrays, p, makespan_of(arrays, episodes, b), changes_of(arrays, episodes, b))
    return charged


@compiled
def makespan_of(arrays: ProblemArrays, episodes: Episodes, b: int) -> float:
    """Time until the last UAV with a visit has landed, if those that are out fly home now; 0 without any."""
    makespan, p = 0.0, episodes.problem[b]
    for i in range(episodes.ret.shape[1]):
        if episodes.visits[b, i] > 0:
            makespan = max(makespan, episodes.clock[b, i] + time_home(arrays, p, i, episodes.at[b, i]))
    return makespan


@compiled
def changes_of(arrays: ProblemArrays, episodes: Episodes, b: int) -> float:
    """Pairs of UAV and target that are visited in ``start_plan`` and were not here."""
    changes, p = 0.0, episodes.problem[b]
    for i in range(episodes.kept.shape[1]):
        for w in range(episodes.kept.shape[2]):
            if arrays.before[p, i, w] != NONE and not episodes.kept[b, i, w]:
                changes += 1.0
    return changes


@compiled
def any_allowed(arrays: ProblemArrays, episodes: Episodes, b: int) -> bool:
    """Whether any UAV has an allowed visit, or reload, now."""
    home = episodes.need.shape[1]
    for i in range(episodes.ret.shape[1]):
        for j in range(home + 1 + episodes.stock.shape[1]):
            if j != home and verdict(arrays, episodes, b, i, j) == ALLOWED:
                return True
    return False


@compiled
def allowed_actions(arrays: ProblemArrays, episodes: Episodes, out: Flags) -> None:
    """Fill the masks of visits at this moment: home is always allowed, a visit as :func:`verdict` says.

    Parameters
    ----------
    arrays, episodes
        As everywhere.
    out
        (B, M, N+1), overwritten.
    """
    n = episodes.need.shape[1]
    for b in range(out.shape[0]):
        for i in range(out.shape[1]):
            for j in range(n):
                out[b, i, j] = verdict(arrays, episodes, b, i, j) == ALLOWED
            out[b, i, n] = True
