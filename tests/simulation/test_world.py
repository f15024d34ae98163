"""Plans in a world with times, promises, zones, wind and matrices: the simulator against the referee."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from problems import random_plan
from referee import Illegal, replay
from referee_legs import Legs, apart, home_of, place_of, start_of
from worlds import random_sorties, random_world

from app.domain.allocation import (
    Allocation,
    LandingRoute,
    Reload,
    SortieAllocation,
    TimedAllocation,
    TimedStop,
)
from app.domain.errors import IllegalPlan
from app.domain.fields import Part, declared_fields
from app.domain.matrices import Matrix
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record, to_record
from app.domain.surroundings import Base, Material, NoFlyZone, Wind
from app.domain.world_use import uses_world
from app.simulation import visit
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import rewards_of
from app.simulation.explain import explain

RULES = {
    "returning": visit.RETURNING,
    "range": visit.OUT_OF_RANGE,
    "late": visit.TOO_LATE,
    "useless": visit.UNLOADS_NOTHING,
    "barred": visit.BARRED,
    "committed": visit.COMMITTED_ELSEWHERE,
    "endurance": visit.TOO_LONG_ALOFT,
    "landing": visit.HOME_TOO_LATE,
    "reloaded": visit.RELOADED,
}
TIMES = ("arrival_time", "begin_time", "departure_time", "distance", "range_left", "endurance_left")


def plans(problem, rng, count):
    """Plans of which about half are legal."""
    for number in range(count):
        if number % 2 == 0:
            yield random_plan(problem, rng)
        else:
            steps = int(rng.integers(1, problem.max_steps + 1))
            actions = problem.n_targets + 1 + problem.n_bases
            rows = rng.integers(0, actions, (steps, problem.n_uavs)).tolist()
            yield Plan(tuple(map(tuple, rows)))


def close(value, expected, scale=1.0):
    """Whether two numbers, or two that are not there, agree."""
    if value is None or expected is None:
        return value is expected
    return value == pytest.approx(expected, rel=1e-9, abs=1e-9 * max(1.0, scale))


@pytest.mark.parametrize("draw", [random_world, random_sorties])
def test_the_simulator_agrees_with_the_referee(draw):
    rng = np.random.default_rng(8)
    broken = {rule: 0 for rule in RULES if draw is random_sorties or rule != "reloaded"}
    legal = 0
    for _ in range(120):
        problem = draw(rng)
        arrays, record = compile_problem(problem), problem_to_record(problem)
        legs = Legs(record)
        for plan in plans(problem, rng, 16):
            result = rewards_of(arrays, plan.as_array()[None])
            try:
                expected = replay(record, plan.assignment, legs=legs)
            except Illegal as error:
                step, uav, rule = error.args
                assert (result.rule[0], result.step[0], result.uav[0]) == (RULES[rule], step, uav)
                broken[rule] += 1
                continue
            legal += 1
            assert result.rule[0] == visit.ALLOWED
            for name in ("reward", "satisfaction", "distance", "makespan"):
                assert close(float(getattr(result, name)[0]), expected[name])
    assert legal > 800
    assert min(broken.values()) > 2, broken


@pytest.mark.parametrize("draw", [random_world, random_sorties])
def test_every_figure_of_an_answer_agrees_with_the_referee(draw):
    rng = np.random.default_rng(11)
    waited = answered = reloads = 0
    for _ in range(80):
        problem = draw(rng)
        if problem.objective.half_life is None and rng.random() < 0.3:
            problem = replace(problem, objective=replace(problem.objective, unloading="planned"))
        record, plan = problem_to_record(problem), random_plan(problem, rng)
        answer = worthwhile(problem, plan)
        if answer is None:
            # A promised visit is worth nothing, or without one the next is too far, as some matrices have it.
            assert problem.objective.unloading == "planned"
            continue
        answered += 1
        assert isinstance(answer, SortieAllocation if problem.bases else TimedAllocation)
        expected = replay(record, answer.plan.assignment, amounts(problem, answer), Legs(record))
        for name in ("reward", "satisfaction", "distance", "makespan"):
            assert close(getattr(answer, name), expected[name])
        assert answer.changes == expected["changes"]
        for i, route in enumerate(answer.routes):
            assert isinstance(route, LandingRoute)
            stops = expected["stops"][i]
            for stop, judged in zip(route.stops, stops, strict=True):
                if isinstance(stop, Reload):
                    reloads += 1
                    assert stop.base_id == problem.bases[judged["base"]].id
                    assert stop.loaded == pytest.approx(judged["loaded"])
                    names = ("arrival_time", "departure_time", "distance")
                else:
                    assert isinstance(stop, TimedStop)
                    assert stop.target_id == problem.targets[judged["target"]].id
                    names = TIMES
                    waited += stop.begin_time > stop.arrival_time
                assert all(close(getattr(stop, name), judged[name], problem.extent) for name in names)
            flies = bool(stops) or (route.return_distance > 0 and problem.objective.return_to_base)
            assert (route.landing is not None) == flies
            if route.landing is not None:
                assert close(route.landing.time, expected["landed"][i])
        seen = max((route.landing.time for route in answer.routes if route.stops), default=0.0)
        assert close(answer.makespan, seen)
        for base, left in zip(getattr(answer, "bases", ()), expected["stocks"], strict=True):
            assert base.stock is None or base.stock == pytest.approx(left)
    assert waited > 15
    assert answered > 70
    assert reloads > (50 if draw is random_sorties else -1)


def worthwhile(problem, plan):
    """The answer to a plan without visits that a planned unloading finds nothing for; None: no such plan."""
    while True:
        try:
            return explain(problem, plan)
        except IllegalPlan as error:
            if error.details["rule"] != visit.RULES[visit.UNLOADS_NOTHING]:
                return None
            i = [uav.id for uav in problem.uavs].index(error.details["uav_id"])
            column = [row[i] for row in plan.assignment]
            del column[error.details["step"] - 1]
            rows = [list(row) for row in plan.assignment]
            for row, action in zip(rows, [*column, problem.n_targets], strict=True):
                row[i] = action
            plan = Plan(tuple(map(tuple, rows)))


def amounts(problem, answer):
    """What the visits of an answer unload, by step, UAV and material."""
    nothing = [0.0] * problem.n_materials
    given = [[list(nothing) for _ in problem.uavs] for _ in answer.plan.assignment]
    for i, route in enumerate(answer.routes):
        for stop in route.visits:
            given[stop.step - 1][i] = list(stop.delivered)
    return given


def test_a_path_is_the_shortest_way_and_says_where_it_turns():
    rng = np.random.default_rng(4)
    turned = at_bases = 0
    for number in range(160):
        problem = random_world(rng) if number < 120 else random_sorties(rng)
        record = problem_to_record(problem)
        answer, legs = explain(problem, random_plan(problem, rng)), Legs(record)
        areas = {area["id"]: place_of(area) for area in record["targets"]}
        bases = {base["id"]: place_of(base) for base in record.get("bases", ())}
        for uav, route in zip(record["uavs"], answer.routes, strict=True):
            here = start_of(uav)
            for stop in route.stops:
                there = bases[stop.base_id] if isinstance(stop, Reload) else areas[stop.target_id]
                turned += check_path(legs, here, there, stop.path, stop.distance)
                here = there
            if route.landing is not None and problem.objective.return_to_base:
                base = getattr(route.landing, "base_id", None)
                there = home_of(uav) if base is None else bases[base]
                at_bases += base is not None
                check_path(legs, here, there, route.landing.path, route.return_distance)
    assert turned > 8
    assert at_bases > 10


def check_path(legs, here, there, path, length):
    """Hold a path against the shortest way in rational numbers; whether it turns."""
    if legs.ways is None:
        assert path is None
        return False
    points = legs.points(here, there)
    if path is None:
        assert len(points) == 2
        return False
    assert (path[0], path[-1]) == (here[:2], there[:2])
    assert legs.corners.issuperset(path[1:-1])
    assert sum(apart(legs.crs, a, b) for a, b in pairwise(path)) == pytest.approx(length)
    assert list(path) == points
    return True


def plain(**fields):
    """One UAV and one area, 3 apart."""
    given = {
        "uavs": (UAV("u", 0, 0, 0, 0, speed=2.0, voyage=12.0, loadlist=(4.0,)),),
        "targets": (Target("a", 3, 0, level=2.0, loadlist=(3.0,), service_time=0.5),),
    }
    return Problem(**{**given, **fields})


USED = {
    **{(UAV, name): 1.5 for name in ("endurance", "airborne", "available_from", "available_until")},
    (UAV, "reserve"): 0.1,
    (UAV, "capacity"): 9.0,
    (UAV, "full_load"): (9.0,),
    (UAV, "bases"): (),
    (UAV, "skills"): ("medic",),
    (UAV, "excluded"): ("a",),
    (UAV, "committed"): ("a",),
    (UAV, "location"): 0,
    (UAV, "home_location"): 0,
    (UAV, "profile"): "road",
    (Target, "earliest"): 1.0,
    (Target, "skills"): ("medic",),
    (Target, "location"): 0,
    **{
        (Objective, name): 2.0 for name in ("half_life", "minimum_weight", "makespan_weight", "change_weight")
    },
    (Objective, "minimum_share"): 0.5,
    (Objective, "loading"): "planned",
    (Problem, "no_fly_zones"): (NoFlyZone("z", ((0, 1), (1, 1), (1, 2))),),
    (Problem, "wind"): Wind(0.5, 90.0),
    (Problem, "bases"): (Base("b", 1, 1),),
    (Problem, "matrices"): {"road": Matrix([[0.0, 1.0], [1.0, 0.0]])},
    (Problem, "start_plan"): ((0,),),
}
COMPANIONS = {
    (Objective, "change_weight"): {"start_plan": ((0,),)},
    **{(of, name): {"matrices": {"road": Matrix([[0.0]])}} for of, name in USED if "location" in name},
    (UAV, "profile"): {"matrices": {"road": Matrix([[0.0]])}},
    (Problem, "matrices"): {},
}


def with_field(of, name, value):
    """The plain problem with one field set, and those that it needs beside it."""
    problem = plain()
    beside = COMPANIONS.get((of, name), {})
    if "matrices" in beside or name == "matrices":
        problem = plain(
            uavs=(replace(problem.uavs[0], location=0),),
            targets=(replace(problem.targets[0], location=0),),
            matrices={"road": Matrix([[0.0, 1.0], [1.0, 0.0]])},
        )
    problem = replace(problem, **{key: each for key, each in beside.items() if key != "matrices"})
    if of is UAV:
        return replace(problem, uavs=(replace(problem.uavs[0], **{name: value}),))
    if of is Target:
        return replace(problem, targets=(replace(problem.targets[0], **{name: value}),))
    if of is Objective:
        beside = {"unloading": "planned"} if name == "loading" else {}
        return replace(problem, objective=replace(problem.objective, **beside, **{name: value}))
    return replace(problem, **{name: value})


def test_every_field_of_the_world_is_a_use_of_it():
    parts = [Problem, *(each.kind.of for each in declared_fields(Problem) if isinstance(each.kind, Part))]
    later = {(of, each.name) for of in parts for each in declared_fields(of) if not each.always_recorded}
    named = {(of, name) for of, name in later if name in ("name", "properties", "materials")}
    inside = {(of, name) for of, name in later if of in (Material, Wind, NoFlyZone, Matrix, Base)}
    assert set(USED) == later - named - inside
    assert not uses_world(plain())
    for (of, name), value in USED.items():
        assert uses_world(with_field(of, name, value)), name


def test_names_and_materials_alone_leave_the_answer_as_it_was():
    problem = plain()
    named = plain(
        uavs=(replace(problem.uavs[0], name="Kestrel", properties={"a": 1}),),
        targets=(replace(problem.targets[0], name="Village"),),
        materials=(Material("water", 2.0),),
    )
    assert not uses_world(named)
    answers = [explain(each, Plan(((0,),))) for each in (problem, named)]
    assert [type(answer) for answer in answers] == [Allocation, Allocation]
    assert to_record(answers[0]) == to_record(answers[1])
    assert set(to_record(answers[0])["routes"][0]["stops"][0]) == {
        "target_id",
        "step",
        "arrival_time",
        "distance",
        "delivered",
    }


def test_times_computed_by_hand():
    # It could leave at 1 and waits on the ground until 9 - 1.5; then serves for 0.5 and is home 1.5 later.
    problem = plain(
        uavs=(replace(plain().uavs[0], available_from=1.0, endurance=4.0),),
        targets=(replace(plain().targets[0], earliest=9.0),),
    )
    answer = to_record(explain(problem, Plan(((0,),))))
    (route,) = answer["routes"]
    assert route["stops"] == [
        {
            "target_id": "a",
            "step": 1,
            "arrival_time": 2.5,
            "distance": 3.0,
            "delivered": [3.0],
            "begin_time": 9.0,
            "departure_time": 9.5,
            "range_left": 9.0,
            "endurance_left": 2.0,
            "path": None,
        }
    ]
    assert route["landing"] == {"time": 11.0, "path": None}
    assert (answer["makespan"], answer["changes"]) == (11.0, 0)
    stays = replace(problem, objective=Objective(return_to_base=False))
    assert to_record(explain(stays, Plan(((0,),))))["routes"][0]["landing"] == {"time": 9.5, "path": None}
    assert to_record(explain(stays, Plan(((1,),))))["routes"][0]["landing"] is None


def test_a_reload_needs_no_way_home_also_where_a_matrix_has_one_from_a_place_to_itself():
    # 1.5 to the area, 0.5 there, 1.5 to the base: as long as it may be in the air.
    problem = plain(
        uavs=(replace(plain().uavs[0], endurance=3.5, voyage=99.0, location=0, loadlist=(2.0,)),),
        targets=(replace(plain().targets[0], location=1),),
        matrices={"road": Matrix([[0, 3, 3], [3, 0, 3], [3, 3, 10]])},
        bases=(Base("b", 3, 3, location=2),),
    )
    answer = explain(problem, Plan(((0,), (2,))))
    assert answer.routes[0].stops[1].loaded == (2.0,)


def test_changes_are_counted_also_where_they_cost_nothing():
    two = replace(plain(), targets=(plain().targets[0], replace(plain().targets[0], id="b", y=1.0)))
    problem = replace(two, start_plan=((1,),))
    assert explain(problem, Plan(((0,),))).changes == 1
    assert explain(problem, Plan(((1,),))).changes == 0
