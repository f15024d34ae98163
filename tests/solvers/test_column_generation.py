"""Column generation against brute force over all routes: the relaxation, the bound, and plans from them."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from parcels import legal_routes, parcels
from referee import replay
from stopping import After

from app.domain.records import problem_to_record
from app.simulation.arrays import compile_problem
from app.simulation.generator import FAMILIES, generate
from app.solvers.bound import whole_routes
from app.solvers.bound.instance import new_instance
from app.solvers.bound.upper_bound import upper_bound
from app.solvers.bound.visits import visit_bound
from app.solvers.bound.whole_routes import route_bound
from app.solvers.column_generation import labelling
from app.solvers.column_generation.diving import dive
from app.solvers.column_generation.packing import Packing
from app.solvers.column_generation.pool import always_whole, collect, new_pool
from app.solvers.column_generation.pricing import Pricing
from app.solvers.exact import Exact
from app.solvers.local_search.annealing import actions_of, drop_useless, new_search, set_routes
from app.solvers.local_search.combination import Combination
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import ExactParameters, LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import Deadline, never

VARIANTS = {
    "deadlines": {},
    "distance costs": {"weight": 1.5, "latest": 0.9},
    "the way home costs": {"weight": 1.0, "charge_return": True},
    "range": {"latest": None, "voyage": 1.1},
    "range and the way home": {"latest": None, "voyage": 1.6, "return_to_base": True, "weight": 0.3},
    "loads": {"load": 2.0, "latest": 0.8},
    "steps": {"steps": 2, "latest": None},
    "nothing runs out": {"latest": None, "voyage": 100.0, "m": 2, "weight": 2.0},
}


def problem_of(variant, seed, **changes):
    rng = np.random.default_rng([20, list(VARIANTS).index(variant), seed])
    return parcels(rng, **{"m": 3, "n": 6, "steps": 4, **VARIANTS[variant], **changes})


def all_routes(problem, arrays):
    """A pool of every set of targets that a UAV can visit, with the length of its best order."""
    pool = new_pool(arrays)
    for i in np.unique(pool.kind).tolist():
        for targets, distance in legal_routes(problem, i).items():
            order = np.array(sorted(targets))
            collect(arrays, pool, i, order, len(order), np.zeros(len(order) + 1))
            pool.distance[int(pool.size[0]) - 1] = distance
    return pool


def closed(problem, best=-1e9, **options):
    arrays = compile_problem(problem)
    pool = new_pool(arrays)
    packing, pricing = Packing(arrays, pool), Pricing(arrays, pool, **options)
    return packing, pricing, pricing.close(packing, best, never), pool


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_relaxation_is_that_of_all_routes(variant, seed):
    problem = problem_of(variant, seed)
    arrays = compile_problem(problem)
    everything = all_routes(problem, arrays)
    whole = Packing(arrays, everything).relax()
    _, pricing, relaxed, pool = closed(problem)
    assert relaxed.reward == pytest.approx(whole.reward, abs=1e-6)
    assert pricing.bound == pytest.approx(whole.reward, abs=1e-6)
    assert pool.size[0] <= everything.size[0]


@pytest.mark.parametrize("seed", range(3))
def test_the_level_of_an_area_that_needs_nothing_does_not_count(seed):
    problem = problem_of("loads", seed)
    problem = replace(problem, targets=tuple(replace(t, level=t.level / 100) for t in problem.targets))
    met = replace(problem.targets[0], id="met", level=1e12, loadlist=(0.0,))
    _, _, relaxed, _ = closed(problem)
    _, _, beside, _ = closed(replace(problem, targets=(*problem.targets, met)))
    assert beside.reward == pytest.approx(relaxed.reward, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("variant", VARIANTS)
def test_no_plan_exceeds_the_bound(variant, seed):
    problem = problem_of(variant, seed, n=5, steps=3)
    arrays = compile_problem(problem)
    routes = [[(frozenset(), None), *legal_routes(problem, i).items()] for i in range(problem.n_uavs)]
    levels, weight = arrays.areas["level"][0], float(arrays.terms["weight"][0])
    idle = float(arrays.uavs["start_home"][0, 0]) * bool(arrays.terms["charge_return"][0])
    best = max(
        sum(levels[j] for j in frozenset().union(*(targets for targets, _ in plan)))
        - weight * sum(idle if distance is None else distance for _, distance in plan)
        for plan in product(*routes)
    )
    bound = upper_bound(problem, None, never)
    assert bound.value >= best - 1e-9
    instance = new_instance(problem)
    by_routes = route_bound(instance, 0.0, never) * instance.scale
    if always_whole(arrays):
        assert best - 1e-9 <= by_routes <= 1.2 * best
    else:
        assert by_routes == np.inf
    found = LocalSearch(LocalSearchParameters(moves=20_000, restarts=1), SolverContext()).solve(
        problem, 1, never, lambda _: None
    )
    assert found.history.reward[-1] == pytest.approx(best, abs=1e-6)


def test_what_is_forgotten_is_remembered_where_it_matters(monkeypatch):
    monkeypatch.setattr(labelling, "_MEMORY", 1)
    for variant, seed in product(VARIANTS, range(2)):
        problem = problem_of(variant, seed)
        arrays = compile_problem(problem)
        whole = Packing(arrays, all_routes(problem, arrays)).relax()
        _, pricing, relaxed, _ = closed(problem)
        assert relaxed.reward == pytest.approx(whole.reward, abs=1e-6)
        assert pricing.bound == pytest.approx(whole.reward, abs=1e-6)


def test_nobody_is_sent_where_nothing_is_needed():
    problem = problem_of("deadlines", 7, n=8)
    least, *others = sorted(problem.targets, key=lambda target: target.level)
    served = replace(least, level=100.0, loadlist=(0.0,))
    problem = replace(problem, targets=(served, *others))
    _, pricing, relaxed, pool = closed(problem)
    routes = [set(pool.target[q, : pool.length[q]].tolist()) for q in range(int(pool.size[0]))]
    assert routes
    assert all(0 not in route for route in routes)
    assert relaxed.reward <= pricing.bound + 1e-6 < 100.0
    assert relaxed.price[0] == 0.0


def test_too_many_labels_give_routes_but_no_bound():
    problem = problem_of("deadlines", 1, n=12, m=4)
    _, pricing, relaxed, pool = closed(problem, room=40)
    assert pricing.bound == np.inf
    assert pool.size[0] > 0
    assert relaxed.reward > 0


def test_routes_that_no_better_plan_can_use_are_not_added():
    problem = problem_of("distance costs", 3, n=12, m=4)
    _, _, relaxed, everything = closed(problem)
    _, _, again, few = closed(problem, best=relaxed.reward - 1e-3)
    assert again.reward == pytest.approx(relaxed.reward)
    assert few.size[0] < everything.size[0]


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_dive_ends_in_a_plan_worth_what_it_was_asked_for(variant):
    problem = problem_of(variant, 5, n=10, m=4)
    packing, pricing, relaxed, _ = closed(problem)
    actions = dive(packing, pricing, relaxed, -1e9, never)
    assert packing.fixed == []
    search = new_search(compile_problem(problem))
    set_routes(search, actions)
    drop_useless(search)
    reward = float(search.best[0])
    assert 0.7 * relaxed.reward <= reward <= relaxed.reward + 1e-6
    assert replay(problem_to_record(problem), actions_of(search).tolist())["reward"] == pytest.approx(reward)
    assert dive(packing, pricing, packing.relax(), relaxed.reward + 1.0, never) is None


def test_fixed_routes_are_used_and_count():
    problem = problem_of("distance costs", 6, n=10, m=3)
    packing, _, relaxed, pool = closed(problem)
    assert packing.spare()[pool.kind].tolist() == [2, 1, 2]
    worst = int(np.argmax(relaxed.loss * (pool.kind[pool.uav[: pool.size[0]]] == 0)))
    packing.fix([worst])
    assert packing.spare()[pool.kind].tolist() == [1, 1, 1]
    assert packing.room_for(np.array([worst]))
    assert not packing.room_for(np.array([worst, worst]))
    fixed = packing.relax()
    assert fixed.share[worst] == pytest.approx(1.0)
    assert fixed.reward < relaxed.reward
    packing.loosen()
    assert packing.relax().reward == pytest.approx(relaxed.reward)


def test_a_search_ends_when_its_plan_is_proven_best():
    problem = parcels(np.random.default_rng(21), m=5, n=25, latest=0.5)
    stop = Deadline(30.0)
    search = LocalSearch(LocalSearchParameters(), SolverContext())
    last = []
    solution = search.solve(problem, 1, stop, lambda progress: last.append(progress.fraction))
    assert stop.seconds_left() > 15.0
    assert last[-1] == 1.0
    reward = solution.history.reward[-1]
    assert upper_bound(problem, reward, never) == (pytest.approx(reward), True)
    proof = Exact(ExactParameters(), SolverContext()).solve(problem, 1, never, lambda _: None).proof
    assert proof.proven
    assert proof.bound == pytest.approx(reward)


def test_the_bound_over_visits_is_left_where_labels_are_too_many(monkeypatch):
    monkeypatch.setattr(whole_routes, "_ROOM", 100)
    problem = parcels(np.random.default_rng(24), m=12, n=70, latest=0.6, weight=0.2)
    instance = new_instance(problem)
    assert route_bound(instance, 0.0, never) == np.inf
    over_visits = visit_bound(instance, 0.0, never)
    assert over_visits < 0.999 * instance.worth.sum()
    deadline = Deadline(2.0)
    assert upper_bound(problem, None, deadline).value <= over_visits * instance.scale * (1.0 + 1e-9)


def test_a_combination_ends_when_it_is_told_to():
    problem = parcels(np.random.default_rng(23), m=6, n=40, latest=0.6)
    search = new_search(compile_problem(problem))
    combination = Combination([search], rounds=2, left=math.inf)
    stop = After(3)
    combination.after_round(1, 2, stop)
    assert 3 < stop.asked < 40
    assert not combination.proven
    whole = Combination([search], rounds=2, left=math.inf)
    going_on = After(1000)
    whole.after_round(1, 2, going_on)
    assert going_on.asked > 2 * stop.asked
    assert search.best[0] > 0.0


def test_where_targets_share_loads_there_is_no_bound_over_whole_routes():
    rng = np.random.default_rng(22)
    for family in sorted(FAMILIES):
        problem = generate(family, 5, 10, 3, rng)
        assert route_bound(new_instance(problem), 0.0, never) == np.inf
    problem = parcels(rng)
    assert always_whole(compile_problem(problem))
    returning = tuple(replace(u, ret=True, loadlist=(0.0,)) for u in problem.uavs[:1])
    assert always_whole(compile_problem(replace(problem, uavs=returning + problem.uavs[1:])))
    poor = tuple(replace(u, loadlist=(4.9,)) for u in problem.uavs)
    assert not always_whole(compile_problem(replace(problem, uavs=poor)))
