"""`requested`: shares are shares of what was asked for at first."""

from dataclasses import replace

import numpy as np
import pytest
from problems import random_problem
from referee import replay

from app.api.problem_models import ProblemModel, to_problem
from app.domain.errors import InvalidProblem
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.domain.records import problem_from_record, problem_to_record
from app.library.summary import task_summary
from app.settings import Settings
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.explain import explain
from app.solvers.greedy import greedy_plan
from app.solvers.unloading.solver import without_useless


def partly_served(rng):
    """A random problem in which some of what was requested is there already, and one that asks for the rest.

    The other has levels for what is left, so both must earn the same with the same plans.
    """
    problem = random_problem(rng)
    began, rest = [], []
    for target in problem.targets:
        needs = target.loadlist
        there = rng.uniform(0, 5, problem.n_materials) * (rng.random(problem.n_materials) < 0.5)
        if rng.random() < 0.15:
            needs = (0.0,) * problem.n_materials
            there = rng.uniform(0.1, 5, problem.n_materials)
        asked = tuple(float(n + t) for n, t in zip(needs, there, strict=True))
        share = sum(needs) / sum(asked) if sum(asked) else 1.0
        began.append(replace(target, loadlist=needs, requested=asked))
        rest.append(replace(target, loadlist=needs, level=target.level * share))
    return replace(problem, targets=tuple(began)), replace(problem, targets=tuple(rest))


def test_a_visit_earns_by_the_share_of_what_was_requested():
    problem = to_problem(
        ProblemModel(
            **{
                "uavs": [{"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [2, 9]}],
                "targets": [
                    {"x": 1, "y": 0, "level": 10, "loadlist": [2, 0], "requested": [50, 32]},
                    {"x": 1, "y": 0, "level": 1, "loadlist": [0, 9]},
                ],
                "objective": {"distance_weight": 0},
            }
        ),
        Settings(),
    )
    answer = explain(problem, greedy_plan(problem))
    # The area that has 80 of 82 earns 10 * 2 / 82, less than the other one, which is served first.
    assert answer.reward == pytest.approx(10 * 2 / 82 + 1)
    assert answer.plan.assignment == ((1,), (0,))
    assert answer.unmet == ()


def test_the_referee_agrees_and_an_equal_problem_earns_the_same():
    rng = np.random.default_rng(3)
    flown = 0
    for _ in range(150):
        began, rest = partly_served(rng)
        plan = greedy_plan(began)
        flown += len(plan.assignment)
        expected = replay(problem_to_record(began), plan.assignment)
        answer = explain(began, plan)
        assert answer.reward == pytest.approx(expected["reward"], abs=1e-9)
        assert answer.reward == pytest.approx(reward_of(rest, plan), abs=1e-9)
        np.testing.assert_allclose(task_summary(began), task_summary(rest), atol=1e-9)
        left = {unmet.target_id: unmet.remaining for unmet in answer.unmet}
        for target, remaining in zip(began.targets, expected["remaining"], strict=True):
            assert left.get(target.id, (0.0,) * began.n_materials) == pytest.approx(remaining, abs=1e-9)
    assert flown > 150


def test_planned_unloading_goes_by_the_same_shares():
    rng = np.random.default_rng(4)
    for _ in range(60):
        began, rest = (
            replace(each, objective=replace(each.objective, unloading="planned"))
            for each in partly_served(rng)
        )
        greedy = greedy_plan(replace(began, objective=replace(began.objective, unloading="greedy")))
        plan = Plan.of(without_useless(compile_problem(began), greedy.as_array()), began.n_targets)
        answer = explain(began, plan)
        assert answer.reward == pytest.approx(reward_of(rest, plan), abs=1e-9)
        given = np.zeros((len(plan.assignment), began.n_uavs, began.n_materials))
        for i, route in enumerate(answer.routes):
            for stop in route.stops:
                given[stop.step - 1, i] = stop.delivered
        expected = replay(problem_to_record(began), plan.assignment, given.tolist())
        assert answer.reward == pytest.approx(expected["reward"], abs=1e-9)


def test_what_is_needed_cannot_exceed_what_was_requested():
    problem = random_problem(np.random.default_rng(1))
    needy = replace(problem.targets[0], loadlist=(3.0,) * problem.n_materials)
    for requested, pointer, said in (
        ((2.5,) * problem.n_materials, "/targets/0/requested/0", "2.5 is less than the 3 still needed"),
        ((3.0,) * (problem.n_materials + 1), "/targets/0/requested", "amounts"),
        ((-1.0,) * problem.n_materials, "/targets/0/requested/0", "-1 is not in 0"),
        ((float("nan"),) * problem.n_materials, "/targets/0/requested/0", "not a finite number"),
    ):
        with pytest.raises(InvalidProblem) as refused:
            replace(problem, targets=(replace(needy, requested=requested), *problem.targets[1:]))
        assert refused.value.violations[0].pointer == pointer
        assert said in refused.value.violations[0].detail
    # Amounts that were subtracted from each other may differ by their rounding.
    replace(problem, targets=(replace(needy, requested=(3.0 - 1e-12,) * problem.n_materials),))


def test_a_record_keeps_it_and_one_from_before_lacks_it():
    began, _ = partly_served(np.random.default_rng(2))
    record = problem_to_record(began)
    assert problem_from_record(record) == began
    for target in record["targets"]:
        del target["requested"]
    assert all(target.requested is None for target in problem_from_record(record).targets)


def test_the_default_is_the_same_problem_written_out_or_not():
    target = {"x": 1, "y": 0, "level": 1, "loadlist": [2, 3]}
    body = {"uavs": [{"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [2, 1]}]}
    plain, written = (
        to_problem(ProblemModel(**body, targets=[target | more]), Settings())
        for more in ({}, {"requested": [2, 3]})
    )
    assert plain == written


def test_a_met_area_needs_nothing_and_does_not_set_the_scale():
    began, _ = partly_served(np.random.default_rng(5))
    met = replace(
        began.targets[0],
        level=1e9,
        loadlist=(0.0,) * began.n_materials,
        requested=(1.0,) * began.n_materials,
    )
    arrays = compile_problem(Problem(began.uavs, (met, *began.targets[1:])))
    assert (arrays.areas["need_total"][0, 0], arrays.areas["level"][0, 0]) == (0.0, 0.0)


def test_a_need_that_is_rounding_of_what_was_requested_is_none():
    began, _ = partly_served(np.random.default_rng(6))
    crumb = replace(
        began.targets[0],
        loadlist=(5e-8,) * began.n_materials,
        requested=(100.0,) * began.n_materials,
    )
    assert crumb.need == (0.0,) * began.n_materials
    assert (
        compile_problem(replace(began, targets=(crumb, *began.targets[1:]))).areas["need_total"][0, 0] == 0.0
    )
