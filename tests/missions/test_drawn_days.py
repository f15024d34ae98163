"""Days drawn from seeds: what truly happens, by hand-computed numbers, and held against hindsight."""

from dataclasses import replace

import numpy as np
import pytest

from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.missions.days.flying_a_day import Arm, fly_day
from app.missions.days.futures import over_futures
from app.missions.days.hindsight import in_hindsight
from app.missions.days.insertion import insert
from app.missions.days.kinds import APPEARING_UNTIL, FAILING, KINDS, Day, draw
from app.missions.state import Stop, with_routes, without_plan
from app.simulation.amounts import Amounts
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import replayed, reward_of
from app.simulation.explain import timed_routes
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters


def inserting(state, _number, _rng):
    return insert(state.problem, state.routes)


INSERTION = Arm(inserting)
MORNING = Arm(inserting, replans=False)


def day(load=4.0, **turns_out):
    """One UAV at x = 0, of speed 1; areas at x = 2 and x = 5, which need 2 of what it carries."""
    areas = (
        Target("area-1", 2.0, 0.0, 1.0, (2.0,), deadline=4.5),
        Target("area-2", 5.0, 0.0, 1.0, (2.0,), deadline=6.0),
    )
    problem = Problem(
        uavs=(UAV("uav-1", 0.0, 0.0, 0.0, 0.0, 1.0, 30.0, (load,)),),
        targets=areas,
        objective=Objective(distance_weight=0.01, charge_return=True),
        max_steps=6,
    )
    known = {each.id: each for each in areas}
    return Day(
        **{"kind": "by hand", "seed": 0, "problem": problem, "areas": known, "reports": known, **turns_out}
    )


def made(flown):
    return [(each.stop.id, each.time, each.amounts) for each in flown.done]


def test_a_day_on_which_nothing_turns_out_otherwise_earns_what_its_plan_earns():
    flown = fly_day(day(), INSERTION, 0)
    assert made(flown) == [("area-1", 2.0, (2.0,)), ("area-2", 5.0, (2.0,))]
    assert (flown.satisfaction, flown.distance) == (2.0, 10.0)
    assert flown.reward == pytest.approx(2.0 - 0.01 * 10.0)
    for seed in range(5):
        calm = draw("needs", seed)
        calm = Day("calm", seed, calm.problem, calm.reports, calm.reports)
        problem = calm.problem
        plan = insert(without_plan(problem), [()] * problem.n_uavs)
        earns = reward_of(with_routes(without_plan(problem), plan), _plan(problem, plan))
        assert fly_day(calm, INSERTION, 0).reward == pytest.approx(earns)


def test_a_leg_that_takes_longer_is_late_and_what_is_too_late_is_not_visited():
    flown = fly_day(day(slowness={("uav-1", "area-1"): 1.25}), INSERTION, 0)
    assert [(stop, round(at, 6)) for stop, at, _ in made(flown)] == [("area-1", 2.5), ("area-2", 5.5)]
    flown = fly_day(day(slowness={("uav-1", "area-1"): 2.0}), INSERTION, 0)
    assert [(stop, round(at, 6)) for stop, at, _ in made(flown)] == [("area-1", 4.0)]
    assert flown.satisfaction == 1.0
    # It turns round where it hears of it, and the way home is paid for.
    assert flown.distance == pytest.approx(4.0)


def test_a_uav_unloads_what_is_really_needed_and_the_plan_follows():
    really = {**day().areas, "area-1": Target("area-1", 2.0, 0.0, 0.5, (3.0,), deadline=4.5)}
    flown = fly_day(day(areas=really, corrected={"area-1": 9.0}), INSERTION, 0)
    assert made(flown) == [("area-1", 2.0, (3.0,)), ("area-2", 5.0, (1.0,))]
    assert flown.satisfaction == 0.5 + 0.5
    nothing = {**day().areas, "area-1": Target("area-1", 2.0, 0.0, 1.0, (0.0,))}
    flown = fly_day(day(areas=nothing, corrected={"area-1": 1.0}), INSERTION, 0)
    assert made(flown) == [("area-2", 5.0, (2.0,))]


def test_a_lost_uav_makes_no_more_visits_and_an_area_is_visited_once_it_is_known():
    flown = fly_day(day(lost={"uav-1": 3.0}), INSERTION, 0)
    assert made(flown) == [("area-1", 2.0, (2.0,))]
    assert flown.distance == 3.0
    known = {**day().areas, "area-3": Target("area-3", 2.0, 1.0, 1.0, (1.0,))}
    later = day(load=6.0, areas=known, reports=known, appears={"area-3": 1.0})
    assert {stop for stop, _, _ in made(fly_day(later, INSERTION, 0))} == {"area-1", "area-2", "area-3"}
    assert fly_day(later, MORNING, 0).satisfaction == 2.0


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if kind.slowest == 1.0])
def test_what_was_flown_is_no_better_than_a_plan_in_hindsight(kind):
    for seed in range(3):
        drawn = draw(kind, seed)
        flown, whole = fly_day(drawn, INSERTION, 0), in_hindsight(drawn)
        # Amounts are given, as who unloads first is by time on the day, by the plan's steps in hindsight.
        whole = replace(whole, objective=replace(whole.objective, unloading="planned"))
        useful = [each for each in flown.done if each.stop.is_base or any(each.amounts)]
        routes = [tuple(each.stop for each in useful if each.uav_id == uav.id) for uav in whole.uavs]
        plan, arrays = _plan(whole, routes).as_array(), compile_problem(whole)
        result, _ = replayed(whole, arrays, plan, _amounts(whole, plan, useful))
        assert result.reward[0] >= flown.reward - 1e-9


def test_legs_take_as_long_in_hindsight_as_on_the_day():
    slow = day(slowness={("uav-1", "area-1"): 1.25, ("uav-1", "area-2"): 1.1})
    whole = in_hindsight(slow)
    (route,) = timed_routes(whole, _plan(whole, [(Stop("area-1"), Stop("area-2"))]))
    times = [stop.begin_time for stop in route.stops]
    assert times == pytest.approx([2.5, 2.5 + 3.3])
    assert [each.time for each in fly_day(slow, INSERTION, 0).done] == pytest.approx(times, abs=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_a_day_follows_from_its_seed(kind):
    first, second = draw(kind, 7), draw(kind, 7)
    assert first == second
    assert draw(kind, 8) != first
    assert fly_day(first, INSERTION, 0).done == fly_day(second, INSERTION, 0).done
    assert all(0.0 < at < APPEARING_UNTIL for at in first.appears.values())
    assert all(FAILING[0] <= at < FAILING[1] for at in first.lost.values())
    assert set(first.corrected) == {name for name, each in first.reports.items() if each != first.areas[name]}


def test_a_plan_over_futures_is_of_what_is_known_and_follows_from_the_seeds():
    greedy = create_solver("greedy", parse_parameters("greedy", {}), SolverContext())
    drawn, arm = draw("all", 3), Arm(over_futures(greedy, 60.0, "all"), ticks=True)
    flown = fly_day(drawn, arm, 1)
    known = set(drawn.areas) | {base.id for base in drawn.problem.bases}
    assert {each.stop.id for each in flown.done} <= known
    assert flown.done == fly_day(drawn, arm, 1).done
    assert flown.done != fly_day(drawn, arm, 2).done


def test_insertion_puts_a_visit_where_its_way_is_shortest():
    problem = day().problem
    assert insert(problem, [(Stop("area-2"),)]) == ((Stop("area-1"), Stop("area-2")),)


def _plan(problem, routes):
    return Plan(with_routes(without_plan(problem), routes).start_plan)


def _amounts(problem, plan, done):
    amounts = np.zeros((2, *plan.shape, problem.n_materials))
    for i, uav in enumerate(problem.uavs):
        for s, each in enumerate(each for each in done if each.uav_id == uav.id):
            amounts[int(each.stop.is_base), s, i] = each.amounts
    return Amounts(amounts[0], amounts[1])
