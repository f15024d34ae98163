"""The algorithm a dispatcher should take: where it asks the policy, and that it never does worse for it."""

import math
import subprocess
import sys

import numpy as np
import pytest

from app.learning.auto import Auto, policy_pays
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import AutoParameters, LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import never


def problem_of(m, n, seed=1):
    return generate("uniform", m, n, 2, np.random.default_rng(seed))


def solve(problem, context=None, **parameters):
    context = SolverContext() if context is None else context
    return Auto(AutoParameters(**parameters), context).solve(problem, 1, never, lambda _progress: None)


def test_without_a_policy_it_is_the_local_search():
    problem = problem_of(5, 8)
    solution = solve(problem, moves=3000, policy=False)
    search = LocalSearch(LocalSearchParameters(moves=3000), SolverContext())
    assert solution.plan == search.solve(problem, 1, never, lambda _progress: None).plan
    assert solution.source_policy is None


def test_without_a_library_a_policy_is_not_needed():
    problem = problem_of(3, 4)
    solution = solve(problem, moves=500, policy=True)
    assert solution.source_policy is None
    assert reward_of(problem, solution.plan) >= reward_of(problem, greedy_plan(problem))


def test_a_short_time_limit_and_a_very_large_problem_are_the_searchs_alone():
    small = compile_problem(problem_of(5, 10))
    assert not policy_pays(small, 0.25)
    assert not policy_pays(compile_problem(problem_of(300, 700)), math.inf)


@pytest.mark.parametrize("policy", ["", ", policy=False"])
def test_where_no_policy_is_asked_torch_is_not_loaded(policy):
    program = f"""
import sys
import numpy as np
from app.learning.auto import Auto
from app.simulation.generator import generate
from app.solvers.parameters import AutoParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import Deadline
problem = generate("uniform", 3, 4, 2, np.random.default_rng(1))
solver = Auto(AutoParameters(moves=100{policy}), SolverContext())
solver.solve(problem, 1, Deadline(0.2), lambda progress: None)
assert "torch" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True)
