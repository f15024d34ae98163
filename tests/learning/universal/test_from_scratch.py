"""QMIX in service mode: a policy for every size, learned on one problem from nothing."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from brute_force import best_reward
from problems import random_problem
from referee import replay
from stopping import After

from app.domain.records import problem_to_record
from app.learning.checkpoints.checkpoint import decode, verify
from app.learning.pairwise.rollout import play
from app.learning.parameters import QmixParameters
from app.learning.qmix import Qmix
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan
from app.solvers.protocol import SolverContext
from app.solvers.stop import never

SMALL = {"drqn_hidden_dim": 16, "qmix_hidden_dim": 8}


def solve(problem, seed=1, stop=never, report=lambda _progress: None, **parameters):
    solver = Qmix(QmixParameters(**{**SMALL, **parameters}), SolverContext())
    return solver.solve(problem, seed, stop, report)


def greedy_reward(checkpoint, problem):
    agent = decode(checkpoint).network.agent
    return float(play(agent, compile_problem(problem), np.zeros(1, np.int64)).rewards[0])


def test_finds_what_the_greedy_rule_misses_and_the_policy_itself_has_learned_it():
    below = 0
    for seed in range(3):
        problem = generate("uniform", 2, 4, 2, np.random.default_rng(seed))
        best = best_reward(problem_to_record(problem))
        below += reward_of(problem, greedy_plan(problem)) < best - 1e-9
        solution = solve(problem, n_epochs=1600, evaluate_per_epoch=800)
        assert reward_of(problem, solution.plan) == pytest.approx(best)
        assert greedy_reward(solution.checkpoint, problem) == pytest.approx(best)
        assert solution.history.epoch == [0, 800, 1600]
    assert below > 0, "otherwise nothing had to be found"


def test_never_below_the_greedy_rule_its_own_roll_outs_or_staying_at_home():
    rng = np.random.default_rng(40)
    for seed in range(20):
        problem = random_problem(rng)
        solution = solve(problem, seed, n_epochs=20, batch_size=8, evaluate_per_epoch=10)
        rows = [list(row) for row in solution.plan.assignment]
        earned = replay(problem_to_record(problem), rows)["reward"]
        at_home = replay(problem_to_record(problem), [[problem.n_targets] * problem.n_uavs])["reward"]
        floor = max(*solution.history.reward, reward_of(problem, greedy_plan(problem)), at_home)
        assert earned >= floor - 1e-9
        verify(solution.checkpoint, problem)


def test_epochs_are_episodes():
    problem, told = generate("uniform", 3, 5, 2, np.random.default_rng(41)), []
    solution = solve(problem, report=told.append, n_epochs=50, batch_size=20, evaluate_per_epoch=20)
    assert [p.epoch for p in told] == [20, 40, 50]
    assert [p.fraction for p in told] == [0.4, 0.8, 1.0]
    assert solution.history.epoch == [0, 20, 40, 50]
    assert decode(solution.checkpoint).metadata["metrics"]["epochs"] == 50
    untrained = solve(problem, n_epochs=0)
    assert untrained.history.epoch == [0]
    assert greedy_reward(untrained.checkpoint, problem) == pytest.approx(solution.history.reward[0])
    assert greedy_reward(solution.checkpoint, problem) == pytest.approx(solution.history.reward[-1])


def test_what_it_learned_plays_problems_of_other_sizes():
    solution = solve(generate("uniform", 4, 7, 3, np.random.default_rng(42)), n_epochs=20)
    checkpoint = decode(solution.checkpoint)
    assert checkpoint.metadata["architecture"] == "qmix-universal-2"
    assert checkpoint.metadata["algorithm"] == "qmix"
    verify(solution.checkpoint, generate("scarce", 9, 4, 5, np.random.default_rng(43)))


def test_the_same_seed_gives_the_same_answer_and_threads_and_random_states_are_left_alone():
    problem = generate("uniform", 4, 7, 3, np.random.default_rng(44))
    torch.set_num_threads(2)
    before = torch.get_rng_state(), np.random.get_state()[1].copy()
    first, again, other = (solve(problem, seed, n_epochs=40) for seed in (3, 3, 4))
    assert torch.equal(torch.get_rng_state(), before[0])
    assert np.array_equal(np.random.get_state()[1], before[1])
    assert torch.get_num_threads() == 2
    assert first == again
    assert first.checkpoint != other.checkpoint


def test_stopped_at_any_time_it_returns_a_plan_and_a_checkpoint():
    problem = generate("uniform", 4, 7, 3, np.random.default_rng(45))
    floor = reward_of(problem, greedy_plan(problem))
    for allowed in (0, 1, 15, 60, 200):
        solution = solve(problem, stop=After(allowed), n_epochs=10**6)
        assert reward_of(problem, solution.plan) >= floor - 1e-9
        assert solution.history.epoch[0] == 0
        verify(solution.checkpoint, problem)


def test_the_width_that_was_used_comes_back():
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(46))
    for asked, used in ((64, 64), (10, 12), (1024, 448)):
        solution = solve(problem, n_epochs=0, drqn_hidden_dim=asked)
        assert solution.parameters.drqn_hidden_dim == used
        assert decode(solution.checkpoint).config.width == used


def test_long_episodes_are_left_to_algorithm_1():
    problem = generate("uniform", 40, 60, 2, np.random.default_rng(47))
    solution = solve(problem, n_epochs=1)
    assert solution.parameters.mode == "paper"
    assert decode(solution.checkpoint).metadata["architecture"] == "qmix-paper-1"


def test_where_nothing_can_be_flown_everybody_stays_at_home():
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(48))
    grounded = replace(problem, uavs=tuple(replace(u, ret=True) for u in problem.uavs))
    solution = solve(grounded, n_epochs=20)
    assert solution.plan.assignment == ((3, 3),)
    assert solution.history.reward == [0.0]
    verify(solution.checkpoint, grounded)


def test_where_nothing_pays_staying_at_home_is_not_imitated():
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(49))
    dear = replace(problem, objective=replace(problem.objective, distance_weight=1e4))
    solution = solve(dear, n_epochs=40, batch_size=8)
    assert solution.plan.assignment == ((3, 3),)
    verify(solution.checkpoint, dear)
