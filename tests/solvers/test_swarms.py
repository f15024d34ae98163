"""The decoder of random keys, the searches over them, and the other algorithms for comparison."""

import json

import numpy as np
import pytest
from brute_force import best_reward
from problems import random_problem, strained
from referee import replay

from app.domain.errors import ProblemTooLarge
from app.domain.plan import Plan
from app.domain.records import problem_to_record
from app.domain.said import to_record
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.budget import default_evaluations
from app.solvers.greedy import greedy_plan
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import never
from app.solvers.swarms.decoder import NEUTRAL, fly, new_flight
from app.solvers.swarms.particle_swarm import NEIGHBOURHOODS, neighbour

SWARMS = ("particle_swarm", "grey_wolf", "beetle_antennae")
SEARCHES = (*SWARMS, "ant_colony", "contract_net", "bundles", "semi_random_q")
NEAR = {"bundles": 0.9, "contract_net": 0.95}


def solve(name, problem, seed=3, **parameters):
    solver = create_solver(name, parse_parameters(name, parameters), SolverContext())
    return solver.solve(problem, seed, never, lambda progress: None)


def flown(problem, keys):
    flight = new_flight(compile_problem(problem))
    reward = fly(flight, keys[None], 0)
    return reward, Plan.of(flight.actions, problem.n_targets)


def test_any_keys_are_a_legal_plan_and_earn_what_the_decoder_says():
    rng = np.random.default_rng(1)
    for _ in range(100):
        problem = strained(random_problem(rng), rng)
        reward, plan = flown(problem, rng.random((problem.n_uavs, problem.n_targets + problem.n_bases)))
        earned = replay(problem_to_record(problem), plan.assignment)["reward"]
        assert reward == pytest.approx(earned, abs=1e-9)


def test_neutral_keys_are_the_greedy_rule():
    rng = np.random.default_rng(2)
    for _ in range(100):
        problem = random_problem(rng)
        _, plan = flown(problem, np.full((problem.n_uavs, problem.n_targets), NEUTRAL))
        assert plan == greedy_plan(problem)


def test_a_key_of_nothing_keeps_a_uav_away():
    problem = generate("uniform", 3, 5, 2, np.random.default_rng(3))
    keys = np.full((3, 5), NEUTRAL)
    served = {(i, j) for row in greedy_plan(problem).assignment for i, j in enumerate(row) if j < 5}
    i, j = sorted(served)[0]
    keys[i, j] = 0.0
    _, plan = flown(problem, keys)
    assert (i, j) not in {(u, a) for row in plan.assignment for u, a in enumerate(row)}
    assert flown(problem, np.zeros((3, 5)))[1] == Plan.empty(3, 5)


def test_neighbours_differ_as_their_kind_says():
    rng = np.random.default_rng(4)
    keys = rng.random((3, 4))
    for _ in range(20):
        one, exchanged, anew = (neighbour(keys, kind, rng) for kind in range(NEIGHBOURHOODS))
        assert (one != keys).sum() == 1
        assert (exchanged != keys).sum() in (0, 2)
        assert sorted(exchanged.ravel()) == sorted(keys.ravel())
        assert (anew != keys).any(axis=1).sum() == 1


@pytest.mark.parametrize("name", SEARCHES)
def test_finds_about_the_optimum_of_tiny_problems(name):
    rng = np.random.default_rng(8)
    shares = []
    for _ in range(12):
        problem = random_problem(rng, max_uavs=2, max_targets=3)
        best = best_reward(problem_to_record(problem))
        reward = reward_of(problem, solve(name, problem, evaluations=3000).plan)
        assert reward <= best + 1e-9
        if best > 1e-6:
            shares.append(reward / best)
    assert len(shares) > 6
    assert np.mean(shares) > NEAR.get(name, 0.97)


@pytest.mark.parametrize("name", SEARCHES)
def test_earns_more_than_the_greedy_rule_on_the_papers_sizes(name):
    rng = np.random.default_rng(9)
    above = 0
    for size in ((5, 10), (10, 10), (10, 5)):
        problem = generate("uniform", *size, 3, rng)
        above += reward_of(problem, solve(name, problem, evaluations=3000).plan) > reward_of(
            problem, greedy_plan(problem)
        )
    assert above == 3


@pytest.mark.parametrize("name", SEARCHES)
def test_evaluations_are_counted_and_the_history_never_falls(name):
    problem = generate("uniform", 4, 6, 2, np.random.default_rng(5))
    history = solve(name, problem, evaluations=500).history
    assert history.reward == sorted(history.reward)
    assert 500 <= history.epoch[-1] <= (500 if name in (*SWARMS, "ant_colony", "semi_random_q") else 700)
    assert solve(name, problem, evaluations=0).history.epoch[-1] <= 60


def test_evaluations_follow_from_the_size():
    sizes = [(2, 3), (20, 30), (100, 300)]
    most = [default_evaluations(generate("uniform", *size, 2, np.random.default_rng(6))) for size in sizes]
    assert most == sorted(most, reverse=True)
    assert (most[0], most[-1]) == (20_000, 500)


@pytest.mark.parametrize("name", SEARCHES)
def test_what_would_not_fit_is_refused(name):
    problem = generate("clustered", 700, 800, 1, np.random.default_rng(4))
    parameters = {"message_delay": 100} if name in NEAR else {}
    with pytest.raises(ProblemTooLarge, match="the limit is") as refused:
        solve(name, problem, **parameters)
    told = json.loads(json.dumps(to_record(refused.value.detail)))
    assert told["values"]["limit"] == refused.value.details["limit"]
