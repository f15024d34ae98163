"""Every reason for an unmet need, on problems where it is known which one holds."""

from dataclasses import replace

import pytest

from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.simulation.explain import explain


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
