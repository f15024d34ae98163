"""Levels, and what distance costs, in another unit: the same plans, but of networks, which have 24 bits."""

from dataclasses import replace

import numpy as np
import pytest

from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.local_search.annealing import new_search, set_routes
from app.solvers.local_search.temperatures import coldest_by_distance, gains, neighbour_leg
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
    for unit in (2.0**-43, 2.0**39):
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


def test_temperatures_follow_what_visits_earn_not_what_areas_are_worth():
    """Loads of a hundredth of every need, and one visit that earns much more than the others."""
    problem = generate("uniform", 6, 12, 2, np.random.default_rng(5))
    targets = tuple(replace(t, level=1.0, loadlist=(200.0, 200.0)) for t in problem.targets)
    uavs = tuple(replace(uav, loadlist=(2.0, 2.0), voyage=9.0) for uav in problem.uavs)
    arrays = compile_problem(replace(problem, targets=targets, uavs=uavs))
    search = new_search(arrays)
    assert gains(arrays, search.routes) == (largest_level(arrays), common_level(arrays))
    set_routes(search, np.array([[0, 1, 2, 3, 4, 5]]))
    assert gains(arrays, search.routes) == pytest.approx((0.01, 0.01))
    targets = (replace(targets[0], level=100.0), *targets[1:])
    arrays = compile_problem(replace(problem, targets=targets, uavs=uavs))
    search = new_search(arrays)
    set_routes(search, np.array([[0, 1, 2, 3, 4, 5]]))
    largest, common = gains(arrays, search.routes)
    assert largest == pytest.approx(1.0)
    assert 0.01 < common < 0.1


def test_a_search_ends_where_distances_are_decided_on():
    problem = generate("uniform", 4, 30, 2, np.random.default_rng(5))
    arrays = compile_problem(in_unit(problem, 1.0, 0.5))
    leg = neighbour_leg(arrays, new_search(arrays).near)
    assert 0.05 < leg < 0.3
    assert coldest_by_distance(arrays, leg, 5.0) == pytest.approx(0.01 * leg)
    assert coldest_by_distance(arrays, leg, 1e-6) == 1e-6
    free = compile_problem(in_unit(problem, 1.0, 0.0))
    assert coldest_by_distance(free, leg, 5.0) == 5.0
