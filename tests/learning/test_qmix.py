import contextlib
import io
import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from brute_force import best_reward
from problems import random_problem
from referee import replay
from stopping import When

from app.domain.errors import ProblemTooLarge
from app.domain.records import problem_to_record
from app.learning.checkpoints.checkpoint import decode, verify
from app.learning.parameters import QmixParameters
from app.learning.qmix import Qmix
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver
from app.solvers.stop import never


def solve(problem, seed=1, stop=never, **parameters):
    solver = Qmix(QmixParameters(mode="paper", **parameters), SolverContext())
    return solver.solve(problem, seed, stop, lambda progress: None)


def reward(problem, plan):
    return replay(problem_to_record(problem), [list(row) for row in plan.assignment])["reward"]


def test_finds_the_optimum_of_a_tiny_problem():
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(4))
    solution = solve(problem, n_epochs=800, learning_starts=32, epsilon_anneal_steps=1000, lr=1e-3)
    best = best_reward(problem_to_record(problem))
    assert best > 0.5
    assert reward(problem, solution.plan) == pytest.approx(best)
    assert solution.history.reward[-1] >= 0.9 * best, "the greedy policy too is near it, not only exploration"
    assert solution.history.reward[-1] > solution.history.reward[0]


def test_plans_are_legal_and_never_worse_than_none():
    """Random problems of every option: returning UAVs, deadlines, charged returns, degrees, empty needs."""
    rng = np.random.default_rng(8)
    for seed in range(40):
        problem = random_problem(rng)
        solution = solve(problem, seed, n_epochs=8, learning_starts=4, evaluate_per_epoch=3)
        nothing = [[problem.n_targets] * problem.n_uavs]
        assert reward(problem, solution.plan) >= replay(problem_to_record(problem), nothing)["reward"] - 1e-12
        verify(solution.checkpoint, problem)


def test_stop_from_the_beginning_returns_a_legal_plan_at_once():
    problem = generate("uniform", 5, 10, 3, np.random.default_rng(0))
    asked = []
    solution = solve(problem, stop=When(lambda: asked.append(1) or True))
    assert len(asked) == 1
    assert reward(problem, solution.plan) >= 0
    assert solution.history.epoch == [0]
    assert decode(solution.checkpoint).metadata["metrics"]["epochs"] == 0


def test_registry_builds_it():
    parameters = QmixParameters(mode="paper", n_epochs=2)
    solution = create_solver("qmix", parameters, SolverContext()).solve(
        generate("uniform", 2, 2, 1, np.random.default_rng(0)), 1, never, lambda progress: None
    )
    assert solution.parameters == parameters


def test_global_random_states_and_threads_are_left_alone(problem):
    torch.set_num_threads(2)
    before = torch.get_rng_state(), np.random.get_state()[1].copy()
    solve(problem, n_epochs=12, learning_starts=5)
    assert torch.equal(torch.get_rng_state(), before[0])
    assert np.array_equal(np.random.get_state()[1], before[1])
    assert torch.get_num_threads() == 2


SCRIPT = """
import hashlib, numpy as np
from app.learning.parameters import QmixParameters
from app.learning.qmix import Qmix
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.stop import never
problem = generate("uniform", 4, 6, 3, np.random.default_rng(5))
solution = Qmix(QmixParameters(
    mode="paper", n_epochs=60, learning_starts=20, evaluate_per_epoch=5), SolverContext()).solve(
    problem, 123, never, lambda progress: None)
print(solution.plan.assignment, solution.history, hashlib.sha256(solution.checkpoint).hexdigest())
"""


def run(**environment):
    return subprocess.run(
        [sys.executable, "-c", SCRIPT],
        capture_output=True, text=True, check=True, env={**os.environ, **environment},
    ).stdout  # fmt: skip


def test_same_seed_gives_the_same_bytes_in_another_process():
    with contextlib.redirect_stdout(io.StringIO()) as here:
        exec(SCRIPT, {})
    assert "History(epoch=[0, 5, 10" in here.getvalue()
    # In the other one strings have other hashes, and torch may use another number of threads.
    assert run(PYTHONHASHSEED="2", OMP_NUM_THREADS="2") == here.getvalue()


def test_seed_decides_and_nothing_that_was_solved_before(problem):
    solver = Qmix(QmixParameters(mode="paper", n_epochs=20, learning_starts=5), SolverContext())
    first, again, other = (solver.solve(problem, seed, never, lambda progress: None) for seed in (9, 9, 10))
    assert first == again
    assert first.checkpoint != other.checkpoint
    assert first.history != other.history


def test_training_that_would_not_fit_into_memory_is_refused():
    problem = generate("uniform", 60, 100, 3, np.random.default_rng(0))
    with pytest.raises(ProblemTooLarge, match=r"60 agents with 101 actions .* the limit is 1024 MiB"):
        solve(problem, buffer_size=100_000)
