"""A problem as the bounds see it: deliveries as shares of a need, rewards in units of the largest level."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import Problem
from app.simulation.arrays import Flags, Floats, ProblemArrays, compile_problem
from app.simulation.worth import worth_by_material
from app.solvers.scale import largest_level

_DIGITS = 2.0**38
"""Precision of levels and prices here: coarser than rounding errors, finer than the margin of the bounds."""


class Instance(NamedTuple):
    """One problem, scaled.

    Attributes
    ----------
    arrays
        A stack of one problem, as the simulator has it.
    scale
        Reward that one unit stands for here, > 0.
    worth
        (N, K) what meeting the whole need of a material at a target earns at most.
    need
        (N, K) amounts needed.
    load
        (M, K) amounts that a UAV may bring in all: what it carries, and what it may load at bases.
    price
        Cost of a unit of distance, λ / scale.
    idle
        (M,) what a UAV earns that visits nothing: 0, or less where its way home is charged.
    exact
        Whether the relaxation has every rule there is; otherwise its optimum need not be reached.
    useful
        (M, N) targets at which a UAV that does not return could unload something.
    """

    arrays: ProblemArrays
    scale: float
    worth: Floats
    need: Floats
    load: Floats
    price: float
    idle: Floats
    exact: bool
    useful: Flags


def new_instance(problem: Problem) -> Instance:
    """Scale a problem."""
    arrays = compile_problem(problem)
    need, load = arrays.need[0], _brought(arrays)
    wanted = arrays.areas["need_total"][0] > 0
    scale = largest_level(arrays)
    if arrays.terms["bonus"][0] == 0.0:
        earned = rounded(arrays.areas["level"][0] / scale)
        worth = earned[:, None] * (need / np.where(wanted, arrays.areas["need_total"][0], 1.0)[:, None])
    else:
        worth = rounded(worth_by_material(arrays) / scale)
    price = float(rounded(arrays.terms["weight"] / scale)[0])
    out = ~arrays.ret[0]
    charged = out & bool(arrays.terms["charge_return"][0])
    # As a product of matrices: with many materials much quicker than comparing each with each.
    useful = out[:, None] & ((load > 0).astype(np.float32) @ (need > 0).astype(np.float32).T > 0)
    idle = np.where(charged, -price * arrays.uavs["start_home"][0], 0.0)
    return Instance(arrays, scale, worth, need, load, price, idle, _is_exact(arrays), useful)


def _brought(arrays: ProblemArrays) -> Floats:
    """Return the amounts that each UAV may bring in all, (M, K); no reload follows another."""
    if not arrays.n_bases:
        return arrays.load[0]
    reloads = (int(arrays.max_steps[0]) + 1) // 2
    return arrays.load[0] + np.minimum(reloads * arrays.full[0], arrays.stock[0].sum(axis=0))


def _is_exact(arrays: ProblemArrays) -> bool:
    terms, uavs = arrays.terms[0], arrays.uavs[0]
    left_out = (
        arrays.n_bases
        or terms["decay"]
        or terms["bonus"]
        or terms["makespan"]
        or terms["change"]
        or terms["timed"]
    )
    waits = arrays.areas["earliest"][0].any() or uavs["watched"].any() or arrays.committed.size
    return not (left_out or waits or not terms["metric"])


def rounded(values: Floats) -> Floats:
    """Round numbers to :data:`_DIGITS`: then the unit in which levels were given leaves no trace."""
    fraction, exponent = np.frexp(values)
    return np.ldexp(np.round(fraction * _DIGITS) / _DIGITS, exponent)


def ceiling(instance: Instance) -> float:
    """Bound the reward of any plan, in the instance's scale, by what meeting every need would earn."""
    most = float(instance.worth.sum())
    return safely(most, most)


def safely(value: float, magnitude: float) -> float:
    """Round a sum of at most some 10^7 terms of a total `magnitude` up by more than its rounding error."""
    return value + 1e-9 * magnitude
