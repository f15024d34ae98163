"""Problems whose every property is drawn: valid, repeatable, solvable, and of many kinds."""

import numpy as np

from app.domain.records import problem_from_record, problem_to_record
from app.simulation.drawn_generator import drawn, drawn_size
from app.simulation.evaluation import reward_of
from app.solvers.greedy import greedy_plan


def draw(number):
    rng = np.random.default_rng([1, number])
    return drawn(*drawn_size(rng, most_uavs=12, most_targets=40), rng)


def test_the_same_number_draws_the_same_problem():
    for number in range(20):
        problem = draw(number)
        assert problem == draw(number) == problem_from_record(problem_to_record(problem))


def test_many_kinds_of_problems_are_drawn_and_most_of_them_can_be_flown():
    problems = [draw(number) for number in range(150)]
    levels = [[t.level for t in problem.targets] for problem in problems]
    kinds = {
        "bases": [bool(problem.bases) for problem in problems],
        "stocks": [any(base.stock for base in problem.bases) for problem in problems],
        "deadlines": [any(t.deadline is not None for t in problem.targets) for problem in problems],
        "levels far apart": [max(each) > 100 * min(each) for each in levels],
        "free distance": [problem.objective.distance_weight == 0 for problem in problems],
        "one way": [not problem.objective.return_to_base for problem in problems],
        "planned unloading": [problem.objective.unloading == "planned" for problem in problems],
        "batteries": [problem.uavs[0].endurance is not None for problem in problems],
        "many steps": [problem.max_steps >= 30 for problem in problems],
    }
    for name, found in kinds.items():
        assert 0.03 < np.mean(found) < 0.7, name
    flown = [
        reward_of(problem, greedy_plan(problem)) > 0 for problem in problems if not problem.plans_loading
    ]
    assert np.mean(flown) > 0.8
