"""Every reason for an unmet need, on problems where it is known which one holds."""

from dataclasses import replace

import numpy as np
import pytest
from problems import random_problem

from app.domain.errors import IllegalPlan
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.simulation.explain import explain, reward_of
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
    assert found.reward_change == pytest.approx((2 - 0.01 * 9) - (1 - 0.01))
    assert found.verified is True


def test_one_more_load_would_do():
    # far gets 1 of 2 before the range and the steps are used up; there is nothing left to bring.
    found = reason_for_far(replace(problem(), max_steps=2), ((0,), (1,)))
    assert (found.code, found.verified) == ("loads_used", True)
    assert found.remedy == "1 of material 1 more aboard u, one more decision step"
    assert found.reward_change == pytest.approx(0.5)


def relaxed(case, unmet):
    """The problem with the remedy of a hard reason."""
    index = [u.id for u in case.uavs].index(unmet.uav_id)
    uav, uavs, targets = case.uavs[index], list(case.uavs), list(case.targets)
    amount = float(unmet.reason.split()[-1 if unmet.code == "out_of_range" else -4]) * (1 + 1e-5)
    if unmet.code == "out_of_range":
        uavs[index] = replace(uav, voyage=uav.voyage + amount)
    else:
        j = [t.id for t in targets].index(unmet.target_id)
        targets[j] = replace(targets[j], deadline=targets[j].deadline + amount)
    return replace(case, uavs=tuple(uavs), targets=tuple(targets)), index


@pytest.mark.parametrize("unloading", ["greedy", "planned"])
def test_what_is_said_of_random_plans_holds(unloading):
    rng = np.random.default_rng(23)
    codes = set()
    for _ in range(120):
        case = random_problem(rng)
        plan = greedy_plan(case)
        case = replace(case, objective=replace(case.objective, unloading=unloading))
        try:
            answer = explain(case, plan)
        except IllegalPlan:  # under planned unloading a visit of the greedy rule may be of no use
            continue
        for unmet in answer.unmet:
            codes.add(unmet.code)
            if unmet.code == "not_chosen":
                assert unmet.verified
                assert unmet.reward_change > 0
            if unmet.code in ("not_worth_it", "loads_used") and unmet.verified:
                assert (unmet.reward_change > 0) == (unmet.remedy is not None)
            if unmet.code in ("range_used", "step_limit"):
                assert unmet.verified
                assert unmet.reward_change > 0
            if unmet.code in ("out_of_range", "deadline"):
                easier, index = relaxed(case, unmet)
                j = [t.id for t in case.targets].index(unmet.target_id)
                row = [case.n_targets] * case.n_uavs
                row[index] = j
                assert reward_of(easier, Plan((tuple(row),))) is not None
                with pytest.raises(IllegalPlan):
                    reward_of(case, Plan((tuple(row),)))
    assert {"not_worth_it", "out_of_range", "deadline", "loads_used"} <= codes


def test_of_very_many_the_most_urgent_are_verified(monkeypatch):
    monkeypatch.setattr("app.simulation.counterfactual._WORK", 200)
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
                assert short.code == "not_chosen" or "guessed" in short.reason or "used" in short.reason
    if asks == 0:
        assert codes == {"not_chosen"}
