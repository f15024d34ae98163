"""States of known plans, as the policy meets them when it plays: what was seen, and what each UAV did."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.pairwise.gains import (
    Gains,
    begin_step,
    in_order,
    look,
    look_again,
    look_at,
    nearness,
    new_gains,
)
from app.learning.pairwise.observation import observe
from app.learning.pairwise.rollout import send_idle
from app.learning.pairwise.seen import Seen, new_seen
from app.learning.universal.episodes.observation import FORBIDDEN
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes, copy_episode
from app.simulation.simulator import act, end_step, new_episodes

UNKNOWN = -1
"""In place of an action: the UAV has acted, has no choice, or did what cannot be done in this state."""


class States(NamedTuple):
    """T states of one problem of M UAVs.

    Attributes
    ----------
    seen
        What is seen of them.
    action
        (T, M) what each UAV does in the plan, or ``UNKNOWN``.
    distance
        (N+D, N+D) between places, in spans.
    """

    seen: Seen
    action: Integers
    distance: Float32s


class Turns(NamedTuple):
    """Every decision of a plan, in the order of the simulator; one UAV's action is known in each state.

    Attributes
    ----------
    states
        T of them.
    step, uav
        (T,) when, and who acted.
    reward
        (S,) what each step earned, as a share of the levels of all areas that need something.
    """

    states: States
    step: Integers
    uav: Integers
    reward: Floats


def some_states(
    arrays: ProblemArrays, plan: Integers, count: int, rng: np.random.Generator, first: int = 0
) -> States:
    """Draw states of a plan: some UAVs of a step have acted already, any of them.

    Parameters
    ----------
    arrays
        A stack of one problem.
    plan
        (S, M), allowed.
    count
        Most states, at least 1; at most two a step.
    rng
        Draws steps, and who has acted.
    first
        Steps before this one are not drawn.
    """
    m, n, _ = arrays.shape
    used = np.flatnonzero((plan != n).any(axis=1))
    last = min(len(plan), used[-1] + 2 if len(used) else 1)
    steps = np.arange(min(first, last - 1), last)
    count = min(count, 2 * len(steps))
    chosen = np.sort(rng.choice(steps, count))
    orders = rng.permuted(np.tile(np.arange(m), (count, 1)), axis=1)
    before = (rng.random(count) * m).astype(np.int64)
    before[rng.random(count) < _BEGINNINGS] = 0
    episodes, gains = new_episodes(arrays, 2), new_gains(arrays, 2)
    seen, action = new_seen(count, arrays), np.full((count, m), UNKNOWN, np.int64)
    found = _some_states(arrays, episodes, gains, plan, chosen, orders, before, seen, action)
    return States(Seen(*(part[:found] for part in seen)), action[:found], nearness(arrays, gains.span)[0])


_BEGINNINGS = 0.2
"""Share of the states in which nobody has acted in the step."""


def all_turns(arrays: ProblemArrays, plan: Integers) -> Turns:
    """Replay an allowed plan (S, M) of a stack of one problem, and write down every decision."""
    m = arrays.shape[0]
    episodes, gains = new_episodes(arrays, 1), new_gains(arrays, 1)
    seen = new_seen(plan.size, arrays)
    action, step, uav = (np.zeros(plan.size, np.int64) for _ in range(3))
    reward = np.zeros(len(plan))
    found = _all_turns(arrays, episodes, gains, plan, seen, action, step, uav, reward)
    actions = np.full((found, m), UNKNOWN, np.int64)
    actions[np.arange(found), uav[:found]] = action[:found]
    states = States(Seen(*(part[:found] for part in seen)), actions, nearness(arrays, gains.span)[0])
    return Turns(states, step[:found], uav[:found], reward / _all_levels(arrays))


def _all_levels(arrays: ProblemArrays) -> float:
    """Return the sum of the levels of all areas that need something; never 0."""
    levels = float(arrays.areas["level"][0][arrays.areas["need_total"][0] > 0].sum())
    return levels if levels > 0 else 1.0


@compiled
def _may(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int, action: int) -> bool:
    """Whether an action is allowed, also in the order of a plan."""
    n = gains.net.shape[2]
    if action == n:
        return True
    if not in_order(arrays, episodes, gains, b, i, action):
        return False
    return gains.net[b, i, action] > FORBIDDEN if action < n else gains.reloads[b, i, action - n - 1]


@compiled
def _has_choice(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, i: int) -> bool:
    n = gains.net.shape[2]
    found = False
    for action in range(n + 1 + gains.reloads.shape[2]):
        found |= action != n and _may(arrays, episodes, gains, b, i, action)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _some_states(
    arrays: ProblemArrays,
    episodes: Episodes,
    gains: Gains,
    plan: Integers,
    steps: Integers,
    orders: Integers,
    before: Integers,
    seen: Seen,
    actions: Integers,
) -> int:
    """Fly a plan in episode 0, and branch off episode 1 for every state that is wanted; return how many."""
    m = plan.shape[1]
    joint = np.empty(m, np.int64)
    look(arrays, episodes, gains)
    found = 0
    for s in range(plan.shape[0]):
        if episodes.done[0]:
            break
        for q in range(len(steps)):
            if steps[q] != s:
                continue
            copy_episode(episodes, 0, episodes, 1)
            begin_step(episodes, gains, 1)
            acts = np.zeros(m, np.bool_)
            count = 0
            for i in range(m):
                look_at(arrays, episodes, gains, 1, i)
            send_idle(arrays, episodes, gains, 1, joint)
            for i in orders[q]:
                if not episodes.ret[1, i] and count < before[q]:
                    acts[i] = True
                    count += 1
            for i in range(m):
                # Without those that have not acted, a visit may be no longer what it is in the plan.
                if acts[i] and _may(arrays, episodes, gains, 1, i, plan[s, i]):
                    act(arrays, episodes, 1, i, plan[s, i])
                    look_again(arrays, episodes, gains, 1, i, plan[s, i])
            send_idle(arrays, episodes, gains, 1, joint)
            known = False
            for i in range(m):
                free = not gains.acted[1, i] and _has_choice(arrays, episodes, gains, 1, i)
                actions[found, i] = (
                    plan[s, i] if free and _may(arrays, episodes, gains, 1, i, plan[s, i]) else UNKNOWN
                )
                known |= actions[found, i] != UNKNOWN
            if known:
                observe(arrays, episodes, gains, 1, seen, found)
                found += 1
        for i in range(m):
            if not episodes.ret[0, i]:
                act(arrays, episodes, 0, i, plan[s, i])
        end_step(arrays, episodes, 0)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _all_turns(
    arrays: ProblemArrays,
    episodes: Episodes,
    gains: Gains,
    plan: Integers,
    seen: Seen,
    action: Integers,
    step: Integers,
    uav: Integers,
    reward: Floats,
) -> int:
    joint = np.empty(plan.shape[1], np.int64)
    look(arrays, episodes, gains)
    found = 0
    for s in range(plan.shape[0]):
        if episodes.done[0]:
            break
        begin_step(episodes, gains, 0)
        for i in range(plan.shape[1]):
            reward[s] += send_idle(arrays, episodes, gains, 0, joint)
            if episodes.ret[0, i]:
                continue
            if _has_choice(arrays, episodes, gains, 0, i):
                observe(arrays, episodes, gains, 0, seen, found)
                action[found], step[found], uav[found] = plan[s, i], s, i
                found += 1
            reward[s] += act(arrays, episodes, 0, i, plan[s, i])
            look_again(arrays, episodes, gains, 0, i, plan[s, i])
        reward[s] += end_step(arrays, episodes, 0)
        for i in range(plan.shape[1]):
            look_at(arrays, episodes, gains, 0, i)
    return found
