"""Every algorithm on random small problems of every mixture of fields, against the independent referee."""

from __future__ import annotations

import itertools
import json
import random
from typing import Any

import pytest
from referee import Illegal, replay
from world_problems import Scene

from app.api.wire_fields import from_wire, wire_model
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.learning.auto import Auto
from app.learning.parameters import AutoParameters
from app.simulation.evaluation import reward_of
from app.solvers.bound.upper_bound import upper_bound
from app.solvers.exact import Exact
from app.solvers.genetic import GeneticAlgorithm
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import ExactParameters, GeneticParameters, LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import Deadline, never
from app.solvers.unloading.solver import PlannedUnloading

REL = 1e-9
PROBLEMS = 150
MOST_PLANS = 1500


def read(body: dict[str, Any]) -> Problem:
    return from_wire(wire_model(Problem).model_validate_json(json.dumps(body)), Problem)


def with_start_plan(body: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """The problem with a legal plan to be changed as little as possible."""
    m, n = len(body["uavs"]), len(body["targets"])
    plan = [[n] * m for _ in range(body["max_steps"])]
    for _ in range(15):
        tried = [list(row) for row in plan]
        tried[rng.randrange(len(tried))][rng.randrange(m)] = rng.randrange(n)
        try:
            replay(body, tried)
        except Illegal:
            continue
        plan = tried
    changed = {**body["objective"], "change_weight": rng.choice([0.05, 0.3])}
    return {**body, "start_plan": plan, "objective": changed}


def best_plan(body: dict[str, Any]) -> float | None:
    """The best reward of all plans by the referee; None where they are too many."""
    m, n = len(body["uavs"]), len(body["targets"])
    routes = [(), *itertools.chain(*(itertools.permutations(range(n), k) for k in range(1, body["max_steps"] + 1)))]

    def rows(chosen):
        longest = max(1, *map(len, chosen))
        return [[route[s] if s < len(route) else n for route in chosen] for s in range(longest)]

    possible = []
    for i in range(m):
        own = []
        for route in routes:
            try:
                replay(body, rows([route if h == i else () for h in range(m)]))
            except Illegal as broken:
                if broken.args[0][2] != "unloads nothing":
                    continue
            own.append(route)
        possible.append(own)
    count = 1
    for own in possible:
        count *= len(own)
    if count > MOST_PLANS:
        return None
    best = -float("inf")
    for chosen in itertools.product(*possible):
        try:
            best = max(best, replay(body, rows(chosen))["reward"])
        except Illegal:
            continue
    return best


@pytest.mark.parametrize("part", range(4))
def test_plans_are_legal_rewards_true_and_bounds_valid(part):
    context = SolverContext()
    solvers = {
        "ga": GeneticAlgorithm(GeneticParameters(num_total=20, iteration=10), context),
        "local_search": LocalSearch(LocalSearchParameters(moves=3000), context),
        "exact": Exact(ExactParameters(), context),
    }
    proven = 0
    for number in range(part * PROBLEMS, (part + 1) * PROBLEMS):
        rng = random.Random(number)
        body = Scene(rng).problem()
        if rng.random() < 0.3:
            body = with_start_plan(body, rng)
        problem = read(body)
        rewards = {"greedy": earned(body, problem, greedy_plan(problem))}
        for name, solver in solvers.items():
            solution = solver.solve(problem, 1, never, lambda _: None)
            rewards[name] = earned(body, problem, solution.plan)
        best, most = best_plan(body), max(rewards.values())
        slack = 1e-7 * max(1.0, abs(most))
        assert solution.proof.bound >= most - slack, number
        for known in (None, rewards["local_search"]):
            assert upper_bound(problem, known, Deadline(0.5)).value >= most - slack, number
        if best is not None:
            assert solution.proof.bound >= best - slack, number
            assert rewards["exact"] >= best - slack or not solution.proof.proven, number
            proven += solution.proof.proven
    assert proven > 0.9 * PROBLEMS


def earned(body: dict[str, Any], problem: Problem, plan: Plan) -> float:
    """The reward of a plan, which the referee confirms."""
    reward = reward_of(problem, plan)
    assert reward == pytest.approx(replay(body, plan.assignment)["reward"], rel=REL, abs=REL)
    return reward
