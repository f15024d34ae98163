"""Replaying whole plans: what they earn, or the first action that is not allowed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import TOLERANCE
from app.simulation.amounts import Amounts
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import (
    act,
    changes_of,
    close,
    fly_to,
    fly_to_base,
    makespan_of,
    reach_verdict,
    reset_one,
    unload,
    verdict,
)
from app.simulation.visit import (
    ALLOWED,
    NO_SUCH_ACTION,
    NOT_IN_STOCK,
    RETURNING,
    TOO_HEAVY,
    TOO_MANY_STEPS,
    TOO_MUCH,
    UNLOADS_NOTHING,
    farthest,
    most_carried,
)
from app.simulation.worth import closing_cost, has_closing_cost


class Replay(NamedTuple):
    """What B plans earn; where ``rule`` is not 0, the first action that is not allowed.

    Attributes
    ----------
    reward, satisfaction, distance, makespan, changes
        (B,) up to the first action that is not allowed.
    rule, step, uav
        (B,) the rule it breaks (0 for a legal plan), its step and UAV, counted from 0.
    """

    reward: Floats
    satisfaction: Floats
    distance: Floats
    makespan: Floats
    changes: Floats
    rule: Integers
    step: Integers
    uav: Integers


def replay(arrays: ProblemArrays, plans: Integers, problem: Integers) -> Replay:
    """Replay B plans and compute their rewards (section 4).

    Parameters
    ----------
    arrays
        The stack of problems.
    plans
        (B, S, M) actions.
    problem
        (B,) each plan's problem in the stack.
    """
    none = np.empty((0, 0, 0, 0))
    return _replay(arrays, plans, problem, none, none)


def replay_with(arrays: ProblemArrays, plan: Integers, amounts: Amounts) -> Replay:
    """Replay a plan of the first problem of a stack whose amounts are given (sections 3a and 9).

    Parameters
    ----------
    arrays
        The stack of problems.
    plan
        (S, M) actions.
    amounts
        What every visit unloads and, where that is planned, what every reload takes.
    """
    loaded = amounts.loaded[None] if arrays.terms["plans_loading"][0] else np.empty((0, 0, 0, 0))
    return _replay(arrays, plan[None], np.zeros(1, np.int64), amounts.delivered[None], loaded)


@njit(cache=True, error_model="numpy")
def _replay(
    arrays: ProblemArrays, plans: Integers, problem: Integers, delivered: Floats, loaded: Floats
) -> Replay:
    """Replay plans: those of the first problem, with what stops unload and take, where it is given."""
    batch, steps, m = plans.shape
    n, k = arrays.need.shape[1], arrays.need.shape[2]
    planned, loading = delivered.shape[0] > 0, loaded.shape[0] > 0
    result = Replay(
        np.zeros(batch), np.zeros(batch), np.zeros(batch), np.zeros(batch), np.zeros(batch),
        np.zeros(batch, np.int64), np.zeros(batch, np.int64), np.zeros(batch, np.int64),
    )  # fmt: skip
    # One episode's worth of state serves the whole batch: it stays in the processor's cache.
    state = Episodes(
        np.zeros(1, np.int64), np.empty((1, m), np.int64), np.empty((1, m)), np.empty((1, m)),
        np.empty((1, m)), np.empty((1, m), np.int64), np.empty((1, m), np.bool_), np.empty((1, m, k)),
        np.empty((1, arrays.stock.shape[1], k)), np.empty((1, n, k)),
        np.empty((1, m, arrays.before.shape[2]), np.bool_),
        np.empty(1), np.empty(1), np.empty(1, np.int64), np.empty(1, np.bool_),
    )  # fmt: skip
    for b in range(batch):
        state.problem[0] = problem[b]
        reset_one(arrays, state, 0)
        rule = TOO_MANY_STEPS if steps > arrays.max_steps[problem[b]] else ALLOWED
        s = 0
        while rule == ALLOWED and s < steps:
            for i in range(m):
                action = plans[b, s, i]
                if action < 0 or action > n + arrays.stock.shape[1]:
                    rule = NO_SUCH_ACTION
                elif action < n and planned:
                    rule = delivery_verdict(arrays, state, i, action, delivered[b], s)
                elif action > n and loading:
                    rule = load_verdict(arrays, state, i, action, loaded[b], s)
                elif action != n:
                    rule = verdict(arrays, state, 0, i, action)
                if rule != ALLOWED:
                    result.step[b], result.uav[b] = s, i
                    break
                if planned and action < n:
                    deliver(arrays, state, i, action, delivered[b], s)
                elif loading and action > n:
                    load(arrays, state, i, action, loaded[b], s)
                else:
                    act(arrays, state, 0, i, action)
            s += 1
        if rule == ALLOWED:
            close(arrays, state, 0)
        result.rule[b] = rule
        result.satisfaction[b], result.distance[b] = state.satisfaction[0], state.distance[0]
        result.reward[b] = state.satisfaction[0] - arrays.terms[problem[b]].weight * state.distance[0]
        result.makespan[b] = makespan_of(arrays, state, 0)
        result.changes[b] = changes_of(arrays, state, 0)
        if has_closing_cost(arrays, problem[b]):
            result.reward[b] -= closing_cost(arrays, problem[b], result.makespan[b], result.changes[b])
    return result


@compiled
def delivery_verdict(
    arrays: ProblemArrays, episodes: Episodes, i: int, j: int, delivered: Floats, s: int
) -> int:
    """As :func:`verdict` for episode 0, where the visit of step `s` is to unload ``delivered[s, i]``."""
    if episodes.ret[0, i]:
        return RETURNING
    useful = False
    for k in range(delivered.shape[2]):
        amount = delivered[s, i, k]
        whole = most_carried(arrays, 0, i, k)
        if not 0.0 <= amount <= (1.0 + TOLERANCE) * min(whole, arrays.need[0, j, k]):
            return TOO_MUCH
        # Amounts that add up to all there is may exceed it by their rounding.
        if (
            amount > episodes.load[0, i, k] + TOLERANCE * whole
            or amount > episodes.need[0, j, k] + TOLERANCE * arrays.need[0, j, k]
        ):
            return TOO_MUCH
        useful = useful or amount > 0.0
    return reach_verdict(arrays, episodes, 0, i, j) if useful else UNLOADS_NOTHING


@compiled
def deliver(arrays: ProblemArrays, episodes: Episodes, i: int, j: int, delivered: Floats, s: int) -> None:
    """Let UAV `i` of episode 0 make the allowed visit of step `s`, which unloads ``delivered[s, i]``."""
    fly_to(arrays, episodes, 0, i, j)
    for k in range(delivered.shape[2]):
        if delivered[s, i, k] > 0.0:
            episodes.satisfaction[0] += unload(arrays, episodes, 0, i, j, k, delivered[s, i, k])


@compiled
def load_verdict(arrays: ProblemArrays, episodes: Episodes, i: int, j: int, loaded: Floats, s: int) -> int:
    """As :func:`verdict` for episode 0, where the reload of step `s` is to take ``loaded[s, i]``."""
    if episodes.ret[0, i]:
        return RETURNING
    d, weight = j - arrays.need.shape[1] - 1, 0.0
    for k in range(loaded.shape[2]):
        amount, stock = loaded[s, i, k], episodes.stock[0, d, k]
        whole = max(most_carried(arrays, 0, i, k), arrays.stock[0, d, k])
        if amount > stock and amount - stock > TOLERANCE * whole:
            return NOT_IN_STOCK
        if amount < 0.0 and -amount - episodes.load[0, i, k] > TOLERANCE * most_carried(arrays, 0, i, k):
            return TOO_MUCH
        weight += arrays.weights[0, k] * (episodes.load[0, i, k] + amount)
    if weight > farthest(arrays.uavs[0, i].capacity):
        return TOO_HEAVY
    return reach_verdict(arrays, episodes, 0, i, j)


@compiled
def load(arrays: ProblemArrays, episodes: Episodes, i: int, j: int, loaded: Floats, s: int) -> None:
    """Let UAV `i` of episode 0 make the allowed reload of step `s`, which takes ``loaded[s, i]``."""
    d = j - arrays.need.shape[1] - 1
    fly_to_base(arrays, episodes, 0, i, j)
    for k in range(loaded.shape[2]):
        amount = loaded[s, i, k]
        episodes.load[0, i, k] = max(0.0, episodes.load[0, i, k] + amount)
        episodes.stock[0, d, k] = max(0.0, episodes.stock[0, d, k] - amount)
