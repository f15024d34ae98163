"""The proven best plan against brute force; what is not proven says so and is still bounded."""

import numpy as np
import pytest
from brute_force import best_reward
from problems import random_problem
from stopping import After

from app.domain.records import problem_to_record
from app.simulation.explain import reward_of
from app.simulation.generator import generate
from app.solvers.exact import Exact
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import ExactParameters, LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import never


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
