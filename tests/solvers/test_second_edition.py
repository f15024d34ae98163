"""Every algorithm on random small problems of every mixture of fields, against the independent referee."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from referee import Illegal, replay
from referee_legs import Legs
from worlds import random_sorties, random_world

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.domain.records import problem_to_record
from app.simulation.evaluation import reward_of
from app.solvers.bound.upper_bound import upper_bound
from app.solvers.exact import Exact
from app.solvers.floor import nothing_to_fly
from app.solvers.genetic import GeneticAlgorithm
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import ExactParameters, GeneticParameters, LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import Deadline

REL = 1e-9
PROBLEMS = 30
MOST_PLANS = 400


def best_plan(body: dict[str, Any], legs: Legs) -> float | None:
    """The best reward of all plans by the referee; None where they are too many."""
    m, n, lengths = len(body["uavs"]), len(body["targets"]), range(1, body["max_steps"] + 1)
    stops = [*range(n), *range(n + 1, n + 1 + len(body.get("bases") or ()))]
    orders = [itertools.product(stops, repeat=k) for k in lengths]
    if len(stops) == n:
        orders = [itertools.permutations(stops, k) for k in lengths]
    routes = [(), *itertools.chain(*orders)]

    def rows(chosen):
        longest = max(1, *map(len, chosen))
        return [[route[s] if s < len(route) else n for route in chosen] for s in range(longest)]

    possible: list[list[tuple[int, ...]]] = []
    count = 1
    for i in range(m):
        own = []
        for route in routes:
            try:
                replay(body, rows([route if h == i else () for h in range(m)]), legs=legs)
            except Illegal as broken:
                if broken.args[2] != "useless":
                    continue
            own.append(route)
            if count * len(own) > MOST_PLANS:
                return None
        possible.append(own)
        count *= len(own)
    best = -float("inf")
    for chosen in itertools.product(*possible):
        try:
            best = max(best, replay(body, rows(chosen), legs=legs)["reward"])
        except Illegal:
            continue
    return best


@pytest.mark.parametrize("draw", [random_world, random_sorties])
@pytest.mark.parametrize("part", range(2))
def test_plans_are_legal_rewards_true_and_bounds_valid(draw, part):
    context = SolverContext()
    solvers = {
        "ga": GeneticAlgorithm(GeneticParameters(num_total=20, iteration=10), context),
        "local_search": LocalSearch(LocalSearchParameters(moves=3000), context),
        "exact": Exact(ExactParameters(), context),
    }
    proven = 0
    for number in range(part * PROBLEMS, (part + 1) * PROBLEMS):
        rng = np.random.default_rng(number)
        problem = draw(rng, max_uavs=3, max_targets=3)
        body = problem_to_record(problem)
        legs = Legs(body)
        rewards = {"greedy": earned(body, legs, problem, greedy_plan(problem))}
        for name, solver in solvers.items():
            solution = solver.solve(problem, 1, Deadline(2.0), lambda _: None)
            rewards[name] = earned(body, legs, problem, solution.plan)
        proven += solution.proof.proven
        best, most = best_plan(body, legs), max(rewards.values())
        slack = 1e-7 * max(1.0, abs(most))
        assert solution.proof.bound >= most - slack, number
        for known in (None, rewards["local_search"]):
            assert upper_bound(problem, known, Deadline(0.5)).value >= most - slack, number
        if best is not None:
            assert solution.proof.bound >= best - slack, number
            assert rewards["exact"] >= best - slack or not solution.proof.proven, number
    assert proven > (0.6 if draw is random_sorties else 0.9) * PROBLEMS


def test_staying_at_home_is_the_best_plan_where_nothing_can_be_flown():
    found = 0
    for number in range(200):
        problem = random_sorties(np.random.default_rng([7, number]), 3, 4)
        if not nothing_to_fly(problem):
            continue
        found += 1
        body = problem_to_record(problem)
        best = best_plan(body, Legs(body))
        at_home = reward_of(problem, Plan.empty(problem.n_uavs, problem.n_targets))
        assert best is None or best <= at_home + REL, number
    assert found > 20


def earned(body: dict[str, Any], legs: Legs, problem: Problem, plan: Plan) -> float:
    """The reward of a plan, which the referee confirms."""
    reward = reward_of(problem, plan)
    assert reward == pytest.approx(replay(body, plan.assignment, legs=legs)["reward"], rel=REL, abs=REL)
    return reward
