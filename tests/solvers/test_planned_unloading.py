"""Planned unloading with every algorithm: legal by the referee, never below greedy, best on tiny problems."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from problems import random_problem
from referee import Illegal, replay
from stopping import at_once

from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.explain import explain
from app.simulation.generator import generate
from app.simulation.planned_amounts import best_amounts
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import Deadline, never
from app.solvers.unloading.annealing import anneal_planned, new_planned_search
from app.solvers.unloading.solver import without_useless

QUICK = {
    "greedy": {},
    "ga": {"num_total": 8, "iteration": 10},
    "local_search": {"moves": 3000, "restarts": 1},
    "qmix": {"mode": "paper", "n_epochs": 6, "evaluate_per_epoch": 3, "buffer_size": 4, "batch_size": 4},
}


@pytest.fixture(autouse=True)
def little_work(monkeypatch):
    monkeypatch.setattr("app.solvers.unloading.solver._MOVES_A_VISIT", 400)


def planned(problem):
    return replace(problem, objective=replace(problem.objective, unloading="planned"))


def solve(problem, name="local_search", stop=never, report=lambda progress: None, threads=1):
    solver = create_solver(name, parse_parameters(name, QUICK[name]), SolverContext(threads=threads))
    return solver.solve(problem, 3, stop, report)


def judged(problem, plan):
    """The referee's reward of an answer, from its plan and its amounts alone."""
    answer = explain(problem, plan)
    delivered = np.zeros((len(plan.assignment), problem.n_uavs, problem.n_materials))
    for i, route in enumerate(answer.routes):
        for stop in route.stops:
            delivered[stop.step - 1, i] = stop.delivered
    expected = replay(problem_to_record(problem), plan.assignment, delivered.tolist())
    assert answer.reward == pytest.approx(expected["reward"], rel=1e-9, abs=1e-9)
    for unmet in answer.unmet:
        j = [target.id for target in problem.targets].index(unmet.target_id)
        assert unmet.remaining == pytest.approx(expected["remaining"][j], abs=1e-9)
    return expected["reward"]


@pytest.mark.parametrize("name", QUICK)
def test_every_algorithm_plans_the_unloading_and_loses_nothing_by_it(name):
    rng = np.random.default_rng(17)
    for _ in range(6):
        problem = random_problem(rng, 4, 6)
        greedy = reward_of(problem, solve(problem, name).plan)
        reward = judged(planned(problem), solve(planned(problem), name).plan)
        assert reward >= greedy - 1e-9


def test_a_plan_that_greedy_unloading_cannot_make():
    # The UAV has two units; 'near' on the way takes both, and 'urgent' must be reached by 2.
    problem = Problem(
        uavs=(UAV("u", 0, 0, 0, 0, 1.0, 10.0, (2.0,)),),
        targets=(Target("near", 1, 0, 1.0, (2.0,)), Target("urgent", 2, 0, 10.0, (1.0,), deadline=2.0)),
        objective=Objective(0.1),
    )
    assert reward_of(problem, solve(problem).plan) == pytest.approx(10 + 0.5 - 0.3)
    solution = solve(planned(problem))
    assert solution.plan.assignment == ((0,), (1,))
    assert judged(planned(problem), solution.plan) == pytest.approx(10 + 0.5 - 0.2)


def best_of_all(problem):
    """The largest reward of any plan with planned unloading; only the amounts are the product's."""
    routes = [
        route
        for length in range(problem.max_steps + 1)
        for route in product(range(problem.n_targets), repeat=length)
    ]
    arrays, record, best = compile_problem(problem), problem_to_record(problem), -np.inf
    for fleet in product(routes, repeat=problem.n_uavs):
        actions = np.full((max(1, *map(len, fleet)), problem.n_uavs), problem.n_targets, np.int64)
        for i, route in enumerate(fleet):
            actions[: len(route), i] = route
        delivered = best_amounts(arrays, actions).delivered.tolist()
        try:
            best = max(best, replay(record, actions.tolist(), delivered)["reward"])
        except Illegal:
            continue
    return best


def test_the_best_plan_of_tiny_problems_is_found():
    rng = np.random.default_rng(4)
    for _ in range(12):
        problem = planned(replace(random_problem(rng, 2, 3), max_steps=2))
        reward = judged(problem, solve(problem).plan)
        assert reward == pytest.approx(best_of_all(problem), rel=1e-9, abs=1e-9)


def test_the_search_keeps_count_of_what_its_plan_earns():
    rng = np.random.default_rng(8)
    for _ in range(20):
        problem = planned(random_problem(rng))
        arrays = compile_problem(problem)
        search = new_planned_search(arrays, Plan.empty(problem.n_uavs, problem.n_targets).as_array())
        if not len(search.search.near.active) or not len(search.search.near.wanted):
            continue
        anneal_planned(search, rng, 1.0, 0.1, 500, 1e9, 0.3)
        best = np.full((problem.max_steps, problem.n_uavs), problem.n_targets)
        for i, length in enumerate(search.search.best_length):
            best[:length, i] = search.search.best_target[i, :length]
        plan = Plan.of(without_useless(arrays, best), problem.n_targets)
        # What is left out costs no satisfaction and no distance.
        assert reward_of(problem, plan) >= search.search.best[0] - 1e-9


def test_progress_rises_and_tells_the_truth():
    problem, told = planned(generate("clustered", 4, 8, 2, np.random.default_rng(3))), []
    solution = solve(problem, report=told.append)
    assert [p.fraction for p in told] == sorted(p.fraction for p in told)
    assert [p.best_reward for p in told] == sorted(p.best_reward for p in told)
    for progress in told:
        assert reward_of(problem, progress.incumbent) == pytest.approx(progress.best_reward)
    assert told[-1].incumbent == solution.plan
    assert solution.history.epoch == sorted(solution.history.epoch)


def test_the_same_seed_gives_the_same_plan_and_a_stop_ends_it():
    problem = planned(generate("clustered", 4, 8, 2, np.random.default_rng(3)))
    assert solve(problem).plan == solve(problem).plan
    assert judged(problem, solve(problem, stop=at_once()).plan) > 0


class Clock:
    """Every look takes a millisecond."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        self.now += 0.001
        return self.now


def test_threads_search_on_together_from_the_best_plan_and_find_the_same_each_time():
    """The greedy rule's plan is the same for one and for two, so what differs is found by the threads."""
    gains = []
    for seed in range(5):
        problem = planned(generate("uniform", 8, 20, 3, np.random.default_rng(seed)))
        one, two, again = (solve(problem, "greedy", threads=number).plan for number in (1, 2, 2))
        assert two == again
        gains.append(judged(problem, two) - judged(problem, one))
    assert sum(gains) > 0


def test_a_time_limit_leaves_a_share_to_the_planning_of_the_unloading():
    problem, told = planned(generate("clustered", 4, 8, 2, np.random.default_rng(3))), []
    solve(problem, stop=Deadline(0.3, Clock()), report=told.append)
    assert told[-1].epoch > 0
    assert told[-1].fraction > 0.6
