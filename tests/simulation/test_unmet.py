"""Every reason for an unmet need, on problems where it is known which one holds."""

import json
from dataclasses import replace

import numpy as np
import pytest
from cases import FOLDER, problem_of
from problems import random_plan, random_problem, strained
from reason_referee import objections

from app.domain.allocation import UnmetCode
from app.domain.errors import IllegalPlan
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record, to_record
from app.simulation.counterfactual import rounded_up
from app.simulation.explain import explain
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan


def problem(**target):
    far = Target(**{"id": "far", "x": 4, "y": 0, "level": 1.0, "loadlist": (2.0, 0.0), **target})
    return Problem(
        uavs=(UAV("u", 0, 0, 0, 0, speed=1.0, voyage=10.0, loadlist=(2.0, 0.0)),),
        targets=(Target("near", 1, 0, level=1.0, loadlist=(1.0, 0.0)), far),
        objective=Objective(distance_weight=0.01),
    )


def reason_for_far(case, rows):
    unmet = {u.target_id: u for u in explain(case, Plan(rows)).unmet}
    return unmet["far"]


@pytest.mark.parametrize(
    ("target", "code", "number"),
    [
        ({"loadlist": (0.0, 1.0)}, "no_supply", "no UAV"),
        ({"x": 6}, "out_of_range", "lacks 2"),
        ({"deadline": 3.0}, "deadline", "1 after"),
        ({}, "not_chosen", "earn 0.47"),
        ({"level": 0.01}, "not_worth_it", "cost 0.025 more"),
    ],
)
def test_reason_when_one_uav_served_the_other_area(target, code, number):
    # After near, u has 1 left of what far needs: one more visit earns level * 1/2 - 0.01 * 3.
    found = reason_for_far(problem(**target), ((0,), (2,)))
    assert found.code == code
    assert number in found.reason


def test_loads_used_up_elsewhere():
    case = problem()
    case = replace(case, targets=(replace(case.targets[0], loadlist=(2.0, 0.0)), case.targets[1]))
    assert reason_for_far(case, ((0,),)).code == "loads_used"


def test_step_limit():
    assert reason_for_far(replace(problem(), max_steps=1), ((0,),)).code == "step_limit"


def test_a_fully_served_area_is_not_listed():
    assert [u.target_id for u in explain(problem(), Plan(((1,),))).unmet] == ["near"]


def test_the_range_that_is_missing_for_one_more_visit():
    # near and far are both in range, but not one after the other: near, far and home are 1 + 5 + 4.
    uav = UAV("u", 0, 0, 0, 0, speed=1.0, voyage=9.0, loadlist=(3.0, 0.0))
    found = reason_for_far(replace(problem(x=-4), uavs=(uav,)), ((0,),))
    assert (found.code, found.uav_id, found.remedy) == ("range_used", "u", "range +1 of u")
    assert found.reward_change == pytest.approx(1 - 0.01 * 5)
    assert found.verified is True


def test_one_more_load_would_do():
    # far gets 1 of 2 before the range and the steps are used up; there is nothing left to bring.
    found = reason_for_far(replace(problem(), max_steps=2), ((0,), (1,)))
    assert (found.code, found.verified) == ("loads_used", True)
    assert found.remedy == "1 of material 1 more aboard u, which flies there anyway"
    assert found.reward_change == pytest.approx(0.5)


FIRST_EDITION = {
    UnmetCode.NO_SUPPLY,
    UnmetCode.OUT_OF_RANGE,
    UnmetCode.DEADLINE,
    UnmetCode.STEP_LIMIT,
    UnmetCode.RANGE_USED,
    UnmetCode.TIME_USED,
    UnmetCode.LOADS_USED,
    UnmetCode.NOT_WORTH_IT,
    UnmetCode.NOT_CHOSEN,
}
"""Reasons of problems without waiting, zones, wind, skills and other limits."""


def record(case, answer):
    """Problem and answer as a client has them."""
    problem, told = problem_to_record(case), to_record(answer)
    told["assignment"] = told.pop("plan")["assignment"]
    return problem, told


def objections_to(case, plan):
    """Everything that contradicts the reasons of an answer, and the codes of all."""
    problem, answer = record(case, explain(case, plan))
    found = {unmet["target_id"]: objections(problem, answer, unmet) for unmet in answer["unmet"]}
    return {name: each for name, each in found.items() if each}, answer["unmet"]


@pytest.mark.parametrize(("unloading", "problems"), [("greedy", 260), ("planned", 120)])
def test_no_single_visit_contradicts_a_reason_and_every_remedy_works(unloading, problems):
    rng = np.random.default_rng(23)
    codes = set()
    for number in range(problems):
        case = random_problem(rng)
        if number % 5:
            case = strained(case, rng)
        plan = greedy_plan(case) if number % 2 else random_plan(case, rng)
        case = replace(case, objective=replace(case.objective, unloading=unloading))
        try:
            wrong, unmet = objections_to(case, plan)
        except IllegalPlan:  # under planned unloading a visit of the greedy rule may be of no use
            continue
        assert not wrong, number
        assert all(each["verified"] for each in unmet)
        codes.update(each["code"] for each in unmet)
    rare = {UnmetCode.RANGE_USED, UnmetCode.TIME_USED}
    assert codes >= (FIRST_EDITION if unloading == "greedy" else FIRST_EDITION - rare)


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("reason-false-*.json")))
def test_reasons_that_were_false(name):
    given = json.loads((FOLDER / f"{name}.json").read_text())
    plan = Plan(tuple(tuple(row) for row in given["answer_assignment"]))
    wrong, unmet = objections_to(problem_of(name), plan)
    assert not wrong
    assert unmet


def test_time_that_is_used_up_is_not_called_loads():
    wrong, (unmet,) = objections_to(problem_of("F5a-time-named-loads"), Plan(((0,),)))
    assert not wrong
    assert (unmet["code"], unmet["uav_id"], unmet["step"], unmet["verified"]) == ("time_used", "u", 2, True)
    assert unmet["remedy"] == "a deadline 102 later for b"
    assert unmet["relaxation"]["later_deadlines"] == [{"target_id": "b", "by": 102.0}]
    assert "102 after the deadline" in unmet["reason"]


def test_time_used_names_the_deadline_of_the_visit_that_would_come_too_late():
    # After near, far is reached at 5 and not at 4; after far, near is reached at 7 and not at 6.
    uav = UAV("u", 0, 0, 0, 0, speed=1.0, voyage=9.0, loadlist=(3.0, 0.0))
    case = replace(problem(x=-3, deadline=4.0), uavs=(uav,), objective=Objective(distance_weight=0.0))
    case = replace(case, targets=(replace(case.targets[0], deadline=6.0), case.targets[1]))
    wrong, (unmet,) = objections_to(case, Plan(((0,),)))
    assert not wrong
    assert unmet["code"] == "time_used"
    assert unmet["relaxation"]["later_deadlines"] == [{"target_id": "near", "by": 1.0}]
    assert "1 after the deadline of near" in unmet["reason"]


def test_a_visit_after_which_another_uav_comes_first():
    # When second flies to aside first, first is before it at shared, and second need not fly there at all.
    uavs = (
        UAV("first", 0, 0, 0, 0, speed=1.0, voyage=99.0, loadlist=(5.0, 0.0)),
        UAV("second", 0, 0, 0, 0, speed=1.0, voyage=99.0, loadlist=(3.0, 1.0)),
    )
    targets = (
        Target("own", 1, 0, level=1.0, loadlist=(1.0, 0.0)),
        Target("shared", 9, 0, level=1.0, loadlist=(4.0, 0.0)),
        Target("aside", 0, 1, level=0.01, loadlist=(0.0, 1.0)),
    )
    case = Problem(uavs=uavs, targets=targets, objective=Objective(distance_weight=0.1))
    wrong, (unmet,) = objections_to(case, Plan(((0, 1), (1, 3))))
    assert not wrong
    assert (unmet["code"], unmet["uav_id"], unmet["step"]) == ("not_chosen", "second", 1)
    assert unmet["reward_change"] == pytest.approx(0.01 - 0.1 * 1 + 0.1 * 9)


def test_an_area_that_got_nearly_all_says_how_much_is_missing_and_who_could_bring_it():
    uavs = (UAV("mid-2", 0, 0, 0, 0, speed=1.0, voyage=9.0, loadlist=(80.0,)),)
    case = Problem(uavs=uavs, targets=(Target("site-9", 1, 0, level=1.0, loadlist=(82.0,)),))
    wrong, (unmet,) = objections_to(case, Plan(((0,),)))
    assert not wrong
    assert unmet["reason"].startswith("2 of 82 of material 1 missing: ")
    assert unmet["remedy"] == "2 of material 1 more aboard mid-2, which flies there anyway"
    assert unmet["reward_change"] == pytest.approx(2 / 82)


def test_a_gain_that_is_small_beside_the_reward_of_other_areas_is_a_gain():
    uavs = (UAV("u", 0, 0, 0, 0, speed=1.0, voyage=9.0, loadlist=(2.0,)),)
    targets = (
        Target("vast", 1, 0, level=1e12, loadlist=(1.0,)),
        Target("tiny", 1, 1, level=1e-12, loadlist=(1.0,)),
    )
    case = Problem(uavs=uavs, targets=targets, objective=Objective(distance_weight=0.0))
    (unmet,) = explain(case, Plan(((0,),))).unmet
    assert (unmet.code, unmet.reward_change) == ("not_chosen", pytest.approx(1e-12))


@pytest.mark.parametrize("name", ["F3a-ten-tenths", "F3c-crumb-two-areas"])
def test_what_is_met_in_full_is_not_listed(name):
    case = problem_of(name)
    assert [unmet.target_id for unmet in explain(case, greedy_plan(case)).unmet] == [
        target.id for target in case.targets if target.id == "far"
    ]


@pytest.mark.parametrize(
    ("amount", "figure"),
    [(2.0, 2.0), (2.0000000000000004, 2.0), (1.23456712, 1.23457), (1.2345611, 1.23457), (0.0, 0.0)],
)
def test_figures_of_remedies_are_rounded_up(amount, figure):
    assert rounded_up(amount) == figure


def test_of_very_many_the_most_urgent_are_verified(monkeypatch):
    monkeypatch.setattr("app.simulation.openings._WORK", 200)
    case = generate("uniform", 3, 30, 2, np.random.default_rng(2))
    unmet = explain(case, greedy_plan(case)).unmet
    assert {u.verified for u in unmet} == {True, False}
    assert all(u.reward_change is None for u in unmet if not u.verified)


@pytest.mark.parametrize("asks", [0, 1, 4])
def test_in_a_hurry_the_plan_is_told_whole_and_no_reason_claims_what_nobody_looked_at(asks):
    rng = np.random.default_rng(31)
    codes = set()
    for _ in range(30):
        case = random_problem(rng)
        plan = greedy_plan(case)
        whole, asked = explain(case, plan), iter(range(asks))
        hasty = explain(case, plan, lambda asked=asked: next(asked, None) is None)
        assert (hasty.routes, hasty.reward) == (whole.routes, whole.reward)
        for short, long in zip(hasty.unmet, whole.unmet, strict=True):
            assert (short.target_id, short.remaining) == (long.target_id, long.remaining)
            if long.code in ("no_supply", "out_of_range", "deadline"):
                assert (short.code, short.reason) == (long.code, long.reason)
            elif not short.verified:
                codes.add(short.code)
                assert short.remedy is None
                assert (short.code, short.relaxation, short.reward_change) == ("not_chosen", None, None)
    if asks == 0:
        assert codes == {"not_chosen"}
