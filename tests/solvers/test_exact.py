"""The proven best plan against brute force; what is not proven says so and is still bounded."""

import time
from dataclasses import replace

import numpy as np
import pytest
from brute_force import best_reward
from problems import random_problem
from stopping import After

from app.domain.records import problem_to_record
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.simulation.world_generator import WORLD_FAMILIES
from app.solvers.exact import Exact
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import ExactParameters, LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import Deadline, never


def solve(problem, stop=never, **parameters):
    return Exact(ExactParameters(**parameters), SolverContext()).solve(problem, 1, stop, lambda _told: None)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_best_there_is(seed):
    rng = np.random.default_rng(40 + seed)
    tried = 0
    while tried < 10:
        problem = random_problem(rng, max_uavs=3, max_targets=3)
        if (problem.n_targets + 1) ** (problem.n_uavs * problem.max_steps) > 4**6:
            continue
        tried += 1
        solution = solve(problem)
        best = best_reward(problem_to_record(problem))
        assert solution.proof.proven
        assert reward_of(problem, solution.plan) == pytest.approx(best, abs=1e-8)
        assert solution.proof.bound >= best - 1e-12 * abs(best)


@pytest.mark.parametrize(("m", "n", "proven"), [(1, 3, True), (12, 40, False), (200, 500, False)])
def test_with_bases_tiny_problems_are_proven_and_others_bounded(m, n, proven):
    problem = replace(
        WORLD_FAMILIES["stock"](m, n, 2, np.random.default_rng(2)), max_steps=4 if proven else 15
    )
    solution = solve(problem, never if proven else Deadline(2.0))
    reward = reward_of(problem, solution.plan)
    assert solution.proof.proven == proven
    assert solution.proof.bound >= reward - 1e-9


@pytest.mark.parametrize("family", ["uniform", "deadline", "clustered"])
def test_small_problems_of_the_papers_size_are_proven(family):
    problem = generate(family, 5, 5, 3, np.random.default_rng(2))
    solution = solve(problem)
    search = LocalSearch(LocalSearchParameters(moves=20_000), SolverContext())
    found = search.solve(problem, 3, never, lambda _told: None).plan
    assert solution.proof.proven
    assert reward_of(problem, solution.plan) >= reward_of(problem, found) - 1e-9


def test_what_is_given_up_is_not_called_proven():
    problem = generate("clustered", 8, 12, 3, np.random.default_rng(1))
    solution = solve(problem, nodes=1)
    assert not solution.proof.proven
    assert solution.proof.bound > reward_of(problem, solution.plan)


def test_too_large_a_problem_is_answered_with_a_bound():
    problem = generate("uniform", 20, 70, 3, np.random.default_rng(1))
    solution = solve(problem, stop=After(40))
    assert not solution.proof.proven
    assert solution.proof.bound >= reward_of(problem, solution.plan)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize(("family", "m", "n"), [("uniform", 10, 5), ("deadline", 5, 10)])
def test_a_time_limit_takes_no_proof_away(family, m, n, threads):
    """The search for a first plan takes a small share of the time, however long it could go on."""
    problem = generate(family, m, n, 3, np.random.default_rng(4))
    stop = Deadline(6.0, time.process_time)
    exact = Exact(ExactParameters(), SolverContext(threads=threads))
    assert exact.solve(problem, 1, stop, lambda _told: None).proof.proven


def test_it_can_be_stopped_anywhere():
    problem = generate("uniform", 4, 6, 3, np.random.default_rng(4))
    best = reward_of(problem, solve(problem).plan)
    floor = reward_of(problem, greedy_plan(problem))
    for looks in (0, 1, 300, 350, 400, 500):
        solution = solve(problem, stop=After(looks))
        reward = reward_of(problem, solution.plan)
        assert floor <= reward <= best + 1e-9
        assert solution.proof.bound >= best - 1e-12 * best
