"""Planned loading: the best amounts against a linear program, and their replay against the referee."""

import json
from dataclasses import replace

import numpy as np
import pytest
from loading_program import best_by_program
from referee import replay
from worlds import random_loading

from app.domain.errors import IllegalPlan, InvalidProblem
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_from_record, problem_to_record
from app.domain.surroundings import Base, Material
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import replay_at_best, reward_of
from app.simulation.explain import explain
from app.simulation.mid_mission import remaining_at
from app.simulation.planned_amounts import amounts_are_exact, best_amounts
from app.simulation.visit import ALLOWED, UNLOADS_NOTHING
from app.simulation.worth import satisfaction_of

PLANNED = Objective(distance_weight=0.1, unloading="planned", loading="planned")


def village(**changes):
    """One empty UAV that carries 4 kg, at a base with 6 of `water` and 20 of `medicine`, and two areas."""
    problem = Problem(
        uavs=(UAV("u1", 0, 0, 0, 0, 1.0, 10.0, (0.0, 0.0), capacity=4.0),),
        targets=(Target("north", 0, 1, 2.0, (3.0, 4.0)), Target("south", 0, -1, 1.0, (3.0, 0.0))),
        bases=(Base("base-1", 0, 0, stock=(6.0, 20.0)),),
        materials=(Material("water", 1.0), Material("medicine", 0.25)),
        objective=PLANNED,
        max_steps=4,
    )
    return replace(problem, **changes)


def random_plan(rng, problem):
    """Routes of visits and reloads, no two of which follow each other, whatever their lengths."""
    steps, m, n = problem.max_steps, problem.n_uavs, problem.n_targets
    actions = rng.integers(0, n + 1 + problem.n_bases, (steps, m))
    for i in range(m):
        route = [a for a in actions[: rng.integers(0, steps + 1), i].tolist() if a != n]
        kept = [a for s, a in enumerate(route) if a < n or s == 0 or route[s - 1] < n]
        actions[:, i] = [*kept, *[n] * (steps - len(kept))]
    return actions


def test_the_amounts_are_the_best_for_the_routes():
    rng = np.random.default_rng(3)
    compared = 0
    for _ in range(250):
        problem = random_loading(rng)
        arrays = compile_problem(problem)
        if not amounts_are_exact(arrays):
            continue
        actions = random_plan(rng, problem)
        met = np.zeros((problem.n_targets, problem.n_materials))
        delivered = best_amounts(arrays, actions).delivered
        for s, i in np.argwhere(actions < problem.n_targets):
            met[actions[s, i]] += delivered[s, i]
        best = best_by_program(problem_to_record(problem), actions.tolist(), not problem.plans_loading)
        assert satisfaction_of(arrays, met) == pytest.approx(best, rel=1e-7, abs=1e-7)
        compared += 1
    assert compared > 150


def test_legal_plans_earn_what_the_referee_says():
    rng = np.random.default_rng(8)
    legal = 0
    for _ in range(400):
        problem = random_loading(rng)
        actions = random_plan(rng, problem)
        try:
            allocation = explain(problem, Plan.of(actions, problem.n_targets))
        except IllegalPlan:
            continue
        legal += 1
        shape = (*actions.shape, problem.n_materials)
        delivered, loaded = np.zeros(shape), np.zeros(shape)
        for i, route in enumerate(allocation.routes):
            for stop in route.stops:
                if hasattr(stop, "loaded"):
                    loaded[stop.step - 1, i] = stop.loaded
                else:
                    delivered[stop.step - 1, i] = stop.delivered
        planned = loaded.tolist() if problem.plans_loading else None
        expected = replay(problem_to_record(problem), actions.tolist(), delivered.tolist(), loaded=planned)
        assert allocation.reward == pytest.approx(expected["reward"], rel=1e-9, abs=1e-9)
        for base, left in zip(allocation.bases, expected["stocks"], strict=True):
            if base.stock is not None:
                assert base.stock == pytest.approx(left, abs=1e-9)
    assert legal > 60


def test_a_flight_takes_what_its_visits_unload():
    # 4 kg: all of 'medicine' is 1 kg, which leaves 3 for 'water' of the more urgent area.
    amounts = best_amounts(compile_problem(village()), np.array([[3], [0], [3], [1]]))
    assert amounts.loaded[:, 0].tolist() == [[3.0, 4.0], [0.0, 0.0], [3.0, 0.0], [0.0, 0.0]]
    assert amounts.delivered[:, 0].tolist() == [[0.0, 0.0], [3.0, 4.0], [0.0, 0.0], [3.0, 0.0]]


def test_what_is_aboard_may_stay_behind_for_another():
    # u1 brings 2 of water to a base that has none; u2 fetches them, as u1 may not fly on.
    uavs = (
        UAV("u1", 0, 0, 0, 0, 1.0, 10.0, (2.0, 0.0), capacity=4.0, excluded=("north", "south")),
        UAV("u2", 0, 0, 0, 0, 1.0, 10.0, (0.0, 0.0), capacity=4.0),
    )
    problem = village(uavs=uavs, bases=(Base("base-1", 0, 0, stock=(0.0, 0.0)),))
    actions = np.array([[3, 3], [2, 0]])
    amounts = best_amounts(compile_problem(problem), actions)
    assert amounts.loaded[0].tolist() == [[-2.0, 0.0], [2.0, 0.0]]
    assert explain(problem, Plan.of(actions, 2)).bases[0].stock == (0.0, 0.0)
    # Stocks follow the plan's order: who comes first finds nothing.
    assert not best_amounts(compile_problem(replace(problem, uavs=uavs[::-1])), actions[:, ::-1]).loaded.any()


def test_one_who_can_carry_nothing_takes_nothing():
    # Its row of weights has no right side to be divided by.
    empty = UAV("u2", 0, 0, 0, 0, 1.0, 10.0, (0.0, 0.0), capacity=0.0)
    problem = village(uavs=(*village().uavs, empty))
    amounts = best_amounts(compile_problem(problem), np.array([[3, 3], [0, 1], [3, 2], [1, 2]]))
    assert amounts.loaded[:, 0].tolist() == [[3.0, 4.0], [0.0, 0.0], [3.0, 0.0], [0.0, 0.0]]
    assert not amounts.loaded[:, 1].any()
    assert not amounts.delivered[:, 1].any()


def test_amounts_too_far_apart_for_a_linear_program_are_possible_at_least():
    uavs = (UAV("u1", 0, 0, 0, 0, 1.0, 10.0, (0.0, 3e6), capacity=6e6 + 4.0),)
    targets = (Target("north", 0, 1, 1.0, (3e3, 1 / 3)), Target("south", 0, -1, 1.0, (2.5e9, 1e6)))
    materials = (Material("lead", 2e9), Material("water", 2.0))
    bases = (Base("base-1", 0, 0, stock=(1 / 3, 0.0)),)
    problem = village(uavs=uavs, targets=targets, materials=materials, bases=bases)
    arrays, actions = compile_problem(problem), np.array([[3], [1]])
    result, _ = replay_at_best(arrays, actions, True)
    assert result.rule[0] == ALLOWED
    assert best_amounts(arrays, actions).delivered[1, 0].tolist() == [0.0, 1e6]


def test_what_is_known_of_a_plan_is_not_taken_for_another_stock():
    arrays, actions = compile_problem(village()), np.array([[3], [0], [3], [1]])
    assert best_amounts(arrays, actions).loaded[:, 0, 0].tolist() == [3.0, 0.0, 3.0, 0.0]
    less = arrays._replace(stock=arrays.stock * [0.5, 1.0])
    assert best_amounts(less, actions).loaded[:, 0, 0].sum() == 3.0
    assert best_amounts(arrays, actions).loaded[:, 0, 0].tolist() == [3.0, 0.0, 3.0, 0.0]


def test_a_visit_that_gets_nothing_is_not_legal():
    problem = village(bases=(Base("base-1", 0, 0, stock=(0.0, 4.0)),))
    arrays = compile_problem(problem)
    result, _ = replay_at_best(arrays, np.array([[3], [0], [3], [1]]), True)
    assert result.rule[0] == UNLOADS_NOTHING
    assert replay_at_best(arrays, np.array([[3], [0]]), True)[0].rule[0] == ALLOWED


def test_loading_is_planned_only_with_unloading():
    with pytest.raises(InvalidProblem, match="`loading`: planned needs `unloading`: planned"):
        village(objective=replace(PLANNED, unloading="greedy"))


def test_a_record_keeps_it():
    problem = village()
    record = json.loads(json.dumps(problem_to_record(problem)))
    assert record["objective"]["loading"] == "planned"
    assert problem_from_record(record) == problem


def test_what_remains_of_a_plan_begins_with_what_was_loaded():
    problem = village()
    plan = Plan(((3,), (0,), (3,), (1,)))
    left = remaining_at(problem, plan, 0.5)
    assert left.uavs[0].loadlist == (3.0, 4.0)
    assert left.bases[0].stock == (3.0, 16.0)
    assert left.start_plan == ((0,), (3,), (1,))
    assert reward_of(left, Plan(left.start_plan)) == pytest.approx(reward_of(problem, plan) + 0.1 * 0.5)


def test_reasons_name_what_a_visit_more_would_bring():
    problem = village(max_steps=2)
    south = next(u for u in explain(problem, Plan(((3,), (0,)))).unmet if u.target_id == "south")
    assert south.code == "step_limit"
    wide = village(uavs=(replace(village().uavs[0], capacity=9.0),), max_steps=3)
    south = next(u for u in explain(wide, Plan(((3,), (0,)))).unmet if u.target_id == "south")
    assert (south.code, south.uav_id, south.step) == ("not_chosen", "u1", 2)
    more = reward_of(wide, Plan(((3,), (1,), (0,)))) - reward_of(wide, Plan(((3,), (0,))))
    assert south.reward_change == pytest.approx(more)
    another = explain(village(), Plan(((3,), (0,)))).unmet[0]
    assert (another.code, another.uav_id) == ("not_chosen", "u1")
