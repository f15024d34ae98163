"""Several episodes of one problem: in other orders of UAVs where a policy needs one, otherwise sampled."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.learning.universal.episodes.played import AnySizePolicy
from app.learning.universal.episodes.turn_order import reorder, restore_plans, some_orders
from app.simulation.arrays import Integers, ProblemArrays
from app.solvers.protocol import StopCriterion, no_spare_threads
from app.solvers.stop import never

_COOL = 0.7
"""Temperature of roll-outs beside the greedy one: good ones that differ."""


def roll_outs(
    policy: AnySizePolicy,
    arrays: ProblemArrays,
    count: int,
    rng: np.random.Generator,
    stop: StopCriterion = never,
    spare: Callable[[], int] = no_spare_threads,
) -> Integers:
    """Play one problem as well as a policy can, in several ways; return plans (B, S, M).

    A policy whose UAVs take turns is rolled out greedily in `count` orders of them; one that decides who acts
    first once greedily, and sampled at a low temperature beside. A plan of other orders may not be allowed:
    where two UAVs are at one target in the same step, the simulator lets them act by their index. So replay
    the plans.

    Parameters
    ----------
    policy, stop, spare
        As :class:`~app.learning.universal.episodes.played.AnySizePolicy` has them.
    arrays
        A stack of one problem.
    count
        Roll-outs, at least 1; with one UAV, orders are the same.
    rng
        Draws orders, or samples.
    """
    if policy.takes_turns:
        orders = some_orders(count, arrays.shape[0], rng)
        return _in_orders(policy, arrays, orders, 1, None, stop, spare)
    plans = policy.play(arrays, np.zeros(1, np.int64), stop=stop, spare=spare).plans
    if count == 1 or stop():
        return plans
    beside = policy.play(arrays, np.zeros(count - 1, np.int64), rng, _COOL, stop, spare).plans
    return np.concatenate((plans, beside))


def samples(
    policy: AnySizePolicy,
    arrays: ProblemArrays,
    count: int,
    orders: int,
    rng: np.random.Generator,
    stop: StopCriterion = never,
    spare: Callable[[], int] = no_spare_threads,
) -> Integers:
    """Sample episodes of one problem, in up to so many orders of its UAVs; return plans (count, S, M).

    See :func:`roll_outs` for the parameters, and for plans that are not allowed.
    """
    if not policy.takes_turns:
        return policy.play(arrays, np.zeros(count, np.int64), rng, stop=stop, spare=spare).plans
    chosen = some_orders(max(1, min(count, orders)), arrays.shape[0], rng)
    repeats = -(-count // len(chosen))
    return _in_orders(policy, arrays, chosen, repeats, rng, stop, spare)[:count]


def _in_orders(
    policy: AnySizePolicy,
    arrays: ProblemArrays,
    orders: Integers,
    repeats: int,
    rng: np.random.Generator | None,
    stop: StopCriterion,
    spare: Callable[[], int],
) -> Integers:
    """Play one problem with its UAVs taking turns in orders (Q, M); return plans (Q * repeats, S, M)."""
    count = len(orders)
    several = ProblemArrays(
        **{name: np.repeat(column, count, axis=0) for name, column in arrays._asdict().items()}
    )
    episodes = np.repeat(np.arange(count), repeats)
    played = policy.play(reorder(several, orders), episodes, rng, stop=stop, spare=spare)
    return restore_plans(played.plans, orders[episodes])
