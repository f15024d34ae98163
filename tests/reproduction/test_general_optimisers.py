"""PyVRP and OR-Tools against brute force, on problems that they can express."""

from dataclasses import replace

import numpy as np
import pytest
from brute_force import best_reward
from referee import replay

from app.domain.records import problem_to_record
from app.reproduction.general_optimisers import pyvrp_plan, routing_plan
from app.simulation.evaluation import reward_of
from app.simulation.generator import FAMILIES, generate
from app.solvers.greedy import greedy_plan

OPTIMISERS = {"PyVRP": pyvrp_plan, "OR-Tools": routing_plan}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("need", "loads", "max_steps"),
    [((1.0,), ((3.0,), (3.0,)), 2), ((1.0, 1.0), ((3.0, 0.0), (0.0, 3.0)), 3)],
    ids=["every area is served in full", "UAVs share areas that need what none of them has alone"],
)
@pytest.mark.parametrize("name", OPTIMISERS)
def test_the_best_plan_is_found(name, need, loads, max_steps, seed):
    problem = generate("uniform", 2, 3, len(need), np.random.default_rng([5, seed]))
    targets = tuple(replace(t, loadlist=need) for t in problem.targets)
    uavs = tuple(replace(u, loadlist=load) for u, load in zip(problem.uavs, loads, strict=True))
    problem = replace(problem, targets=targets, uavs=uavs, max_steps=max_steps)
    record = problem_to_record(problem)
    plan = OPTIMISERS[name](problem, 0.4, 1)
    assert replay(record, plan.assignment)["reward"] == pytest.approx(best_reward(record), abs=1e-4)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_a_step_limit_is_no_reason_to_stay_at_home(name):
    problem = replace(generate("mixed_loads", 4, 24, 2, np.random.default_rng([9, 4, 24])), max_steps=2)
    plan = OPTIMISERS[name](problem, 0.4, 1)
    assert replay(problem_to_record(problem), plan.assignment)["reward"] > 0.8 * reward_of(
        problem, greedy_plan(problem)
    )


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("name", OPTIMISERS)
def test_plans_of_every_family_can_be_flown(name, family):
    problem = generate(family, 4, 8, 2, np.random.default_rng([6, 4, 8]))
    plan = OPTIMISERS[name](problem, 0.05, 1)
    assert replay(problem_to_record(problem), plan.assignment)["reward"] >= 0
