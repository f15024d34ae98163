"""What a problem refuses, and what it works out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.domain.errors import InvalidProblem
from app.domain.fields import MAX_MAGNITUDE, declared_fields
from app.domain.geometry import distance, distances
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_from_record, problem_to_record

BASE = Problem(
    uavs=(
        UAV("a", 0, 0, 0, 0, speed=1.0, voyage=5.0, loadlist=(1.0, 2.0)),
        UAV("b", 3, 0, 3, 0, speed=1.0, voyage=5.0, loadlist=(1.0, 2.0)),
    ),
    targets=(Target("x", 0, 4, level=1.0, loadlist=(1.0, 0.0)),),
)


def with_uav(**change):
    return {"uavs": (BASE.uavs[0], replace(BASE.uavs[1], **change))}


def with_target(**change):
    return {"targets": (replace(BASE.targets[0], **change),)}


@pytest.mark.parametrize(
    ("change", "pointer", "said"),
    [
        ({"uavs": ()}, "/uavs", "0 UAVs"),
        ({"targets": ()}, "/targets", "0 targets"),
        ({"max_steps": 0}, "/max_steps", "0 is not in 1..100"),
        ({"max_steps": 101}, "/max_steps", "101"),
        ({"crs": "mars"}, "/crs", "'mars'"),
        ({"objective": Objective(distance_weight=-1.0)}, "/objective/distance_weight", "-1"),
        (with_uav(id="a"), "/uavs/1/id", "'a' is already the id of number 0"),
        (with_uav(id=""), "/uavs/1/id", "0 characters"),
        (with_uav(id="x" * 101), "/uavs/1/id", "101 characters"),
        (with_uav(id="\ud800"), "/uavs/1/id", "half of a surrogate pair"),
        (with_uav(speed=0.0), "/uavs/1/speed", "0 is not in 1e-100"),
        (with_uav(speed=-2.0), "/uavs/1/speed", "-2"),
        (with_uav(voyage=-1.0), "/uavs/1/voyage", "-1"),
        (with_uav(dis=-0.5), "/uavs/1/dis", "-0.5"),
        (with_uav(x_s=math.nan), "/uavs/1/x_s", "nan"),
        (with_uav(y_c=math.inf), "/uavs/1/y_c", "inf"),
        (with_uav(x_c=2 * MAX_MAGNITUDE), "/uavs/1/x_c", "2e+12"),
        (with_uav(loadlist=(1.0,)), "/uavs/1/loadlist", "1 amounts"),
        (with_uav(loadlist=(1.0, -1.0)), "/uavs/1/loadlist/1", "-1"),
        (with_target(loadlist=(1.0, 2.0, 3.0)), "/targets/0/loadlist", "3 amounts"),
        (with_target(level=-1.0), "/targets/0/level", "-1"),
        (with_target(deadline=math.nan), "/targets/0/deadline", "nan"),
        (with_target(service_time=-1.0), "/targets/0/service_time", "-1"),
        ({"crs": "wgs84", **with_target(y=91.0)}, "/targets/0/y", "91 is not in -90..90"),
        ({"crs": "wgs84", **with_uav(x_s=-181.0)}, "/uavs/1/x_s", "-181"),
    ],
)
def test_a_broken_rule_is_refused_where_it_is_broken(change, pointer, said):
    with pytest.raises(InvalidProblem) as caught:
        replace(BASE, **change)
    (violation,) = caught.value.violations
    assert violation.pointer == pointer
    assert said in violation.detail


def test_every_broken_rule_is_listed():
    with pytest.raises(InvalidProblem, match="and 2 more") as caught:
        replace(BASE, max_steps=0, **with_uav(speed=-1.0, id="a"))
    assert {v.pointer for v in caught.value.violations} == {"/max_steps", "/uavs/1/speed", "/uavs/1/id"}


def test_no_materials_are_refused():
    with pytest.raises(InvalidProblem, match="0 materials"):
        Problem(
            uavs=tuple(replace(u, loadlist=()) for u in BASE.uavs),
            targets=(replace(BASE.targets[0], loadlist=()),),
        )


def test_extent_and_sizes():
    assert (BASE.n_uavs, BASE.n_targets, BASE.n_materials) == (2, 1, 2)
    assert BASE.extent == pytest.approx(5.0)
    assert BASE.distance_weight == pytest.approx(0.2)
    assert replace(BASE, objective=Objective(distance_weight=0.0)).distance_weight == 0.0


points = st.tuples(st.floats(-180, 180), st.floats(-90, 90))


@given(crs=st.sampled_from(["local", "wgs84"]), a=points, b=points)
def test_a_distance_is_the_same_alone_and_in_a_matrix(crs, a, b):
    alone = distance(crs, *a, *b)
    matrix = distances(crs, np.array([a]), np.array([b]))
    assert matrix[0, 0] == pytest.approx(alone, rel=1e-9, abs=1e-9)
    assert alone == pytest.approx(distance(crs, *b, *a), rel=1e-9, abs=1e-9)


def test_antipodes_are_half_the_circumference_apart():
    assert distance("wgs84", 0, 0, 180, 0) == pytest.approx(math.pi * 6371.0088)


def test_a_record_has_all_but_defaults_that_never_change_and_comes_back_equal():
    problem = replace(BASE, uavs=(replace(BASE.uavs[0], ret=True, dis=1.0), BASE.uavs[1]))
    record = problem_to_record(problem)
    assert record["uavs"][0]["ret"] == 1
    for part, recorded in ((problem.uavs[0], record["uavs"][0]), (problem.objective, record["objective"])):
        declared = {field.name: field for field in declared_fields(type(part))}
        assert recorded.keys() == {name for name, field in declared.items() if field.always_recorded}
        assert all(
            getattr(part, name) == field.default for name, field in declared.items() if name not in recorded
        )
    assert problem_from_record(record) == problem


def test_a_plan_ends_with_its_last_visit():
    assert Plan.of([[0, 1], [1, 1], [1, 1]], home=1).assignment == ((0, 1),)
    assert Plan.of([[1, 1]], home=1).assignment == ((1, 1),)
    assert Plan.empty(3, 2).assignment == ((2, 2, 2),)
