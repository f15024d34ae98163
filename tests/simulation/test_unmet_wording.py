"""Reasons for unmet needs and their remedies as people read them: names, and units on the globe."""

from dataclasses import replace

import pytest

from app.domain.allocation import UnmetCode
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Material, Wind
from app.simulation.explain import explain

KESTREL = UAV("u", 0, 0, 0, 0, speed=100.0, voyage=400.0, loadlist=(5.0,), name="Kestrel")
VILLAGE = Target("a", 1.0, 0, level=1.0, loadlist=(3.0,), name="Village")
NOBODY_FLIES = Plan(((1,),))
GLOBE = Problem(uavs=(KESTREL,), targets=(VILLAGE,), crs="wgs84", objective=Objective(distance_weight=0.0001))
DEGREE_KM = 111.19


def only(problem, plan=NOBODY_FLIES):
    (unmet,) = explain(problem, plan).unmet
    return unmet


def test_what_range_lacks_is_in_km_and_the_uav_has_its_name():
    unmet = only(replace(GLOBE, uavs=(replace(KESTREL, voyage=200.0),)))
    lacks = 2 * DEGREE_KM - 200.0
    assert unmet.relaxation is not None
    written = f"{unmet.relaxation.more_range:.6g} km"
    assert abs(unmet.relaxation.more_range - lacks) < 1.0
    assert unmet.reason.endswith(f"Kestrel comes closest and lacks {written}")
    assert unmet.remedy is not None
    assert unmet.remedy.startswith(f"range +{written} of Kestrel")


def test_what_comes_too_late_is_in_hours_and_minutes():
    unmet = only(replace(GLOBE, targets=(replace(VILLAGE, deadline=0.75),)))
    assert unmet.reason.endswith(
        "the fastest UAV that could serve it, Kestrel, would arrive 0:22 h after its deadline"
    )
    assert unmet.remedy == "a deadline 0:22 h later for Village"


def test_a_time_below_half_a_minute_is_no_zero():
    unmet = only(replace(GLOBE, targets=(replace(VILLAGE, deadline=DEGREE_KM / 100 - 0.004),)))
    assert unmet.reason.split("would arrive ")[1].startswith("0.00")


def test_speeds_have_their_unit():
    unmet = only(replace(GLOBE, wind=Wind(120.0, 90.0)))
    assert unmet.reason.endswith(
        "a wind of 120 km/h is too strong to fly there and home from there at the speed of Kestrel, 100 km/h"
    )


def test_materials_have_their_names():
    named = replace(GLOBE, materials=(Material("cholera kits"),), uavs=(replace(KESTREL, loadlist=(2.0,)),))
    unmet = only(named, Plan(((0,),)))
    assert unmet.reason.startswith("1 of 3 of cholera kits missing: ")
    assert unmet.remedy == "1 of cholera kits more aboard Kestrel, which flies there anyway"


def test_numbers_on_a_plane_have_no_units():
    unmet = only(replace(GLOBE, crs="local", targets=(replace(VILLAGE, x=250.0),)))
    assert unmet.reason.endswith("Kestrel comes closest and lacks 100")


@pytest.mark.parametrize("unloading", ["greedy", "planned"])
def test_what_the_end_of_a_plan_costs_counts_for_one_more_visit(unloading):
    # It is 3 away and earns 2; the swarm is home 6 later, at 1 each.
    objective = Objective(distance_weight=0.0, unloading=unloading, makespan_weight=1.0)
    uav = UAV("u1", 0, 0, 0, 0, 1.0, 10.0, (5.0,))
    problem = Problem(uavs=(uav,), targets=(Target("a", 3, 0, 2.0, (5.0,)),), objective=objective)
    (unmet,) = explain(problem, Plan.empty(1, 1)).unmet
    assert (unmet.code, unmet.reward_change) == (UnmetCode.NOT_WORTH_IT, -4.0)
    assert unmet.reason.endswith("one more visit by u1, first, would cost 4 more than it earns")
    changed = replace(objective, makespan_weight=0.0, change_weight=1.0)
    (unmet,) = explain(replace(problem, objective=changed, start_plan=((0,),)), Plan.empty(1, 1)).unmet
    assert (unmet.code, unmet.reward_change) == (UnmetCode.NOT_CHOSEN, 3.0)
