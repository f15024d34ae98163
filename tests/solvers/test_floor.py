"""No answer earns less than staying at home, and none but the paper's own less than the greedy rule."""

from dataclasses import replace

import numpy as np
import pytest
from cases import problem_of
from problems import random_problem
from stopping import at_once

from app.domain.plan import Plan
from app.domain.surroundings import Base
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.floor import Floor, nothing_to_fly
from app.solvers.greedy import greedy_plan
from app.solvers.parameters import GreedyParameters
from app.solvers.protocol import History, Progress, Proof, Solution, SolverContext
from app.solvers.registry import ALGORITHMS, create_solver, parse_parameters
from app.solvers.stop import never

QUICK = {
    "qmix": {"n_epochs": 4, "batch_size": 4},
    "dqn": {"n_epochs": 2, "buffer_size": 2, "batch_size": 2},
    "ga": {"num_total": 4, "iteration": 2},
    "local_search": {"moves": 500},
    "auto": {"moves": 500},
    "exact": {"nodes": 2},
}
WITHOUT_LIBRARY = [name for name in ALGORITHMS if name != "transfer_qmix"]


def at_home(problem):
    return reward_of(problem, Plan.empty(problem.n_uavs, problem.n_targets))


def solve(name, problem, stop=never, report=lambda _progress: None):
    solver = create_solver(name, parse_parameters(name, QUICK.get(name, {})), SolverContext())
    return solver.solve(problem, 3, stop, report)


def charged(problem, unloading="greedy"):
    objective = replace(problem.objective, charge_return=True, unloading=unloading)
    return replace(problem, objective=objective)


def problems(count):
    rng = np.random.default_rng(90)
    return [random_problem(rng, max_uavs=3, max_targets=4) for _ in range(count)]


def test_the_greedy_rule_counts_the_way_home_where_it_costs():
    problem = problem_of("greedy-below-staying-home")
    assert reward_of(problem, greedy_plan(problem)) >= at_home(problem)
    for each in map(charged, problems(300)):
        assert reward_of(each, greedy_plan(each)) >= at_home(each) - 1e-12


def test_the_greedy_rule_flies_where_the_way_home_gets_shorter():
    """A UAV that is out and passes an area on its way home loses nothing by stopping there."""
    problem = charged(generate("uniform", 1, 1, 1, np.random.default_rng(1)))
    uav, target = problem.uavs[0], problem.targets[0]
    uav = replace(uav, x_s=0.0, y_s=0.0, x_c=10.0, y_c=0.0, voyage=20.0)
    target = replace(target, x=5.0, y=0.0, level=0.1)
    problem = replace(problem, uavs=(uav,), targets=(target,))
    assert greedy_plan(problem).assignment == ((0,),)
    assert reward_of(problem, greedy_plan(problem)) > at_home(problem)


@pytest.mark.parametrize("unloading", ["greedy", "planned"])
@pytest.mark.parametrize("stop", [never, at_once()], ids=["never", "at once"])
@pytest.mark.parametrize("name", WITHOUT_LIBRARY)
def test_no_algorithm_falls_below(name, stop, unloading):
    for problem in problems(2 if ALGORITHMS[name].learns else 6):
        each = charged(problem, unloading)
        rule = at_home(each) if ALGORITHMS[name].comparison else reward_of(each, greedy_plan(each))
        assert reward_of(each, solve(name, each, stop).plan) >= max(rule, at_home(each)) - 1e-12


class Stays:
    """An algorithm that does nothing."""

    def solve(self, problem, seed, stop, report):
        plan = Plan.empty(problem.n_uavs, problem.n_targets)
        report(Progress(0.5, 1, 0.0, plan))
        return Solution(plan, History([0], [0.0]), GreedyParameters(), proof=Proof(1e-9, True))


def test_a_plan_that_falls_below_is_replaced_and_said_to_be_the_greedy_rules():
    problem, told = generate("uniform", 3, 5, 2, np.random.default_rng(4)), []
    floor = greedy_plan(problem)
    solver = Floor(Stays(), GreedyParameters(), greedy=True, learns=False)
    solution = solver.solve(problem, 1, never, told.append)
    assert (solution.plan, solution.answered_by) == (floor, "greedy")
    assert solution.history == History([0], [0.0])
    assert solution.proof.bound == reward_of(problem, floor)
    assert [(progress.best_reward, progress.incumbent) for progress in told] == [
        (pytest.approx(reward_of(problem, floor)), floor)
    ]
    paper = Floor(Stays(), GreedyParameters(), greedy=False, learns=False).solve(
        problem, 1, never, told.append
    )
    assert (paper.plan, paper.answered_by) == (Plan.empty(3, 5), None)


@pytest.mark.parametrize("unloading", ["greedy", "planned"])
@pytest.mark.parametrize("change", [{"ret": True}, {"voyage": 0.0}, {"loadlist": (0.0, 0.0)}])
@pytest.mark.parametrize("name", WITHOUT_LIBRARY)
def test_where_nothing_can_be_flown_it_ends_at_once(name, change, unloading):
    problem, told = generate("uniform", 2, 3, 2, np.random.default_rng(2)), []
    objective = replace(problem.objective, unloading=unloading)
    uavs = tuple(replace(uav, **change) for uav in problem.uavs)
    problem = replace(problem, uavs=uavs, objective=objective)
    solution = solve(name, problem, report=told.append)
    assert (solution.plan, solution.history) == (Plan.empty(2, 3), History([0], [0.0]))
    if not ALGORITHMS[name].learns and name != "dqn":
        assert [(each.fraction, each.best_reward) for each in told] == [(1.0, 0.0)]
        assert solution.proof == Proof(0.0, True)


def on_a_plane(bases, **of_the_uav):
    """A problem of one UAV at 0, 0 and one area 10 away from it, with bases at some distances on the way."""
    problem = generate("uniform", 1, 1, 1, np.random.default_rng(1))
    at = {"x_s": 0.0, "y_s": 0.0, "x_c": 0.0, "y_c": 0.0, "speed": 1.0, "loadlist": (4.0,)}
    uav = replace(problem.uavs[0], **{**at, **of_the_uav})
    target = replace(problem.targets[0], x=10.0, y=0.0, loadlist=(4.0,), deadline=None, level=9.0)
    objective = replace(problem.objective, return_to_base=False)
    placed = tuple(Base(f"base-{x:g}", x, 0.0) for x in bases)
    return replace(problem, uavs=(uav,), targets=(target,), bases=placed, objective=objective)


@pytest.mark.parametrize("loading", ["refill", "planned"])
@pytest.mark.parametrize("name", ALGORITHMS)
def test_where_no_reload_brings_a_uav_to_an_area_it_ends_at_once(name, loading):
    problem = on_a_plane([3.0], voyage=5.0)
    unloading = "planned" if loading == "planned" else "greedy"
    problem = replace(problem, objective=replace(problem.objective, loading=loading, unloading=unloading))
    told = []
    solver = create_solver(name, parse_parameters(name, {}), SolverContext(), keeps_checkpoint=False)
    solution = solver.solve(problem, 3, never, told.append)
    assert (solution.plan, solution.proof) == (Plan.empty(1, 1), Proof(0.0, True))
    assert [(each.fraction, each.best_reward) for each in told] == [(1.0, 0.0)]


def test_a_reload_that_brings_a_uav_to_an_area_is_found():
    assert not nothing_to_fly(on_a_plane([3.0], voyage=7.0))
    assert not nothing_to_fly(on_a_plane([3.0], voyage=7.0, loadlist=(0.0,), full_load=(4.0,)))
    assert nothing_to_fly(on_a_plane([3.0], voyage=7.0, loadlist=(0.0,), full_load=(0.0,)))
    assert nothing_to_fly(on_a_plane([3.0], voyage=7.0, ret=True))
    charged_home = on_a_plane([3.0], voyage=5.0)
    assert not nothing_to_fly(charged(charged_home))


def test_what_a_uav_can_leave_at_a_base_counts_as_in_stock():
    """With planned loads the first UAV, which cannot reach the area, brings the second one what it needs."""
    problem = on_a_plane([3.0], voyage=7.0, loadlist=(0.0,))
    bringer = replace(problem.uavs[0], id="bringer", voyage=3.0, loadlist=(4.0,))
    empty = tuple(replace(base, stock=(0.0,)) for base in problem.bases)
    objective = replace(problem.objective, loading="planned", unloading="planned")
    problem = replace(problem, uavs=(*problem.uavs, bringer), bases=empty, objective=objective)
    assert not nothing_to_fly(problem)
