"""The genetic algorithm: optimal where the optimum is known, and its operators do what they say."""

import math

import numpy as np
import pytest
from brute_force import best_reward
from problems import random_problem

from app.domain.errors import ProblemTooLarge
from app.domain.records import problem_to_record
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.genetic import GeneticAlgorithm
from app.solvers.parameters import GeneticParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import never


def solve(problem, seed=123, stop=never, **parameters):
    solver = GeneticAlgorithm(GeneticParameters(**parameters), SolverContext())
    return solver.solve(problem, seed, stop, lambda progress: None)


def test_defaults_are_table_2():
    assert (GeneticParameters().num_total, GeneticParameters().iteration) == (30, 200)


def test_finds_the_optimum_of_tiny_problems():
    rng = np.random.default_rng(8)
    found = 0
    for _ in range(15):
        problem = random_problem(rng, max_uavs=2, max_targets=3)
        best = best_reward(problem_to_record(problem))
        reward = reward_of(problem, solve(problem, num_total=60).plan)
        assert reward <= best + 1e-9
        found += reward == pytest.approx(best, abs=1e-9)
    assert found >= 14


def test_history_is_the_incumbents_reward_and_never_falls():
    problem = generate("uniform", 5, 10, 3, np.random.default_rng(1))
    solution = solve(problem)
    assert solution.history.epoch == list(range(201))
    assert solution.history.reward == sorted(solution.history.reward)
    assert solution.history.reward[-1] == pytest.approx(reward_of(problem, solution.plan), abs=1e-12)
    assert solution.history.reward[-1] > solution.history.reward[0]


def test_the_seed_decides_everything():
    problem = generate("deadline", 6, 9, 2, np.random.default_rng(2))
    first, again, other = solve(problem, 5), solve(problem, 5), solve(problem, 6)
    assert (first.plan, first.history) == (again.plan, again.history)
    assert first.history != other.history


def test_without_crossover_and_mutation_nothing_new_is_born():
    problem = generate("uniform", 5, 10, 3, np.random.default_rng(4))
    history = solve(problem, crossover_rate=0.0, mutation_rate=0.0).history
    assert len(set(history.reward)) == 1


def test_a_population_that_would_not_fit_is_refused():
    problem = generate("clustered", 1000, 5, 1, np.random.default_rng(4))
    with pytest.raises(ProblemTooLarge, match=r"10000 times 6 steps times 1000 UAVs are 60000000 genes"):
        solve(problem, num_total=10_000)


class After:
    """Stops at a number of questions, and would have it that the work goes on at the next."""

    def __init__(self, questions):
        self.questions = questions
        self.asked = 0

    def __call__(self):
        self.asked += 1
        return self.asked == self.questions

    def seconds_left(self):
        return math.inf


@pytest.mark.parametrize("chunk", [1, 90, 1000])
def test_slices_change_nothing_but_how_often_stop_is_asked(monkeypatch, chunk):
    problem = generate("deadline", 6, 9, 2, np.random.default_rng(2))
    never_stopped, often = After(0), After(0)
    whole = solve(problem, stop=never_stopped, iteration=20)
    monkeypatch.setattr("app.solvers.genetic.CHUNK_GENES", chunk)
    sliced = solve(problem, stop=often, iteration=20)

    assert (sliced.plan, sliced.history) == (whole.plan, whole.history)
    assert often.asked > never_stopped.asked
    if chunk == 1:
        # Once for every chromosome of every generation.
        assert often.asked >= 30 * 21


@pytest.mark.parametrize("questions", [1, 2, 3, 20, 30, 31, 32, 33, 50, 61, 62, 95, 200])
def test_a_stop_in_the_midst_of_a_generation_keeps_the_best(monkeypatch, questions):
    monkeypatch.setattr("app.solvers.genetic.CHUNK_GENES", 1)
    problem = generate("uniform", 5, 10, 3, np.random.default_rng(1))
    whole = solve(problem, iteration=20).history.reward
    stop = After(questions)
    stopped = solve(problem, stop=stop, iteration=20)
    rewards = stopped.history.reward

    assert stop.asked == questions
    assert rewards == sorted(rewards)
    assert rewards[:-1] == whole[: len(rewards) - 1]
    assert 0.0 <= rewards[-1] <= whole[len(rewards) - 1]
    assert rewards[-1] == pytest.approx(reward_of(problem, stopped.plan), abs=1e-12)
