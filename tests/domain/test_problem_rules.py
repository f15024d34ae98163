"""Rules between the fields of a problem: refused where they are broken, and what obeys them is taken."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from problem_changes import BASE, SQUARE, violations

from app.domain.matrices import Matrix
from app.domain.problem import Objective
from app.domain.records import problem_from_record, problem_to_record
from app.domain.surroundings import Material, NoFlyZone, Wind

LEGS = Matrix([[0.0, 1.0, 2.0], [1.0, 0.0, None], [2.5, 1.0, 0.0]])


def with_uav(**change):
    return {"uavs": (BASE.uavs[0], replace(BASE.uavs[1], **change))}


def on_legs(problem=BASE, matrices=None, uav=None, target=None):
    """The changes by which a problem has matrices, and its last UAV and target some fields more."""
    first, second = (replace(each, location=0) for each in problem.uavs)
    one, other = (replace(each, location=1) for each in problem.targets)
    return {
        "matrices": matrices or {"road": LEGS},
        "uavs": (first, replace(second, **(uav or {}))),
        "targets": (one, replace(other, **(target or {}))),
    }


@pytest.mark.parametrize(
    ("change", "pointer", "said"),
    [
        # One field alone.
        (with_uav(endurance=0.0), "/uavs/1/endurance", "0 is not in 1e-100"),
        (with_uav(airborne=-1.0), "/uavs/1/airborne", "-1"),
        (with_uav(reserve=1.0), "/uavs/1/reserve", "1 is not from 0 to below 1"),
        (with_uav(reserve=-0.5), "/uavs/1/reserve", "-0.5"),
        (with_uav(reserve=math.nan), "/uavs/1/reserve", "nan"),
        (with_uav(available_from=-1.0), "/uavs/1/available_from", "-1"),
        (with_uav(available_until=math.inf), "/uavs/1/available_until", "inf"),
        (with_uav(skills=("medic", "")), "/uavs/1/skills/1", "0 characters"),
        (with_uav(name="\n"), "/uavs/1/name", "control character"),
        (with_uav(properties={"a": "b" * 5000}), "/uavs/1/properties", "5008 bytes"),
        ({"wind": Wind(-1.0, 0.0)}, "/wind/speed", "-1"),
        ({"wind": Wind(1.0, 361.0)}, "/wind/towards", "361 is not in -360..360"),
        ({"objective": Objective(half_life=0.0)}, "/objective/half_life", "0"),
        ({"objective": Objective(minimum_share=1.1)}, "/objective/minimum_share", "1.1 is not in 0..1"),
        ({"objective": Objective(minimum_weight=0.9)}, "/objective/minimum_weight", "0.9"),
        ({"materials": (Material("a"), Material("b", -1.0))}, "/materials/1/weight", "-1"),
        # What has to fit.
        ({"materials": (Material("a"),)}, "/materials", "1 materials, but the first UAV carries 2"),
        (with_uav(capacity=2.9), "/uavs/1/capacity", "2.9 is less than the 3 that its `loadlist` weighs"),
        (
            {"materials": (Material("a", 3.0), Material("b", 0.5)), **with_uav(capacity=3.99)},
            "/uavs/1/capacity",
            "3.99 is less than the 4",
        ),
        # Ids.
        (with_uav(excluded=("x", "z")), "/uavs/1/excluded/1", "'z' is no id of the targets"),
        (with_uav(committed=("b",)), "/uavs/1/committed/0", "'b' is no id of the targets"),
        (with_uav(committed=("x", "y", "x")), "/uavs/1/committed/2", "'x' is already number 0"),
        (with_uav(committed=("x", "y"), excluded=("y",)), "/uavs/1/committed/1", "'y' is in `excluded` too"),
        # What excludes or needs something else.
        (
            {"objective": Objective(half_life=1.0, unloading="planned")},
            "/objective/half_life",
            "`half_life` and `unloading`",
        ),
        ({"objective": Objective(change_weight=0.5)}, "/objective/change_weight", "0.5 needs a `start_plan`"),
        ({**on_legs(), "wind": Wind(1.0, 0.0)}, "/wind", "`wind` and `matrices` exclude each other"),
        (
            {**on_legs(), "no_fly_zones": (NoFlyZone("z", SQUARE),)},
            "/no_fly_zones",
            "`no_fly_zones` and `matrices` exclude each other",
        ),
        (with_uav(location=0), "/uavs/1/location", "0 needs `matrices`"),
        (with_uav(home_location=2), "/uavs/1/home_location", "2 needs `matrices`"),
        (with_uav(profile="road"), "/uavs/1/profile", "'road' needs `matrices`"),
        # A plan to begin from.
        ({"start_plan": ()}, "/start_plan", "0 steps, not in 1..2"),
        ({"start_plan": ((0, 0),) * 3}, "/start_plan", "3 steps, not in 1..2"),
        ({"start_plan": ((0, 1), (2,))}, "/start_plan/1", "1 actions, but there are 2 UAVs"),
        ({"start_plan": ((0, 1), (2, 3))}, "/start_plan/1/1", "3 is not in 0..2"),
        ({"start_plan": ((-1, 1),)}, "/start_plan/0/0", "-1 is not in 0..2"),
        # Matrices.
        ({"matrices": {}}, "/matrices", "0 profiles"),
        (on_legs(uav={"location": None}), "/uavs/1/location", "is missing"),
        (on_legs(target={"location": None}), "/targets/1/location", "is missing"),
        (on_legs(uav={"location": 3}), "/uavs/1/location", "3 is not in 0..2"),
        (on_legs(uav={"home_location": 5}), "/uavs/1/home_location", "5 is not in 0..2"),
        (on_legs(target={"location": -1}), "/targets/1/location", "-1 is not in 0.."),
        (on_legs(uav={"profile": "sea"}), "/uavs/1/profile", "'sea' is no profile"),
        (on_legs(matrices={"a/b": Matrix([])}), "/matrices/a~1b/distance", "0 rows"),
        (
            on_legs(matrices={"r": Matrix([[0.0] * 3] * 2)}),
            "/matrices/r/distance/0",
            "3 entries, but there are 2",
        ),
    ],
)
def test_a_broken_rule_is_refused_where_it_is_broken(change, pointer, said):
    at, detail = violations(**change)[0]
    assert at == pointer
    assert said in detail


@pytest.mark.parametrize(
    ("matrices", "pointer", "said"),
    [
        ({"r": LEGS, "s": Matrix(np.zeros((4, 4)))}, "/matrices/s/distance", "4 rows, but 'r' has 3"),
        (
            {"r": Matrix(LEGS.distance, np.zeros((2, 2)))},
            "/matrices/r/duration",
            "2 rows, but its `distance` has 3",
        ),
        ({"r": Matrix([[0.0, 1.0, 2.0], [1.0, -0.5, 2.0], [0.0] * 3])}, "/matrices/r/distance/1/1", "-0.5"),
        ({"r": Matrix([[0.0, 1.0, 2.0], [1.0, 2e12, 2.0], [0.0] * 3])}, "/matrices/r/distance/1/1", "2e+12"),
        (
            {"r": Matrix([[0.0, 1.0, 2.0], [1.0, -math.inf, 2.0], [0.0] * 3])},
            "/matrices/r/distance/1/1",
            "-inf",
        ),
        ({"r": Matrix([[0.0, 1.0, 2.0], [1.0, "2", "a"], [0.0] * 3])}, "/matrices/r/distance/1/1", "'2'"),
        ({"r": Matrix([[0.0], 1.0, 2.0])}, "/matrices/r/distance/0", "1 entries"),
        ({"r": Matrix(5.0)}, "/matrices/r/distance", "no list of rows"),
    ],
)
def test_matrices_are_square_tables_of_one_size(matrices, pointer, said):
    found = dict(violations(**on_legs(matrices=matrices, uav={"profile": "r"})))
    assert said in found[pointer]


def test_of_several_profiles_each_uav_names_one():
    several = {"road": LEGS, "river": Matrix(LEGS.distance, LEGS.distance * 2)}
    assert violations(**on_legs(matrices=several)) == [
        (f"/uavs/{i}/profile", "is missing; the `matrices` have several: 'road', 'river'") for i in (0, 1)
    ]
    change = on_legs(matrices=several, uav={"profile": "river"})
    first = replace(change["uavs"][0], profile="road")
    replace(BASE, **{**change, "uavs": (first, change["uavs"][1])})


def test_a_load_may_weigh_more_than_the_capacity_by_rounding():
    loads = (0.1, 0.2)
    assert sum(loads) > 0.3
    replace(BASE, **with_uav(loadlist=loads, capacity=0.3))
    replace(BASE, **with_uav(capacity=3.0 * (1 - 0.9e-9)))


def test_more_promises_than_steps_and_other_oddities_are_taken():
    problem = replace(BASE, max_steps=1, **with_uav(committed=("x", "y"), available_until=-3.0))
    assert problem.uavs[1].committed == ("x", "y")


def test_matrices_hold_what_was_given_and_cannot_be_changed():
    matrix = Matrix([[0, None], [2.0, 1e-200]], duration=[[0, 1], [math.nan, math.inf]])
    assert matrix.distance.tolist() == [[0.0, math.inf], [2.0, 0.0]]
    assert matrix.duration.tolist() == [[0.0, 1.0], [math.inf, math.inf]]
    assert matrix.distance.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        matrix.distance[0, 0] = 1.0
    assert matrix == Matrix([[0.0, math.inf], [2.0, 0.0]], [[0.0, 1.0], [None, None]])
    assert matrix != Matrix(matrix.distance)
    assert matrix != Matrix(matrix.distance, matrix.distance)
    assert hash(matrix) == hash(Matrix(matrix.distance, matrix.duration))


def test_extent_of_matrices_is_the_longest_leg_of_any_profile():
    several = {"road": LEGS, "river": Matrix([[0.0, 7.0, None]] * 3)}
    change = on_legs(matrices=several, uav={"profile": "river"})
    problem = replace(
        BASE, **{**change, "uavs": (replace(change["uavs"][0], profile="road"), change["uavs"][1])}
    )
    assert problem.extent == 7.0
    assert problem.distance_weight == 1 / 7.0
    assert replace(BASE, **on_legs(matrices={"r": Matrix(np.zeros((3, 3)))})).extent == 1.0
    assert replace(BASE, **on_legs(matrices={"r": Matrix([[None] * 3] * 3)})).extent == 1.0


def test_weights_are_those_of_the_materials_or_one():
    assert BASE.weights == (1.0, 1.0)
    assert replace(BASE, materials=(Material("a", 2.0), Material("a", 0.0))).weights == (2.0, 0.0)


FULL = replace(
    BASE,
    uavs=(
        replace(
            BASE.uavs[0], endurance=3.0, airborne=1.0, reserve=0.25, available_from=1.0, available_until=9.0,
            capacity=4.0, skills=("medic",), excluded=("x",), committed=("y",), name="Kestrel",
            properties={"key": [1, {"a": None}]},
        ),
        BASE.uavs[1],
    ),
    targets=(
        replace(BASE.targets[0], earliest=1.0, skills=("medic", "dry"), name="Village", properties={"n": 1}),
        BASE.targets[1],
    ),
    objective=Objective(
        half_life=2.0, minimum_share=0.5, minimum_weight=3.0, makespan_weight=0.1, change_weight=0.2
    ),
    materials=(Material("water", 1.5), Material("food")),
    no_fly_zones=(NoFlyZone("z", SQUARE, "Airport", {"k": "v"}), NoFlyZone("w", SQUARE[:3])),
    wind=Wind(0.5, 270.0),
    start_plan=((1, 2), (0, 2)),
)  # fmt: skip


@pytest.mark.parametrize(
    "problem", [FULL, replace(BASE, **on_legs(matrices={"a": Matrix(LEGS.distance, LEGS.distance)}))]
)
def test_a_record_has_all_of_it_and_comes_back_equal(problem):
    text = json.dumps(problem_to_record(problem), allow_nan=False)
    assert problem_from_record(json.loads(text)) == problem
    assert hash(problem_from_record(json.loads(text))) == hash(problem)


def test_a_problem_that_uses_none_of_it_has_the_record_it_always_had():
    record = problem_to_record(BASE)
    assert list(record) == ["uavs", "targets", "max_steps", "crs", "objective"]
    assert list(record["uavs"][0]) == [
        "id", "x_s", "y_s", "x_c", "y_c", "speed", "voyage", "loadlist", "dis", "ret",
    ]  # fmt: skip
    assert list(record["targets"][0]) == [
        "id", "x", "y", "level", "loadlist", "deadline", "service_time", "requested",
    ]  # fmt: skip
    assert list(record["objective"]) == ["distance_weight", "return_to_base", "charge_return", "unloading"]
