"""The order in which UAVs take their turns: a symmetry of the problem that the policy does not have.

The UAV that acts first commits first, so the same policy flies another plan when the same UAVs are numbered
in another order. Roll-outs in several orders are several chances; a demonstration holds in every order.
"""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import OF_UAVS, Integers, ProblemArrays


def draw_orders(problems: int, n_uavs: int, rng: np.random.Generator) -> Integers:
    """Draw random orders (P, M): entry i is the UAV that acts as number i."""
    return rng.permuted(np.tile(np.arange(n_uavs), (problems, 1)), axis=1)


def some_orders(count: int, n_uavs: int, rng: np.random.Generator) -> Integers:
    """Return at most `count` orders (Q, M) to roll a policy out in: that of the indices, then random ones."""
    orders = draw_orders(count, n_uavs, rng)
    orders[0] = np.arange(n_uavs)
    return orders[: 1 if n_uavs == 1 else count]


def reorder(arrays: ProblemArrays, orders: Integers) -> ProblemArrays:
    """Number the UAVs of a stack of P problems by their orders (P, M)."""
    columns = arrays._asdict()
    for name in OF_UAVS:
        column = columns[name]
        places = orders.reshape(*orders.shape, *(1,) * (column.ndim - 2))
        columns[name] = np.take_along_axis(column, places, axis=1)
    return ProblemArrays(**columns)


def reorder_plans(plans: Integers, orders: Integers) -> Integers:
    """Number the UAVs of plans (B, S, M) by their orders (B, M)."""
    return np.take_along_axis(plans, orders[:, None, :], axis=2)


def restore_plans(plans: Integers, orders: Integers) -> Integers:
    """Take back what :func:`reorder_plans` did."""
    return reorder_plans(plans, np.argsort(orders, axis=1))
