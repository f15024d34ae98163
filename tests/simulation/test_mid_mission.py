"""What remains of a plan at a moment: nothing is lost, and what was planned can still be flown."""

from functools import cache

import numpy as np
import pytest
from problems import random_plan
from worlds import random_sorties, random_world

from app.domain.allocation import Reload
from app.domain.plan import Plan
from app.simulation.breaches import breaches_of
from app.simulation.explain import timed_routes
from app.simulation.mid_mission import remaining_at

MOMENTS = 250


@cache
def moments(draw=random_world):
    """Random problems, the routes of a plan of each, what remains at a moment of it, and that moment."""
    rng = np.random.default_rng(3)
    found = []
    while len(found) < MOMENTS:
        problem = draw(rng)
        plan = random_plan(problem, rng)
        routes = timed_routes(problem, plan)
        ends = [route.landing.time for route in routes if route.landing]
        if ends:
            at = float(rng.uniform(0, 1.1 * max(ends)))
            found.append((problem, routes, remaining_at(problem, plan, at), at))
    return found


def test_what_was_unloaded_is_gone_and_what_was_not_is_still_there():
    for problem, routes, left, at in moments():
        for i, (before, now) in enumerate(zip(problem.uavs, left.uavs, strict=True)):
            begun = [stop for stop in routes[i].stops if stop.begin_time <= at] if not before.ret else []
            gone = np.sum([stop.delivered for stop in begun], axis=0) if begun else 0.0
            np.testing.assert_allclose(now.loadlist, np.subtract(before.loadlist, gone), atol=1e-6)
        begun = [stop for route in routes for stop in route.stops if stop.begin_time <= at]
        for before, now in zip(problem.targets, left.targets, strict=True):
            brought = [stop.delivered for stop in begun if stop.target_id == before.id]
            gone = np.sum(brought, axis=0) if brought else 0.0
            np.testing.assert_allclose(now.loadlist, np.subtract(before.loadlist, gone), atol=1e-6)
            assert (now.requested or now.loadlist) == (before.requested or before.loadlist)


def test_the_rest_of_the_plan_is_legal_and_as_it_was():
    later = same = 0
    for problem, routes, left, at in moments():
        rest = Plan(left.start_plan)
        assert not breaches_of(left, rest)
        # On the globe a leg in wind that begins on the way has another initial bearing.
        loose = 1e-2 if problem.wind and problem.crs == "wgs84" else 1e-6
        planned = {
            (route.uav_id, stop.target_id): stop.begin_time
            for route in routes
            for stop in route.stops
            if stop.begin_time > at
        }
        for route in timed_routes(left, rest):
            for stop in route.stops:
                begin = planned.pop((route.uav_id, stop.target_id))
                assert stop.begin_time == pytest.approx(begin, rel=loose, abs=loose)
                later += 1
        # Steps count anew, so a visit may find nothing left to do.
        same += not planned
    assert later > 100
    assert same > 235


def test_a_uav_between_two_places_is_committed_to_where_it_flies():
    under_way = 0
    for problem, routes, left, at in moments():
        for before, now, route in zip(problem.uavs, left.uavs, routes, strict=True):
            ahead = [stop for stop in route.stops if stop.begin_time > at]
            moved = (now.x_c, now.y_c) != (before.x_c, before.y_c)
            if ahead and moved and not before.ret and not any(s.begin_time <= at for s in route.stops):
                assert now.committed[0] == ahead[0].target_id
                under_way += 1
    assert under_way > 10


def begun_by(route, at):
    """The stops of a route that have begun at a moment: visits unload then, reloads are there."""
    return [
        stop
        for stop in route.stops
        if (stop.arrival_time if isinstance(stop, Reload) else stop.begin_time) <= at
    ]


def test_with_bases_loads_and_stocks_are_what_has_been_taken_and_brought():
    reloads = 0
    for problem, routes, left, at in moments(random_sorties):
        taken = {base.id: np.zeros(problem.n_materials) for base in problem.bases}
        for before, now, route in zip(problem.uavs, left.uavs, routes, strict=True):
            load = np.array(before.loadlist)
            for stop in [] if before.ret else begun_by(route, at):
                if isinstance(stop, Reload):
                    load = load + stop.loaded
                    taken[stop.base_id] += stop.loaded
                    reloads += 1
                else:
                    load = load - stop.delivered
            np.testing.assert_allclose(now.loadlist, load, atol=1e-6)
            assert now.full == before.full
        for before, now in zip(problem.bases, left.bases, strict=True):
            assert (before.stock is None) == (now.stock is None)
            if before.stock is not None:
                np.testing.assert_allclose(now.stock, np.array(before.stock) - taken[before.id], atol=1e-6)
    assert reloads > 50


def test_with_bases_the_rest_of_the_plan_is_legal_and_as_it_was():
    later = same = 0
    for problem, routes, left, at in moments(random_sorties):
        rest = Plan(left.start_plan)
        assert not breaches_of(left, rest)
        loose = 1e-2 if problem.wind and problem.crs == "wgs84" else 1e-6
        for route, now in zip(routes, timed_routes(left, rest), strict=True):
            ahead = route.stops[len(begun_by(route, at)) :]
            kept = [stop for stop in ahead if not isinstance(stop, Reload)]
            # Steps count anew, and who has reloaded is not known to wait on the ground: some are left out.
            if len(ahead) != len(now.stops):
                continue
            same += 1
            for stop, planned in zip(now.visits, kept, strict=True):
                assert stop.target_id == planned.target_id
                assert stop.begin_time == pytest.approx(planned.begin_time, rel=loose, abs=loose)
                later += 1
    assert later > 100
    assert same > 500
