"""Levels, and what distance costs, in another unit: the same plans, but of networks, which have 24 bits."""

from dataclasses import replace

import numpy as np
import pytest

from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.scale import common_level, largest_level
from app.solvers.stop import never

QUICK = {
    "greedy": {},
    "ga": {"num_total": 10, "iteration": 20},
    "local_search": {"moves": 20_000, "restarts": 3},
    "auto": {"moves": 20_000, "restarts": 3},
    "exact": {"nodes": 10},
}


def in_unit(problem, unit, weight, unloading="greedy"):
    """The problem with levels and the cost of distance multiplied."""
    targets = tuple(replace(target, level=target.level * unit) for target in problem.targets)
    objective = replace(problem.objective, distance_weight=weight * unit, unloading=unloading)
    return replace(problem, targets=targets, objective=objective)


def plan_of(name, problem):
    solver = create_solver(name, parse_parameters(name, QUICK[name]), SolverContext())
    return solver.solve(problem, 1, never, lambda _told: None).plan


@pytest.mark.parametrize("weight", [0.0, 0.7])
@pytest.mark.parametrize("name", sorted(QUICK))
def test_the_unit_of_the_levels_changes_no_plan(name, weight):
    problem = generate("uniform", 4, 7, 3, np.random.default_rng(3))
    plan = plan_of(name, in_unit(problem, 1.0, weight))
    assert reward_of(in_unit(problem, 1.0, weight), plan) > 0
    for unit in (1e-13, 1e12):
        assert plan_of(name, in_unit(problem, unit, weight)) == plan


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_nor_one_with_planned_unloading(unit):
    problem = generate("scarce", 4, 7, 3, np.random.default_rng(3))
    plan = plan_of("local_search", in_unit(problem, 1.0, 0.5, "planned"))
    assert plan_of("local_search", in_unit(problem, unit, 0.5, "planned")) == plan


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_nor_one_whose_routes_are_combined(unit):
    """Large loads, so that routes are whole and set packing chooses among them."""
    problem = generate("uniform", 4, 14, 2, np.random.default_rng(6))
    uavs = tuple(replace(uav, loadlist=(1000.0, 1000.0)) for uav in problem.uavs)
    problem = replace(problem, uavs=uavs)
    assert plan_of("local_search", in_unit(problem, unit, 0.0)) == plan_of(
        "local_search", in_unit(problem, 1.0, 0.0)
    )


def test_one_level_that_stands_out_is_not_the_common_one():
    problem = generate("uniform", 4, 12, 2, np.random.default_rng(5))
    levels = [5.0, *np.linspace(1.0, 4.0, 11)]
    targets = [replace(t, level=level) for t, level in zip(problem.targets, levels, strict=True)]
    arrays = compile_problem(replace(problem, targets=tuple(targets)))
    assert largest_level(arrays) == common_level(arrays) == 5.0
    targets[0] = replace(targets[0], level=500.0)
    arrays = compile_problem(replace(problem, targets=tuple(targets)))
    assert largest_level(arrays) == 500.0
    assert 4.0 < common_level(arrays) < 20.0
    nothing = [replace(target, level=0.0) for target in targets]
    arrays = compile_problem(replace(problem, targets=tuple(nothing)))
    assert largest_level(arrays) == common_level(arrays) == 1.0
