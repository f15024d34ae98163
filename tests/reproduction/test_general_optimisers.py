"""PyVRP and OR-Tools against brute force, on problems that they can express."""

from dataclasses import replace

import numpy as np
import pytest
from brute_force import best_reward
from referee import replay

from app.domain.records import problem_to_record
from app.reproduction.general_optimisers import pyvrp_plan, routing_plan
from app.simulation.explain import reward_of
from app.simulation.generator import FAMILIES, generate
from app.solvers.greedy import greedy_plan

OPTIMISERS = {"PyVRP": pyvrp_plan, "OR-Tools": routing_plan}


@pytest.mark.parametrize("name", OPTIMISERS)
def test_where_every_area_is_served_in_full_the_best_plan_is_found(name):
    for seed in range(4):
        problem = generate("uniform", 2, 3, 1, np.random.default_rng([5, seed]))
        targets = tuple(replace(t, loadlist=(1.0,)) for t in problem.targets)
        uavs = tuple(replace(u, loadlist=(3.0,)) for u in problem.uavs)
        problem = replace(problem, targets=targets, uavs=uavs, max_steps=2)
        record = problem_to_record(problem)
        plan = OPTIMISERS[name](problem, 0.2, 1)
        assert replay(record, plan.assignment)["reward"] == pytest.approx(best_reward(record), abs=1e-4)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_uavs_share_an_area_that_needs_what_none_of_them_has_alone(name):
    for seed in range(4):
        problem = generate("uniform", 2, 3, 2, np.random.default_rng([8, seed]))
        targets = tuple(replace(t, loadlist=(1.0, 1.0)) for t in problem.targets)
        loads = (3.0, 0.0), (0.0, 3.0)
        uavs = tuple(replace(u, loadlist=load) for u, load in zip(problem.uavs, loads, strict=True))
        problem = replace(problem, targets=targets, uavs=uavs, max_steps=3)
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
