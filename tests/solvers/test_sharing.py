"""A plan that several threads share: parts are apart, and what they find together is a legal plan."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from referee import replay

from app.domain.plan import Plan
from app.domain.records import problem_to_record
from app.simulation.arrays import compile_problem
from app.simulation.generator import FAMILIES, generate
from app.simulation.world_generator import WORLD_FAMILIES
from app.solvers.local_search.annealing import Prices, actions_of, drop_useless, new_search, replica, worth
from app.solvers.local_search.sharing import Team, pays, share_out
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.start import begin_search
from app.solvers.stop import Deadline, never

ALL = {**FAMILIES, **WORLD_FAMILIES}


def searching(family, m=24, n=40):
    problem = ALL[family](m, n, 2, np.random.default_rng([5, len(family)]))
    search = new_search(compile_problem(problem))
    begin_search(search, problem, never)
    return problem, search


@pytest.mark.parametrize("parts", [2, 3, 5])
@pytest.mark.parametrize("family", ["uniform", "corridor", "sorties", "matrix", "promised"])
def test_every_uav_and_every_area_is_in_one_part(family, parts):
    _, search = searching(family)
    nears = share_out(search, np.random.default_rng(1), parts)
    assert len(nears) == parts
    assert sum(len(near.wanted) > 0 for near in nears) > 1
    assert sorted(np.concatenate([near.active for near in nears])) == sorted(search.near.active)
    assert sorted(np.concatenate([near.wanted for near in nears])) == sorted(search.near.wanted)
    for near in nears:
        assert set(near.active) == set(np.flatnonzero(near.own))
        if not len(near.wanted):
            continue
        # What a visit of the part may be followed by, or begin with.
        first = search.routes.target[near.active, 0]
        begins_here = np.isin(first, near.wanted) | (search.routes.length[near.active] == 0)
        assert np.isin(near.near_target[near.wanted], near.wanted).all()
        assert np.isin(near.near_start[near.active[begins_here]], near.wanted).all()


def test_those_who_meet_at_an_area_are_mostly_in_one_part():
    _, search = searching("scarce", 40, 80)
    routes, apart, met = search.routes, 0, 0
    for near in share_out(search, np.random.default_rng(2), 2):
        for i in near.active:
            stops = routes.target[i, : routes.length[i]]
            met += len(stops)
            apart += int((~np.isin(stops, near.wanted)).sum())
    assert apart < 0.25 * met


@pytest.mark.parametrize("family", ["uniform", "deadline", "scarce", "sorties", "stock", "fair", "promised"])
def test_what_threads_find_together_is_a_legal_plan_that_earns_what_they_say(family):
    problem, search = searching(family)
    began = float(search.best[0])
    searches = [search, replica(search), replica(search)]
    generators = [np.random.default_rng(number) for number in range(3)]
    with ThreadPoolExecutor(2) as threads:
        team = Team(searches, generators, [never] * 3, threads)
        for temperature in np.geomspace(1.0, 0.01, 30):
            team.anneal(2000, 500, temperature, temperature, Prices(0.1), False, 0.1)
    drop_useless(search)
    plan = Plan.of(actions_of(search), problem.n_targets)
    assert replay(problem_to_record(problem), plan.assignment)["reward"] == pytest.approx(
        float(search.best[0]), abs=1e-9
    )
    assert float(search.best[0]) > began


def test_a_thread_that_is_needed_elsewhere_leaves_and_the_others_go_on():
    _, search = searching("uniform")
    began = float(search.best[0])
    asked = []

    def gone():
        asked.append(True)
        return len(asked) > 3

    searches = [search, replica(search)]
    with ThreadPoolExecutor(1) as threads:
        team = Team(searches, [np.random.default_rng(n) for n in (1, 2)], [never, gone], threads)
        for temperature in np.geomspace(1.0, 0.01, 30):
            team.anneal(2000, 500, temperature, temperature, Prices(0.1), False, 0.1)
    # Three times before it left, then once for each piece.
    assert len(asked) > 30
    assert float(search.best[0]) > began


def test_a_change_in_which_more_is_lost_than_found_is_taken_back():
    _, search = searching("stock", 30, 60)
    searches = [search, replica(search)]
    with ThreadPoolExecutor(1) as threads:
        team = Team(searches, [np.random.default_rng(n) for n in (1, 2)], [never] * 2, threads)
        before = float(search.best[0])
        for _ in range(20):
            # Cold: no part gets worse by itself, and so the plan does not.
            team.anneal(3000, 3000, 1e-9, 1e-9, Prices(1.0), False, 0.1)
            now = worth(search, 1.0)
            assert now >= before - 1e-9
            before = now


def test_a_shared_search_is_the_same_again_and_better_than_a_thread_alone():
    problem = generate("clustered", 60, 120, 2, np.random.default_rng(4))
    parameters = LocalSearchParameters(moves=100_000, restarts=0)
    solved = [
        LocalSearch(parameters, SolverContext(threads=threads)).solve(problem, 3, never, lambda _told: None)
        for threads in (2, 2, 1)
    ]
    assert (solved[0].plan, solved[0].history) == (solved[1].plan, solved[1].history)
    assert solved[0].history.reward[-1] > solved[2].history.reward[-1]


def test_a_plan_is_shared_where_there_is_little_time_for_many_stops_and_no_common_stock():
    _, search = searching("uniform", 24, 60)
    assert pays(search, 2, 10_000)
    assert not pays(search, 1, 10_000)
    assert not pays(search, 2, 10_000_000)
    assert not pays(search, 24, 10_000)
    assert not pays(searching("stock")[1], 2, 1000)
    assert pays(searching("sorties")[1], 2, 1000)


def test_a_time_limit_holds_where_a_plan_is_shared():
    problem = generate("uniform", 60, 120, 2, np.random.default_rng(4))
    context = SolverContext(threads=1, spare_threads=lambda: 1)
    solution = LocalSearch(LocalSearchParameters(), context).solve(problem, 1, Deadline(0.2), lambda _: None)
    assert replay(problem_to_record(problem), solution.plan.assignment)["reward"] == pytest.approx(
        solution.history.reward[-1], abs=1e-9
    )
