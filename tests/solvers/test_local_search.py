"""The local search: incremental evaluation against the simulator, tiny problems against brute force."""

from dataclasses import replace

import numpy as np
import pytest
from brute_force import best_reward
from brute_force_unloading import best_planned_reward
from cases import problem_of
from problems import random_problem
from referee import replay
from searches import Clock, assert_evaluated
from stopping import After

from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import (
    Prices,
    actions_of,
    anneal,
    draw_change,
    drop_useless,
    new_search,
    set_routes,
)
from app.solvers.local_search.ceiling import most_satisfaction
from app.solvers.local_search.change import apply, extra_closing, extra_distance, undo
from app.solvers.local_search.effort import default_moves, default_restarts
from app.solvers.local_search.improvement import Cooling, improve
from app.solvers.local_search.routes import SATISFACTION, USELESS
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import Deadline, never


def quiet(*_told):
    """Nobody is told."""


def solve(problem, *, seed=1, stop=never, report=quiet, **parameters):
    solver = LocalSearch(LocalSearchParameters(**parameters), SolverContext())
    return solver.solve(problem, seed, stop, report)


def able(rng, count, **sizes):
    """Searches of random problems in which somebody may fly, with every option of the specification."""
    found = []
    while len(found) < count:
        problem = random_problem(rng, **sizes)
        search = new_search(compile_problem(problem))
        if len(search.near.active) and len(search.near.wanted):
            found.append((problem, search))
    return found


def test_totals_stay_those_of_the_simulator_through_random_moves():
    rng = np.random.default_rng(11)
    applied = undone = useless = 0
    for problem, search in able(rng, 150, max_uavs=7, max_targets=9):
        set_routes(search, greedy_plan(problem).as_array())
        assert_evaluated(search)
        for _ in range(60):
            if not draw_change(search, rng, large=0.5):
                continue
            extra = extra_distance(search.arrays, search.routes, search.change)
            closing = extra_closing(search.arrays, search.routes, search.change)
            apply(search.arrays, search.routes, search.change, extra, closing)
            applied += 1
            if rng.random() < 0.4:
                undo(search.arrays, search.routes, search.change)
                undone += 1
            useless += search.routes.total[USELESS] > 0.5
            assert_evaluated(search)
    assert min(applied - undone, undone, useless) > 300


def test_undoing_leaves_no_trace():
    rng = np.random.default_rng(12)
    for problem, search in able(rng, 60):
        set_routes(search, greedy_plan(problem).as_array())
        for _ in range(40):
            before = [each.copy() for each in search.routes]
            lengths = search.routes.length.copy()
            if not draw_change(search, rng, large=0.5):
                continue
            apply(
                search.arrays,
                search.routes,
                search.change,
                extra_distance(search.arrays, search.routes, search.change),
                extra_closing(search.arrays, search.routes, search.change),
            )
            if rng.random() < 0.3:
                continue
            undo(search.arrays, search.routes, search.change)
            assert np.array_equal(search.routes.length, lengths)
            for name, now, then in zip(search.routes._fields, search.routes, before, strict=True):
                if name in ("first", "total"):
                    assert np.array_equal(now, then), name
            for i, length in enumerate(lengths):
                slots = np.arange(length) * len(lengths) + i
                for name in ("load", "need", "earned", "useless", "following", "preceding"):
                    now = getattr(search.routes, name)
                    assert np.array_equal(now[slots], before[search.routes._fields.index(name)][slots]), name
                assert np.array_equal(search.routes.target[i, :length], before[0][i, :length])


def test_annealed_plans_are_legal_and_earn_what_the_search_says():
    rng = np.random.default_rng(13)
    for problem, search in able(rng, 60, max_uavs=8, max_targets=10):
        scale = max(float(search.arrays.areas["level"].max()), 1e-9)
        anneal(search, rng, 3000, 0.2 * scale, 0.05 * scale, Prices(0.01 * scale), large=0.3)
        assert_evaluated(search)
        assert search.routes.total[SATISFACTION] <= search.most
        drop_useless(search)
        assert search.routes.total[USELESS] == 0
        assert_evaluated(search)
        record, rows = problem_to_record(problem), actions_of(search).tolist()
        assert replay(record, rows)["reward"] == pytest.approx(search.best[0], abs=1e-9)


def test_no_plan_satisfies_more_than_the_ceiling_whatever_distance_costs():
    rng = np.random.default_rng(15)
    reached = 0
    for _ in range(60):
        problem = random_problem(rng, max_uavs=2, max_targets=3)
        free = replace(problem, max_steps=2, objective=replace(problem.objective, distance_weight=0.0))
        most = most_satisfaction(compile_problem(free))
        best = best_planned_reward(problem_to_record(free))
        assert best <= most + 1e-12
        reached += most > 0 and best > 0.999 * most
    assert reached > 5


def test_the_ceiling_gives_a_material_to_whom_it_is_worth_most():
    def target(name, x, needs, level):
        return Target(id=name, x=x, y=0.0, loadlist=needs, level=level)

    def uav(name, loads, voyage):
        return UAV(id=name, x_s=0.0, y_s=0.0, x_c=0.0, y_c=0.0, loadlist=loads, speed=1.0, voyage=voyage)

    # Units are worth 3, 1 and 1 (out of range); five of the first material, none of the second, are carried.
    targets = (target("a", 1.0, (4.0, 0.0), 12.0), target("b", 2.0, (6.0, 4.0), 10.0))
    far = target("c", 50.0, (8.0, 0.0), 8.0)
    problem = Problem(uavs=(uav("u", (5.0, 0.0), 10.0),), targets=(*targets, far), max_steps=5)
    assert most_satisfaction(compile_problem(problem)) == pytest.approx(4 * 3 + 1 * 1, rel=1e-5)


def test_tiny_problems_are_solved_to_the_optimum():
    rng = np.random.default_rng(14)
    solved = 0
    while solved < 40:
        problem = random_problem(rng, max_uavs=3, max_targets=4)
        problem = replace(problem, max_steps=min(problem.max_steps, 3 if problem.n_uavs < 3 else 2))
        best = best_reward(problem_to_record(problem))
        found = reward_of(problem, solve(problem, moves=20_000).plan)
        assert found == pytest.approx(best, abs=1e-9)
        solved += best > 0.01


def test_a_plan_in_which_something_is_useless_at_the_end_is_not_lost():
    # So large that some visit is always useless while it is hot.
    problem = generate("deadline", 60, 150, 3, np.random.default_rng(5))
    greedy = reward_of(problem, greedy_plan(problem))
    assert reward_of(problem, solve(problem, moves=400_000).plan) > 1.05 * greedy


EDGES = {
    "one target": {"size": (4, 1, 2)},
    "one UAV": {"size": (1, 6, 2)},
    "one of each": {"size": (1, 1, 1)},
    "many materials": {"size": (5, 8, 64)},
    "one step": {"size": (5, 8, 2), "max_steps": 1},
    "a hundred steps": {"size": (4, 12, 2), "max_steps": 100},
    "distance costs nothing": {"size": (5, 8, 2), "objective": Objective(0.0)},
    "distance costs all": {"size": (5, 8, 2), "objective": Objective(1e9)},
    "the way home costs": {"size": (5, 8, 2), "objective": Objective(1.0, charge_return=True)},
    "no way home": {"size": (5, 8, 2), "objective": Objective(1.0, return_to_base=False)},
}


@pytest.mark.parametrize("edge", EDGES.values(), ids=EDGES)
def test_edges_are_legal_and_not_below_the_greedy_rule(edge):
    for family in ("uniform", "mid_mission", "deadline"):
        problem = generate(family, *edge["size"], np.random.default_rng(6))
        problem = replace(
            problem,
            max_steps=edge.get("max_steps", problem.max_steps),
            objective=edge.get("objective", problem.objective),
        )
        plan = solve(problem, moves=5000).plan
        rows = [list(row) for row in plan.assignment]
        earned = replay(problem_to_record(problem), rows)["reward"]
        assert earned >= reward_of(problem, greedy_plan(problem)) - 1e-9


@pytest.mark.parametrize("change", ["nobody may fly", "nobody carries", "nothing is needed", "no level"])
def test_where_nothing_can_be_earned_everybody_stays_at_home(change):
    problem = generate("uniform", 3, 4, 2, np.random.default_rng(7))
    uavs, targets = problem.uavs, problem.targets
    if change == "nobody may fly":
        uavs = tuple(replace(u, ret=True) for u in uavs)
    elif change == "nobody carries":
        uavs = tuple(replace(u, loadlist=(0.0, 0.0)) for u in uavs)
    elif change == "nothing is needed":
        targets = tuple(replace(t, loadlist=(0.0, 0.0)) for t in targets)
    else:
        targets = tuple(replace(t, level=0.0) for t in targets)
    solution = solve(replace(problem, uavs=uavs, targets=targets), moves=1000)
    assert solution.plan.assignment == ((4, 4, 4),)


def test_asking_the_stop_criterion_changes_nothing():
    problem = generate("uniform", 6, 9, 2, np.random.default_rng(8))
    counting = After(10**9)
    first = solve(problem, moves=60_000, restarts=2)
    again = solve(problem, moves=60_000, restarts=2, stop=counting)
    assert (first.plan, first.history) == (again.plan, again.history)
    assert counting.asked > 15
    assert first.history.epoch == [0, 1, 2, 3]
    assert first.history.reward == sorted(first.history.reward)


def test_stopped_in_the_middle_it_returns_what_it_has():
    problem = generate("uniform", 10, 20, 3, np.random.default_rng(9))
    for allowed in (0, 1, 5, 50):
        solution = solve(problem, moves=10**9, stop=After(allowed))
        earned = replay(problem_to_record(problem), [list(row) for row in solution.plan.assignment])["reward"]
        assert earned >= max(solution.history.reward) - 1e-9
        assert solution.history.epoch == list(range(len(solution.history.epoch)))


def test_what_was_used_comes_back():
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(10))
    arrays = compile_problem(problem)
    used = solve(problem).parameters
    assert (used.moves, used.restarts) == (
        default_moves(arrays),
        default_restarts(arrays, default_moves(arrays), np.zeros(len(arrays.uavs[0]), np.int64)),
    )
    assert solve(problem, moves=0).history.epoch[0] == 0
    given = LocalSearchParameters(moves=300, restarts=4)
    assert solve(problem, moves=300, restarts=4).parameters == given


def test_moves_are_all_made_whatever_the_rounds():
    search = new_search(compile_problem(generate("uniform", 4, 6, 2, np.random.default_rng(11))))
    told = []
    improve(
        search,
        np.random.default_rng(1),
        1001,
        7,
        Cooling(),
        never,
        lambda done, ended: told.append((done, ended)),
    )
    assert told[-1] == (1.0, 7)
    assert told == sorted(told)


def test_several_threads_give_the_same_plan_each_time_and_none_worse_than_its_start():
    problem = generate("uniform", 6, 12, 2, np.random.default_rng(3))
    context = SolverContext(threads=3)
    parameters = LocalSearchParameters(moves=4000, restarts=2)
    first, again = (LocalSearch(parameters, context).solve(problem, 5, never, quiet) for _ in range(2))
    assert (first.plan, first.history) == (again.plan, again.history)
    assert first.history.epoch == [0, 1, 2, 3]
    assert first.history.reward == sorted(first.history.reward)
    assert replay(problem_to_record(problem), first.plan.assignment)["reward"] == pytest.approx(
        first.history.reward[-1], abs=1e-9
    )


def test_under_a_time_limit_it_searches_on_idle_cores_too_as_long_as_they_are(monkeypatch):
    problem = generate("uniform", 6, 12, 2, np.random.default_rng(3))
    searched, asked = set(), []

    def spare():
        asked.append(len(asked))
        return 2 if len(asked) < 20 else 0

    def note(search, *_given):
        searched.add((id(search), len(asked) < 20))
        anneal(search, *_given)

    monkeypatch.setattr("app.solvers.local_search.improvement.anneal", note)
    search = LocalSearch(LocalSearchParameters(), SolverContext(spare_threads=spare))
    solution = search.solve(problem, 5, Deadline(0.5), quiet)
    assert len({who for who, while_idle in searched if while_idle}) == 3
    earned = replay(problem_to_record(problem), solution.plan.assignment)["reward"]
    assert earned == pytest.approx(solution.history.reward[-1], abs=1e-9)
    asked.clear()
    searched.clear()
    context = SolverContext(spare_threads=spare)
    alone = LocalSearch(LocalSearchParameters(moves=4000), context).solve(problem, 5, never, quiet)
    assert (len(searched), asked) == (1, [])
    plain = LocalSearch(LocalSearchParameters(moves=4000), SolverContext()).solve(problem, 5, never, quiet)
    assert alone.plan == plain.plan


def test_a_search_is_cold_when_its_time_is_up(monkeypatch):
    problem = generate("uniform", 6, 12, 2, np.random.default_rng(3))
    clock, temperatures = Clock(0.001), []
    monkeypatch.setattr("app.solvers.local_search.improvement.time.monotonic", clock)

    def note(_search, _rng, _moves, hot, cold, *_prices):
        temperatures.append((hot, cold))

    monkeypatch.setattr("app.solvers.local_search.improvement.anneal", note)
    told = []
    solve(problem, stop=Deadline(0.4, clock), report=told.append)
    cooling, scale = Cooling(), max(target.level for target in problem.targets)
    assert temperatures[0][0] == pytest.approx(cooling.hot * scale, rel=0.1)
    assert temperatures[-1][1] == pytest.approx(cooling.cold * scale, rel=0.1)
    assert [progress.fraction for progress in told] == sorted(progress.fraction for progress in told)
    assert told[-1].fraction == 1.0


FAR_AWAY = {
    "local-search-33-percent-below-exact": 1.0054918,
    "local-search-low-cluster-243": 0.2765954,
    "tight-cluster-6x14": 17.0415125,
}


@pytest.mark.parametrize("name", FAR_AWAY)
def test_areas_close_together_and_far_away_are_flown_to(name):
    problem = problem_of(name)
    earned = reward_of(problem, solve(problem, moves=150_000).plan)
    assert earned >= FAR_AWAY[name] * (1.0 - 1e-6)


def test_the_search_leaves_home_where_no_visit_pays_alone():
    """The way to the village costs more than any area in it earns, and less than two of them do."""
    uavs = tuple(UAV(f"uav-{i}", *4 * (0.0,), speed=60.0, voyage=30.0, loadlist=(20.0,)) for i in range(2))
    targets = tuple(Target(f"area-{j}", 10.0 + 0.01 * j, 0.0, 1.0, (5.0,)) for j in range(8))
    problem = Problem(uavs, targets, 4, objective=Objective(distance_weight=0.15))
    assert reward_of(problem, greedy_plan(problem)) == 0.0
    assert reward_of(problem, solve(problem, moves=50_000).plan) == pytest.approx(8 - 3.0, abs=0.05)


def test_where_a_uav_has_been_far_away_rewards_are_as_exact():
    problem = generate("uniform", 4, 8, 2, np.random.default_rng(5))
    uavs = tuple(replace(uav, dis=1e9, voyage=uav.voyage + 1e9) for uav in problem.uavs)
    far = replace(problem, uavs=uavs)
    solution = solve(far, moves=20_000)
    assert solution.history.reward[-1] == pytest.approx(reward_of(far, solution.plan), rel=1e-12)
