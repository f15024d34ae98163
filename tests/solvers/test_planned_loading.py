"""Search for plans whose loads are planned: what it keeps count of, and the best plan of tiny problems."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from loading_program import best_by_program
from referee import Illegal, replay
from referee_legs import Legs
from worlds import random_loading

from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.domain.surroundings import Base, Material
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.planned_amounts import amounts_are_exact
from app.simulation.simulator import new_episodes
from app.solvers.bound.upper_bound import upper_bound
from app.solvers.protocol import SolverContext
from app.solvers.registry import algorithm, create_solver
from app.solvers.stop import Deadline, never
from app.solvers.unloading.annealing import SATISFACTION, anneal_planned, new_planned_search
from app.solvers.unloading.solver import greedily, without_useless


def solve(problem, name="local_search", stop=never, **parameters):
    solver = create_solver(name, algorithm(name).parameter_model()(**parameters), SolverContext())
    return solver.solve(problem, 1, stop, lambda _told: None)


def unplanned(problem):
    """The problem without promises, and without a plan to begin from."""
    objective = replace(problem.objective, change_weight=0.0)
    uavs = tuple(replace(uav, committed=()) for uav in problem.uavs)
    return replace(problem, uavs=uavs, start_plan=None, objective=objective)


def with_all(record, amounts):
    """The record with `amounts` of every material aboard and needed, and no capacity."""
    k = len(record["uavs"][0]["loadlist"])
    uavs = [{**uav, "loadlist": [amounts] * k, "capacity": None} for uav in record["uavs"]]
    targets = [{**t, "loadlist": [amounts] * k, "requested": None} for t in record["targets"]]
    return {**record, "uavs": uavs, "targets": targets}


def best_of_all(record):
    """The largest reward of any choice of routes, with the best amounts for them; None where there are many.

    Which routes are legal whatever they unload the referee says: of a problem in which a crumb will do.
    """
    n, m, s = len(record["targets"]), len(record["uavs"]), record["max_steps"]
    easy, k = with_all(record, 1.0), len(record["uavs"][0]["loadlist"])
    legs = Legs(easy)
    crumbs = [[[1e-6] * k] * m] * s
    nothing = [[[0.0] * k] * m] * s
    own = []
    for i in range(m):
        legal, ends = [()], [()]
        for _ in range(s):
            ends = [(*route, a) for route in ends for a in range(n + 1 + len(record["bases"])) if a != n]
            ends = [route for route in ends if is_legal(easy, legs, i, route, crumbs, nothing)]
            legal += ends
        own.append(legal)
    if not 1 < math.prod(map(len, own)) <= 400:
        return None
    best = -np.inf
    for routes in itertools.product(*own):
        plan = [[r[q] if q < len(r) else n for r in routes] for q in range(max(1, *map(len, routes)))]
        flown = [[[1e-6 * (a < n)] * k for a in row] for row in plan]
        cost = replay(easy, plan, flown, legs, nothing)
        # Without what the crumbs earn, and with what the best amounts do.
        earned = best_by_program(record, plan)
        objective = record["objective"]
        best = max(
            best,
            earned
            - cost["distance_weight"] * cost["distance"]
            - (objective.get("makespan_weight") or 0.0) * cost["makespan"]
            - (objective.get("change_weight") or 0.0) * cost["changes"],
        )
    return best


def is_legal(record, legs, i, route, delivered, loaded):
    n, m = len(record["targets"]), len(record["uavs"])
    rows = [[a if who == i else n for who in range(m)] for a in route]
    try:
        replay(record, rows, delivered, legs, loaded)
    except Illegal:
        return False
    return True


@pytest.fixture(scope="module")
def tiny():
    """Some problems, each with the reward of its best plan."""
    rng, found = np.random.default_rng(21), []
    while len(found) < 12:
        problem = unplanned(random_loading(rng, 2, 3))
        problem = replace(problem, max_steps=min(problem.max_steps, 3))
        # With matrices a visit that unloads nothing may shorten the way.
        if problem.plans_loading and problem.matrices is None:
            best = best_of_all(problem_to_record(problem))
            if best is not None:
                found.append((problem, best))
    return found


@pytest.mark.parametrize("name", ["local_search", "exact", "auto"])
def test_the_best_plan_of_tiny_problems_is_found_and_proven(name, tiny):
    for problem, best in tiny:
        solution = solve(problem, name)
        reward = reward_of(problem, solution.plan)
        assert reward == pytest.approx(best, rel=1e-7, abs=1e-7)
        assert solution.proof is None or solution.proof.bound >= best - 1e-7
        assert upper_bound(problem, None, Deadline(0.1)).value >= best - 1e-7


def test_the_search_keeps_count_of_what_its_plan_earns():
    rng = np.random.default_rng(5)
    compared = 0
    for _ in range(40):
        problem = unplanned(random_loading(rng))
        arrays = compile_problem(problem)
        search = new_planned_search(arrays, Plan.empty(problem.n_uavs, problem.n_targets).as_array())
        near = search.search.near
        if not len(near.active) or not len(near.wanted) or new_episodes(arrays, 1).done[0]:
            continue
        anneal_planned(search, rng, 1.0, 0.1, 500, 1e9, 0.3)
        routes = search.search.routes
        now = np.full((problem.max_steps, problem.n_uavs), problem.n_targets)
        for i, length in enumerate(routes.length):
            now[:length, i] = routes.target[i, :length]
        anew = new_planned_search(arrays, now)
        assert search.tally[SATISFACTION] == pytest.approx(anew.tally[SATISFACTION], rel=1e-9, abs=1e-9)
        if amounts_are_exact(arrays):
            # The program finds at least as much.
            earned = best_by_program(problem_to_record(problem), now.tolist(), not problem.plans_loading)
            assert search.tally[SATISFACTION] <= earned + 1e-9
            compared += 1
    assert compared > 10


def test_empty_uavs_at_a_base_are_one_request():
    rng = np.random.default_rng(2)
    villages = tuple(
        Target(f"village-{j}", *rng.uniform(-1, 1, 2).tolist(), 1.0, tuple(map(float, rng.integers(0, 5, 2))))
        for j in range(8)
    )
    problem = Problem(
        uavs=tuple(UAV(f"u{i}", 0, 0, 0, 0, 1.0, 3.0, (0.0, 0.0), capacity=3.0) for i in range(2)),
        targets=villages,
        bases=(Base("base-1", 0, 0),),
        materials=(Material("water", 1.0), Material("medicine", 0.25)),
        objective=Objective(distance_weight=0.05, unloading="planned", loading="planned"),
        max_steps=12,
    )
    mixed = greedily(problem)
    weight = np.array([1.0, 0.25]) @ np.array(mixed.uavs[0].full_load)
    assert weight == pytest.approx(3.0)
    reward = reward_of(problem, solve(problem, stop=Deadline(1.0)).plan)
    assert reward > 1.01 * reward_of(mixed, solve(mixed, stop=Deadline(1.0)).plan)


def test_what_is_of_no_use_goes():
    problem = Problem(
        uavs=(UAV("u1", 0, 0, 0, 0, 1.0, 10.0, (1.0,)),),
        targets=(Target("a", 1, 0, 1.0, (1.0,)), Target("b", 2, 0, 1.0, (1.0,))),
        bases=(Base("base-1", 0, 0, stock=(0.0,)), Base("base-2", 1, 0)),
        objective=Objective(distance_weight=0.1, unloading="planned", loading="planned"),
        max_steps=5,
    )
    # The second flight finds nothing in stock, and the last reload has no flight.
    plan = without_useless(compile_problem(problem), np.array([[0], [3], [1], [4], [2]]))
    assert plan[:, 0].tolist() == [0, 2, 2, 2, 2]


def test_a_reload_that_leaves_something_behind_stays():
    problem = Problem(
        uavs=(
            UAV("u1", 0, 0, 0, 0, 1.0, 1.0, (2.0,)),
            UAV("u2", 0, 0, 0, 0, 1.0, 10.0, (0.0,)),
        ),
        targets=(Target("far", 3, 0, 1.0, (2.0,)),),
        bases=(Base("base-1", 0, 0, stock=(0.0,)),),
        objective=Objective(distance_weight=0.01, unloading="planned", loading="planned"),
        max_steps=2,
    )
    solution = solve(problem)
    assert solution.plan.assignment == ((2, 2), (1, 0))
    assert solution.proof.proven


def test_what_a_makespan_costs_rules_plans_out():
    # Nothing is worth the time it takes: without that in their bounds thousands of plans are evaluated.
    rng = np.random.default_rng(7)
    targets = tuple(Target(f"a{j}", *rng.uniform(1, 5, 2).tolist(), 1.0, (2.0, 2.0, 2.0)) for j in range(3))
    problem = Problem(
        uavs=tuple(UAV(f"u{i}", i, 0, i, 0, 1.0, 30.0, (1.0, 0.5, 2.0)) for i in range(2)),
        targets=targets,
        bases=tuple(Base(f"base-{d}", d, 1, stock=(9.0, d, 9.0)) for d in range(2)),
        objective=Objective(0.01, unloading="planned", loading="planned", makespan_weight=20.0),
        max_steps=4,
    )
    solution = solve(problem, "greedy")
    assert solution.plan == Plan.empty(2, 3)
    assert solution.proof.proven
