"""One place is one place however it is spelled, and a scene is as large at the antimeridian as elsewhere."""

import math
from dataclasses import replace

import numpy as np
import pytest
from cases import problem_of
from problems import on_earth, random_problem
from referee import replay, weight_of

from app.domain.geometry import distance, distances, longitude_stretch, unrolled
from app.domain.plan import Plan
from app.domain.problem import UAV, Problem, Target
from app.domain.records import problem_to_record
from app.library.description import task_description
from app.library.summary import task_summary
from app.simulation.distances import between_points
from app.simulation.evaluation import reward_of
from app.solvers.greedy import greedy_plan

SPELLINGS = [
    ((180.0, -16.8), (-180.0, -16.8)),
    ((0.0, 90.0), (77.0, 90.0)),
    ((-135.0, -90.0), (180.0, -90.0)),
    ((-180.0, 0.0), (180.0, 0.0)),
]


@pytest.mark.parametrize(("one", "other"), SPELLINGS)
def test_two_spellings_of_a_place_are_no_distance_apart(one, other):
    assert distance("wgs84", *one, *other) == 0.0
    a, b = np.array([one]), np.array([other])
    assert distances("wgs84", a, b).tolist() == [[0.0]]
    assert between_points("wgs84", a, b).tolist() == [[0.0]]


@pytest.mark.parametrize(("one", "other"), SPELLINGS)
def test_a_place_in_two_spellings_is_served_without_cost_or_range(one, other):
    problem = Problem(
        (UAV("u", *one, *one, speed=60.0, voyage=0.0, loadlist=(1.0,)),),
        (Target("a", *other, level=1.0, loadlist=(1.0,), deadline=0.0),),
        crs="wgs84",
    )
    assert (problem.extent, problem.distance_weight) == (1.0, 1.0)
    assert reward_of(problem, greedy_plan(problem)) == 1.0


def test_the_base_at_180_serves_the_area_at_minus_180():
    problem = problem_of("F2a-antimeridian-both-signs")
    assert problem.extent == pytest.approx(distance("wgs84", 179, -16.8, 180, -16.8), rel=1e-12)
    # 1 for no way at all, then 3 for a way of one extent.
    assert reward_of(problem, Plan(((0,), (1,)))) == pytest.approx(3.0, rel=1e-12)


def test_the_same_scene_earns_the_same_at_the_antimeridian():
    at_dateline, elsewhere = problem_of("O1a-dateline-scene"), problem_of("O1b-same-scene-10-degrees-west")
    assert at_dateline.extent == pytest.approx(elsewhere.extent, rel=1e-12)
    rewards = [reward_of(each, greedy_plan(each)) for each in (at_dateline, elsewhere)]
    assert rewards[0] == pytest.approx(rewards[1], rel=1e-12)
    assert rewards[0] > 2


def around(problem, degrees):
    """The same scene, that many degrees further east."""

    def turned(x):
        east = x + degrees
        return east - 360 * math.floor((east + 180) / 360)

    return replace(
        problem,
        uavs=tuple(replace(u, x_s=turned(u.x_s), x_c=turned(u.x_c)) for u in problem.uavs),
        targets=tuple(replace(t, x=turned(t.x)) for t in problem.targets),
    )


def test_extent_summary_and_description_do_not_depend_on_the_longitude():
    rng = np.random.default_rng(7)
    for _ in range(50):
        problem = on_earth(random_problem(rng), rng)
        low = min(t.x for t in problem.targets)
        at_dateline = around(problem, 180.0 - low - 1e-3)
        assert at_dateline.extent == pytest.approx(problem.extent, rel=1e-9)
        np.testing.assert_allclose(task_summary(at_dateline), task_summary(problem), atol=1e-8)
        np.testing.assert_allclose(task_description(at_dateline), task_description(problem), atol=1e-8)


def test_the_extent_is_the_referees():
    rng = np.random.default_rng(8)
    for _ in range(200):
        places = rng.uniform((-180, -90), (180, 90), (int(rng.integers(2, 6)), 2))
        places[rng.random(len(places)) < 0.2, 0] = rng.choice([180.0, -180.0])
        (x, y), *areas = places.tolist()
        problem = Problem(
            (UAV("u", x, y, x, y, 1.0, 1.0, (1.0,)),),
            tuple(Target(f"a{j}", *place, 1.0, (1.0,)) for j, place in enumerate(areas)),
            crs="wgs84",
        )
        assert problem.distance_weight == pytest.approx(weight_of(problem_to_record(problem)), rel=1e-9)


@pytest.mark.parametrize(
    ("longitudes", "stretch"),
    [
        ([10, -20, 30], (-20, 30)), ([179.9, -179.9, 179.0], (179.0, -179.9)), ([180, -180], (180, -180)),
        ([5], (5, 5)), ([-100, 0, 100], (-100, 100)), ([-170, 170, 0], (0, -170)),
    ],
)  # fmt: skip
def test_the_shortest_stretch_of_longitudes(longitudes, stretch):
    assert longitude_stretch(longitudes) == stretch
    flat = unrolled("wgs84", np.array(longitudes, float))
    assert flat.max() - flat.min() == pytest.approx((stretch[1] - stretch[0]) % 360)


def test_an_extent_too_small_to_divide_by_is_none():
    problem = problem_of("extent-5e-324-500")
    assert (problem.extent, problem.distance_weight) == (1.0, 1.0)
    plan = greedy_plan(problem)
    assert reward_of(problem, plan) == 1.0
    assert replay(problem_to_record(problem), plan.assignment)["reward"] == 1.0
