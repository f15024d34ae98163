"""Reasons where a way over other places can do what a direct flight cannot, and where no leg exists."""

import math

import numpy as np
import pytest
from worlds import random_world

from app.domain.allocation import UnmetCode
from app.domain.matrices import Matrix
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import NoFlyZone
from app.simulation.explain import explain
from app.solvers.greedy import greedy_plan

CHEAP = Objective(distance_weight=0.01)
NEAR = Target("near", 1, 0, level=3.0, loadlist=(1.0,), location=1)
FAR = Target("far", 4, 0, level=1.0, loadlist=(2.0,), location=2)
HAWK = UAV("hawk", 0, 0, 0, 0, speed=1.0, voyage=4.0, loadlist=(2.0,), location=0)
BY_WAY_OF_NEAR = {"road": Matrix([[0.0, 1.0, 9.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0]])}
DETOUR = Problem(uavs=(HAWK,), targets=(NEAR, FAR), matrices=BY_WAY_OF_NEAR, objective=CHEAP)


def reasons(problem, rows):
    return {each.target_id: each for each in explain(problem, Plan(rows)).unmet}


def test_no_reason_says_that_nobody_gets_where_the_plan_has_somebody():
    far = reasons(DETOUR, ((0,), (1,)))["far"]
    assert far.code is UnmetCode.LOADS_USED
    assert far.remedy == "1 of material 1 more aboard hawk, which flies there anyway"


def test_nobody_has_looked_any_further_where_the_plan_has_somebody():
    plan = Plan(((0,), (1,)))
    (far,) = explain(DETOUR, plan, hurry=lambda: True).unmet
    assert (far.code, far.uav_id, far.verified) == (UnmetCode.NOT_CHOSEN, "hawk", False)


def test_a_reason_of_range_says_that_it_is_about_a_direct_flight():
    far = reasons(DETOUR, ((0,),))["far"]
    assert far.reason.endswith(
        "no UAV that carries any of it has the range on a direct flight: hawk comes closest and lacks 6"
    )


@pytest.mark.parametrize(
    "surroundings",
    [
        {"no_fly_zones": (NoFlyZone("z", ((3.0, -1.0), (5.0, -1.0), (5.0, 1.0), (3.0, 1.0))),)},
        {"matrices": {"road": Matrix([[0.0, 1.0, 1.0], [1.0, 0.0, None], [1.0, None, 0.0]])}},
    ],
)
def test_no_range_makes_up_for_a_leg_that_does_not_exist(surroundings):
    places = {} if "matrices" in surroundings else {"location": None}
    problem = Problem(
        uavs=(UAV("hawk", 0, 0, 0, 0, speed=1.0, voyage=10.0, loadlist=(1.0,), **places or {"location": 0}),),
        targets=tuple(
            Target(each.id, each.x, each.y, level=each.level, loadlist=(1.0,), **places or {"location": j})
            for j, each in enumerate((NEAR, FAR), 1)
        ),
        objective=CHEAP,
        **surroundings,
    )
    far = reasons(problem, ((0,),))["far"]
    assert (far.remedy, far.relaxation) == (None, None)


def test_what_a_remedy_asks_for_is_never_beyond_numbers():
    asked = 0
    for seed in range(150):
        problem = random_world(np.random.default_rng(seed))
        for unmet in explain(problem, greedy_plan(problem)).unmet:
            if unmet.relaxation is not None:
                asked += 1
                lengths = [
                    unmet.relaxation.more_range,
                    *(each.by for each in unmet.relaxation.later_deadlines),
                ]
                assert all(math.isfinite(each) and each < 1e12 for each in lengths), (seed, unmet)
    assert asked > 50
