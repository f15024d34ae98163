"""What surrounds drawn problems: valid, repeatable, of every kind, and most of it can be flown."""

from dataclasses import replace

import numpy as np

from app.domain.records import problem_from_record, problem_to_record
from app.simulation.drawn_generator import drawn, drawn_size
from app.simulation.drawn_surroundings import with_surroundings
from app.simulation.evaluation import reward_of
from app.solvers.greedy import greedy_plan


def draw(number):
    rng = np.random.default_rng([2, number])
    return with_surroundings(drawn(*drawn_size(rng, most_uavs=12, most_targets=30), rng), rng)


def test_the_same_number_draws_the_same_surroundings():
    for number in range(20):
        problem = draw(number)
        assert problem == draw(number) == problem_from_record(problem_to_record(problem))


def test_every_part_is_drawn_and_most_problems_can_be_flown():
    problems = [draw(number) for number in range(150)]
    kinds = {
        "wind": [problem.wind is not None for problem in problems],
        "zones": [bool(problem.no_fly_zones) for problem in problems],
        "skills": [any(t.skills for t in problem.targets) for problem in problems],
        "promises": [any(u.committed for u in problem.uavs) for problem in problems],
        "partly served": [any(t.requested is not None for t in problem.targets) for problem in problems],
        "first shares": [problem.objective.minimum_share > 0 for problem in problems],
        "makespan": [problem.objective.makespan_weight > 0 for problem in problems],
        "under way": [any(u.dis > 0 for u in problem.uavs) for problem in problems],
        "matrices": [problem.matrices is not None for problem in problems],
    }
    for name, found in kinds.items():
        assert 0.03 < np.mean(found) < 0.6, name
    flown = [
        reward_of(problem, greedy_plan(problem)) > 0 for problem in problems if not problem.plans_loading
    ]
    assert np.mean(flown) > 0.8


def test_no_area_is_promised_twice_nor_to_a_uav_that_is_excluded_from_it():
    for number in range(60):
        problem = draw(number)
        promised = [each for uav in problem.uavs for each in uav.committed]
        assert len(promised) == len(set(promised))
        assert not any(set(uav.committed) & set(uav.excluded) for uav in problem.uavs)


def test_geographic_problems_get_what_fits_them():
    flat = drawn(4, 8, 2, np.random.default_rng(3))
    for number in range(40):
        surrounded = with_surroundings(replace(flat, crs="wgs84"), np.random.default_rng(number))
        assert surrounded.matrices is None
        assert all(uav.dis == 0 for uav in surrounded.uavs)
