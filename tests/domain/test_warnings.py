"""Warnings: each where it is meant, and none at ordinary problems."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases import problem_of
from problems import on_earth, random_problem

from app.api.problem_models import ProblemModel, to_problem
from app.domain.geometry import distance
from app.domain.matrices import Matrix
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Base, NoFlyZone, Wind
from app.domain.warnings import CODES, problem_warnings
from app.settings import Settings
from app.simulation.generator import FAMILIES, generate

EXAMPLES = Path(__file__).resolve().parents[2] / "app" / "examples"


def codes(problem):
    return [warning.code for warning in problem_warnings(problem)]


def scene(**objective):
    """Two UAVs at a base near Beira with both materials, and six areas within 60 km."""
    base = (34.84, -19.83)
    areas = ((34.9, -19.5), (34.6, -19.9), (35.0, -19.7), (34.7, -19.4), (34.5, -19.6), (34.95, -20.0))
    return Problem(
        tuple(UAV(f"uav-{i}", *base, *base, 80.0, 160.0, (5.0, 5.0)) for i in (1, 2)),
        tuple(Target(f"area-{j}", *at, 2.0, (2.0, 1.0)) for j, at in enumerate(areas, 1)),
        crs="wgs84",
        objective=Objective(**objective),
    )


def with_targets(problem, change, *places):
    """The problem with a change to some targets, all of them by default."""
    places = places or range(problem.n_targets)
    return replace(
        problem,
        targets=tuple(replace(t, **change(t)) if j in places else t for j, t in enumerate(problem.targets)),
    )


def with_uavs(problem, change, *places):
    places = places or range(problem.n_uavs)
    return replace(
        problem, uavs=tuple(replace(u, **change(u)) if i in places else u for i, u in enumerate(problem.uavs))
    )


def swap(t):
    return {"x": t.y, "y": t.x}


def swap_uav(u):
    return {"x_s": u.y_s, "y_s": u.x_s, "x_c": u.y_c, "y_c": u.x_c}


def in_plane(problem):
    return replace(problem, crs="local")


TROUBLES = {
    "all_returning": (with_uavs(scene(), lambda u: {"ret": True}), "/uavs", "every UAV"),
    "committed_beyond_steps": (
        replace(with_uavs(scene(), lambda u: {"committed": ("area-2", "area-1")}, 1), max_steps=1),
        "/uavs/1/committed",
        "2 visits are promised of 'uav-2', in 1 steps",
    ),
    "committed_in_vain": (
        with_targets(
            with_uavs(scene(), lambda u: {"committed": ("area-2", "area-1")}, 1),
            lambda t: {"skills": ("crane",)},
            0,
        ),
        "/uavs/1/committed/1",
        "'uav-2' makes no visit before that of 'area-1', which is promised, and cannot make it: "
        "it has not the skills crane",
    ),
    "inside_zone": (
        replace(
            with_uavs(scene(), lambda u: {"x_c": 34.75, "y_c": -19.75}, 1),
            no_fly_zones=(
                NoFlyZone("airport", ((34.7, -19.8), (34.8, -19.8), (34.8, -19.7), (34.7, -19.7))),
            ),
        ),
        "/uavs/1/x_c",
        "the position of 'uav-2' lies in the no-fly zone 'airport'",
    ),
    "wind_too_strong": (
        replace(with_uavs(scene(), lambda u: {"speed": 40.0}, 1), wind=Wind(40.0, 90.0)),
        "/uavs/1/speed",
        "'uav-2' flies 40, no faster than the wind, 40",
    ),
    "earliest_after_deadline": (
        with_targets(scene(), lambda t: {"deadline": 2.0, "earliest": 2.5}, 4),
        "/targets/4/earliest",
        "begins at 2.5 at the earliest, and its deadline, 2,",
    ),
    "never_available": (
        with_uavs(scene(), lambda u: {"available_from": 3.0, "available_until": 2.0}, 1),
        "/uavs/1/available_until",
        "has to have landed at 2, before it may take off, at 3",
    ),
    "deadline_passed": (
        with_targets(scene(), lambda t: {"deadline": -0.5}, 3),
        "/targets/3/deadline",
        "'area-4' was 0.5 time units ago",
    ),
    "degrees_on_plane": (in_plane(scene()), "/crs", "look like degrees"),
    "no_level": (with_targets(scene(), lambda t: {"level": 0.0}), "/targets/0/level", "is 0"),
    "none_in_range": (with_uavs(scene(), lambda u: {"voyage": 30.0}), "/uavs", "and the way home"),
    "not_carried": (
        with_uavs(scene(), lambda u: {"loadlist": (5.0, 0.0)}),
        "/targets/0/loadlist/1",
        "material 2 is needed by 6 targets",
    ),
    "no_capacity": (
        with_uavs(
            replace(scene(unloading="planned", loading="planned"), bases=(Base("base-1", 34.84, -19.83),)),
            lambda u: {"capacity": 500.0 if u.id != "uav-1" else None},
        ),
        "/uavs/0",
        "whatever is in stock",
    ),
    "not_needed": (
        with_targets(scene(), lambda t: {"loadlist": (2.0, 0.0)}),
        "/uavs/0/loadlist/1",
        "material 2 is carried by 2 UAVs",
    ),
    "nothing_needed": (with_targets(scene(), lambda t: {"loadlist": (0.0, 0.0)}), "/targets", "no target"),
    "one_place": (
        with_targets(scene(), lambda t: {"x": 34.84, "y": -19.83}),
        "/targets/0/x",
        "one and the same",
    ),
    "range_implausible": (
        with_uavs(scene(), lambda u: {"voyage": 160_000.0}, 1),
        "/uavs/1/voyage",
        "round the",
    ),
    "range_spent": (
        with_uavs(scene(), lambda u: {"dis": 161.0}, 1),
        "/uavs/1/dis",
        "more than its range",
    ),
    "speed_implausible": (
        with_uavs(scene(), lambda u: {"speed": 80_000.0}, 0),
        "/uavs/0/speed",
        "faster",
    ),
    "far_point": (with_targets(scene(), lambda t: {"x": -34.9}, 2), "/targets/2/x", "times the width"),
    "coordinates_swapped": (with_targets(scene(), swap, 2), "/targets/2/x", "exchanged"),
}


def test_every_code_has_a_test_and_the_scene_itself_no_warning():
    assert set(TROUBLES) == set(CODES)
    assert list(CODES) == sorted(CODES)
    assert codes(scene()) == []


@pytest.mark.parametrize("code", CODES)
def test_a_warning_names_the_place_and_nothing_else_is_said(code):
    problem, pointer, said = TROUBLES[code]
    (warning,) = problem_warnings(problem)
    assert (warning.code, warning.pointer) == (code, pointer)
    assert said in warning.detail


@pytest.mark.parametrize(
    ("of_uav", "of_area", "why"),
    [
        ({}, {"loadlist": (0.0, 0.0)}, "that needs nothing"),
        ({"loadlist": (0.0, 5.0)}, {"loadlist": (2.0, 0.0)}, "it carries nothing that is needed there"),
        ({"available_from": 2.0}, {"deadline": 1.0}, "the deadline there is 1, and it takes off at 2"),
        ({"voyage": 40.0, "reserve": 0.5}, {}, "it would have flown 37.2283 there, and may fly 20"),
    ],
)
def test_why_a_promised_visit_cannot_be_made(of_uav, of_area, why):
    promised = with_uavs(scene(), lambda u: {"committed": ("area-1",), **of_uav}, 0)
    (warning,) = [
        each
        for each in problem_warnings(with_targets(promised, lambda t: of_area, 0))
        if each.code == "committed_in_vain"
    ]
    assert warning.pointer == "/uavs/0/committed/0"
    assert warning.detail.endswith(why)


def test_promises_that_can_be_kept_and_borders_of_zones_are_nothing_to_warn_of():
    promised = with_uavs(scene(), lambda u: {"committed": ("area-1", "area-2")}, 0)
    assert codes(promised) == []
    edge = NoFlyZone("z", ((34.84, -19.83), (34.9, -19.83), (34.9, -19.9), (34.84, -19.9)))
    assert codes(replace(scene(), no_fly_zones=(edge,))) == []
    assert codes(replace(with_uavs(scene(), lambda u: {"ret": 1}, 0), wind=Wind(79.0, 0.0))) == []


def test_with_a_wind_behind_it_a_uav_may_get_farther_than_its_range():
    short = with_uavs(scene(), lambda u: {"voyage": 30.0})
    assert codes(replace(short, wind=Wind(0.0, 90.0))) == ["none_in_range"]
    assert codes(replace(short, wind=Wind(40.0, 90.0))) == []


def test_positions_of_a_problem_with_matrices_are_for_display_alone():
    problem = replace(
        scene(),
        uavs=tuple(replace(uav, location=0) for uav in scene().uavs),
        targets=tuple(replace(target, location=1) for target in scene().targets),
        matrices={"road": Matrix([[0.0, 99.0], [99.0, 0.0]])},
    )
    assert codes(with_targets(problem, swap, 2)) == []
    assert codes(with_targets(with_targets(problem, swap, 2), lambda t: {"level": 0.0})) == ["no_level"]


@pytest.mark.parametrize(
    ("problem", "pointers"),
    [
        (problem_of("O4-swapped-station-dhangadi"), ["/targets/26/x"]),
        (with_targets(scene(), swap), [f"/targets/{j}/x" for j in range(6)]),
        (with_targets(scene(), swap, 0, 1, 2, 3), [f"/targets/{j}/x" for j in range(4)]),
        (with_uavs(scene(), swap_uav), [f"/targets/{j}/x" for j in range(6)]),
        (with_uavs(scene(), swap_uav, 1), ["/uavs/1/x_s"]),
    ],
)
def test_exchanged_coordinates_of_one_point_or_of_all_of_a_kind(problem, pointers):
    warnings = [each for each in problem_warnings(problem) if each.code == "coordinates_swapped"]
    assert [each.pointer for each in warnings] == pointers


def test_a_station_far_away_says_how_far_and_what_follows():
    (warning,) = problem_warnings(with_targets(scene(), lambda t: {"x": -34.9}, 2))
    kilometres, factor = (
        float(warning.detail.split()[2]),
        float(warning.detail.split("others, ")[1].split()[0]),
    )
    assert 7000 < kilometres < 7500
    assert factor > 50
    assert "distance counts for about as many times less" in warning.detail
    (given,) = problem_warnings(with_targets(scene(distance_weight=0.01), lambda t: {"x": -34.9}, 2))
    assert "counts" not in given.detail


@pytest.mark.parametrize(
    "problem",
    [
        # A village far from the base, within range; a scene at the antimeridian; ample ranges on a plane.
        with_uavs(
            with_targets(scene(), lambda t: {"x": 36 + t.x / 1e3, "y": -20 + t.y / 1e3}),
            lambda u: {"voyage": 400.0},
        ),
        with_uavs(
            with_targets(scene(), lambda t: {"x": t.x + 145 - 360 * (t.x > 34.99)}),
            lambda u: {"x_s": 179.84, "x_c": 179.84},
        ),
        with_uavs(
            in_plane(with_targets(scene(), lambda t: {"x": t.x - 34.8, "y": t.y + 19.8})),
            lambda u: {"x_s": 0.0, "y_s": 0.0, "x_c": 0.0, "y_c": 0.0},
        ),
        # A base at the pole, and areas all around it.
        with_uavs(
            with_targets(scene(), lambda t: {"x": (t.x * 1e4) % 360 - 180, "y": 89.5}),
            lambda u: {"x_s": 0.0, "y_s": 90.0, "x_c": 120.0, "y_c": 90.0},
        ),
    ],
)  # fmt: skip
def test_unusual_scenes_are_no_mistakes(problem):
    assert codes(problem) == []


def test_there_is_none_at_the_examples():
    for file in EXAMPLES.glob("*.json"):
        content = json.loads(file.read_text("utf-8"))
        body = {name: content[name] for name in ProblemModel.model_fields if name in content}
        assert codes(to_problem(ProblemModel(**body), Settings())) == [], file.name


@pytest.mark.parametrize("family", FAMILIES)
def test_there_is_none_at_generated_problems(family):
    rng = np.random.default_rng(1)
    for m, n in ((5, 10), (10, 5), (20, 30), (40, 80)):
        for number in range(12):
            problem = generate(family, m, n, 3, rng)
            assert codes(on_earth(problem, rng) if number % 2 else problem) == []


FACTS = {"all_returning", "deadline_passed", "none_in_range", "not_carried", "not_needed", "nothing_needed"}


def test_random_problems_get_facts_only_and_only_true_ones():
    rng = np.random.default_rng(2)
    seen = set()
    for _ in range(500):
        problem = random_problem(rng)
        found = set(codes(problem))
        assert found <= FACTS
        seen |= found
        out = [u for u in problem.uavs if not u.ret]
        needs = [sum(t.loadlist[k] for t in problem.targets) for k in range(problem.n_materials)]
        loads = [sum(u.loadlist[k] for u in out) for k in range(problem.n_materials)]
        asked = any(needs)
        pairs = list(zip(needs, loads, strict=True))
        assert ("nothing_needed" in found) == (not asked)
        assert ("all_returning" in found) == (asked and not out)
        assert ("not_carried" in found) == (asked and bool(out) and any(n and not c for n, c in pairs))
        assert ("not_needed" in found) == (asked and bool(out) and any(c and not n for n, c in pairs))
        late = any(t.deadline is not None and t.deadline < 0 and any(t.loadlist) for t in problem.targets)
        assert ("deadline_passed" in found) == late
        assert ("none_in_range" in found) == (
            asked and bool(out) and not any(reaches(problem, u) for u in out)
        )
    assert seen >= FACTS - {"none_in_range"}


def reaches(problem, uav):
    """Whether a UAV has the range for any target that needs something."""
    back = problem.objective.return_to_base
    return any(
        uav.dis
        + distance(problem.crs, uav.x_c, uav.y_c, t.x, t.y)
        + back * distance(problem.crs, t.x, t.y, uav.x_s, uav.y_s)
        <= uav.voyage * (1 + 1e-6)
        for t in problem.targets
        if any(t.loadlist)
    )


@pytest.mark.parametrize("turn", [0.0, 145.2])
@pytest.mark.parametrize("back", [True, False])
def test_ranges_are_compared_as_the_rules_do(back, turn):
    """Just enough and just too little for the nearest area, on a plane and across the antimeridian."""
    problem = scene(return_to_base=back)
    problem = with_targets(problem, lambda t: {"x": t.x + turn - 360 * (t.x + turn > 180)})
    problem = with_uavs(problem, lambda u: {"x_s": u.x_s + turn - 0.1, "x_c": u.x_c + turn - 0.1})
    u = problem.uavs[0]
    nearest = min(distance("wgs84", u.x_c, u.y_c, t.x, t.y) for t in problem.targets) * (2 if back else 1)
    for voyage, warned in ((nearest * (1 - 9e-7), False), (nearest * (1 - 1.1e-6), True)):
        ready = with_uavs(problem, lambda u: {"voyage": voyage})  # noqa: B023 - called at once
        assert ("none_in_range" in codes(ready)) == warned


def test_many_of_a_kind_are_counted():
    problem = generate("deadline", 3, 40, 2, np.random.default_rng(1))
    warnings = problem_warnings(with_targets(problem, lambda t: {"deadline": -1.0, "loadlist": (1.0, 1.0)}))
    assert [each.code for each in warnings] == ["deadline_passed"] * 10
    assert warnings[-1].detail.endswith("so it is at 30 more places")
