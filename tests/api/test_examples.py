"""The bundled examples: no oddities; what zones and wind do, and what a base does."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from referee import replay
from shapely import LineString, Polygon

from app.allocation import tasks
from app.api.openapi_examples import example_names, example_problem
from app.api.problem_models import ProblemModel, to_problem
from app.domain.geometry import distance
from app.domain.plan import Plan
from app.domain.records import problem_to_record
from app.domain.warnings import problem_warnings
from app.jobs.worker import WorkContext
from app.settings import Settings
from app.simulation.breaches import breaches_of

FOLDER = Path(__file__).parents[2] / "app/examples"
NAUTICAL_MILE_KM = 1.852


def problem_of(name):
    return to_problem(ProblemModel(**example_problem(name)), Settings())


def allocated(problem):
    payload = {
        "problem": problem_to_record(problem),
        "algorithm": "local_search",
        "parameters": {},
        "seed": 123,
        "library_url": None,
    }
    context = WorkContext.in_process(lambda _progress: None, time_limit_s=None)
    return tasks.allocate(payload, context).result


def rewards_told(heading):
    """The rewards in the table of a section of the page."""
    _, after = (FOLDER / "README.md").read_text("utf-8").split(f"\n## {heading}\n")
    return re.findall(r"^\| [a-zA-Z_` ]+ \| ([\d.]+) \|", after.split("\n## ")[0], re.MULTILINE)


@pytest.fixture(scope="module")
def freddy():
    """The example with zones and wind, and a plan of it."""
    problem = problem_of("cyclone-freddy")
    return problem, allocated(problem)


@pytest.fixture(scope="module")
def without_wind(freddy):
    """A plan of the same in still air."""
    return allocated(replace(freddy[0], wind=None))


@pytest.fixture(scope="module")
def without_zones(freddy):
    """A plan of the same where everything may be flown through."""
    return allocated(replace(freddy[0], no_fly_zones=()))


@pytest.fixture(scope="module")
def floods():
    """The example with a base, and a plan of it."""
    problem = problem_of("rwanda-floods")
    return problem, allocated(problem)


@pytest.fixture(scope="module")
def floods_otherwise(floods):
    """Other problems with a base, or without, in the order of the page, and a plan of each."""
    problem, _ = floods
    (base,) = problem.bases
    others = [
        replace(problem, bases=()),
        replace(problem, uavs=(*problem.uavs, replace(problem.uavs[0], id="wing-7"))),
        replace(problem, bases=(replace(base, turnaround=2 * base.turnaround),)),
        replace(problem, bases=(replace(base, stock=None),)),
    ]
    return [(other, allocated(other)) for other in others]


@pytest.mark.parametrize("name", example_names())
def test_an_example_is_a_problem_as_it_was_meant(name):
    assert problem_warnings(problem_of(name)) == ()


def test_the_page_lists_every_example():
    listed = re.findall(r"^\| `([\w-]+)\.json` \|", (FOLDER / "README.md").read_text("utf-8"), re.MULTILINE)
    assert listed == example_names()


def test_zones_hold_the_areas_that_were_published():
    """Circles of 1.5 and 2 nautical miles around points in degrees and minutes, as corners at least as far
    away, and hardly farther."""
    zones = {zone.id: zone.polygon for zone in problem_of("cyclone-freddy").no_fly_zones}
    published = {
        "FWP8": ([(34 + 58.633 / 60, -(15 + 47.283 / 60)), (35 + 0.817 / 60, -(15 + 47.667 / 60))], 1.5),
        "FWP9": ([(35 + 18.8 / 60, -(15 + 22.817 / 60))], 2.0),
    }
    for name, (centres, radius) in published.items():
        for corner in zones[name]:
            away = min(distance("wgs84", *centre, *corner) for centre in centres) / NAUTICAL_MILE_KM
            assert radius < away < 1.05 * radius
        sides = zip(zones[name], zones[name][1:] + zones[name][:1], strict=True)
        for (x, y), (x_next, y_next) in sides:
            middle = (x + x_next) / 2, (y + y_next) / 2
            away = min(distance("wgs84", *centre, *middle) for centre in centres) / NAUTICAL_MILE_KM
            assert away >= radius
    assert len(zones["FWR6"]) == 11
    assert len(zones["FWR7"]) == 6


def test_the_plan_is_what_the_referee_computes(freddy, without_wind, without_zones):
    """In the wind without zones, whose ways take the referee's exact arithmetic minutes."""
    problem, answer = freddy
    free = problem_to_record(replace(problem, no_fly_zones=()))
    referee = replay(free, without_zones["assignment"])
    assert without_zones["reward"] == pytest.approx(referee["reward"])
    for each in (answer, without_wind):
        paid = each["satisfaction"] - each["distance_weight"] * each["distance"]
        assert each["reward"] == pytest.approx(paid)
        assert each["distance"] == pytest.approx(sum(route["distance"] for route in each["routes"]))


def test_the_page_tells_rewards_that_are_found(freddy, without_wind, without_zones):
    found = [answer["reward"] for answer in (freddy[1], without_wind, without_zones)]
    assert [f"{reward:.3f}" for reward in found] == rewards_told("What zones and wind do")
    assert found[0] < min(found[1:])
    assert [each["target_id"] for each in without_wind["unmet"]] == ["zomba"]


def test_zones_are_flown_around(freddy, without_zones):
    """Every way keeps out of them, and is as long as its pieces; those that are bent are longer than
    straight."""
    problem, answer = freddy
    # A piece is an arc, up to 50 m beside the straight line of its degrees.
    zones = [Polygon(zone.polygon).buffer(-0.0005) for zone in problem.no_fly_zones]
    places = {target.id: (target.x, target.y) for target in problem.targets}
    bent = set()
    for uav, route in zip(problem.uavs, answer["routes"], strict=True):
        here = uav.x_s, uav.y_s
        for stop in route["stops"]:
            area = places[stop["target_id"]]
            path = stop["path"] or [here, area]
            assert (tuple(path[0]), tuple(path[-1])) == (here, area)
            assert not any(LineString(path).intersects(zone) for zone in zones)
            pieces = sum(distance("wgs84", *a, *b) for a, b in pairwise(path))
            assert stop["distance"] == pytest.approx(pieces, rel=1e-9)
            if stop["path"]:
                bent.add(stop["target_id"])
                assert pieces > distance("wgs84", *here, *area) * (1 + 1e-6)
            here = area
    assert {"thyolo", "ngabu"} <= bent
    assert all(stop["path"] is None for route in without_zones["routes"] for stop in route["stops"])


def test_the_area_inside_a_zone_is_barred_and_says_so(freddy, without_zones):
    _, answer = freddy
    (zomba,) = [each for each in answer["unmet"] if each["target_id"] == "zomba"]
    assert zomba["code"] == "no_fly_zone"
    assert zomba["remaining"] == [10.0, 20.0]
    assert "no-fly zones" in zomba["reason"]
    assert "zomba" not in [each["target_id"] for each in without_zones["unmet"]]


def test_the_wind_takes_what_still_air_allows(freddy):
    """A slow UAV gets to Thyolo and back in still air. Against the wind it needs more than its range."""
    problem, _ = freddy
    still = replace(problem, wind=None)
    uav = [each.id for each in problem.uavs].index("short-1")
    thyolo = [each.id for each in problem.targets].index("thyolo")
    plan = Plan((tuple(thyolo if i == uav else problem.n_targets for i in range(problem.n_uavs)),))

    (breach,) = breaches_of(problem, plan)

    assert (breach.rule, breach.uav_id, breach.target_id) == ("range", "short-1", "thyolo")
    assert breach.needed > breach.had == pytest.approx(0.9 * 120)
    assert breaches_of(still, plan) == []


def test_figures_are_those_of_the_sources():
    """Levels in the order of the deaths by district; a full box is what a UAV carries; units of blood."""
    deaths = {"Rubavu": 26, "Rutsiro": 27, "Karongi": 16, "Ngororero": 23, "Nyabihu": 18} | {
        "Musanze": 5, "Gakenke": 2, "Nyamagabe": 2, "Burera": 8, "Gicumbi": 3
    }  # fmt: skip
    problem = problem_of("rwanda-floods")
    (base,) = problem.bases
    for target in problem.targets:
        dead = deaths.get(target.properties["district"], 0)
        assert target.level == (1 if dead >= 16 else 0.6 if dead else 0.3)
    assert deaths.keys() <= {target.properties["district"] for target in problem.targets}
    for uav in problem.uavs:
        weight = sum(amount * of.weight for amount, of in zip(uav.loadlist, problem.materials, strict=True))
        assert weight == uav.capacity == 1.75
        assert (uav.x_s, uav.y_s) == (base.x, base.y)
    assert base.stock[0] + sum(uav.loadlist[0] for uav in problem.uavs) == 35


def test_plans_with_a_base_are_what_the_referee_computes(floods, floods_otherwise):
    for problem, answer in [floods, *floods_otherwise]:
        replayed = replay(problem_to_record(problem), answer["assignment"])
        assert answer["reward"] == pytest.approx(replayed["reward"])


def test_the_page_tells_rewards_with_a_base_that_are_found(floods, floods_otherwise):
    found = [answer["reward"] for _, answer in [floods, *floods_otherwise]]
    assert [f"{reward:.3f}" for reward in found] == rewards_told("What a base does")
    as_it_is, without_bases, one_more, slower, all_in_stock = found
    assert without_bases < slower < as_it_is < min(one_more, all_in_stock)


def test_every_uav_flies_several_times_and_takes_what_is_in_stock(floods):
    problem, answer = floods
    (base,) = problem.bases
    loaded = np.zeros(problem.n_materials)
    flights = []
    for route in answer["routes"]:
        kinds = [stop["kind"] for stop in route["stops"]]
        flights.append(sum(kind == "visit" and before != kind for before, kind in pairwise(["", *kinds])))
        loaded += sum(np.array(stop["loaded"]) for stop in route["stops"] if stop["kind"] == "reload")
        assert route["landing"]["time"] <= 3.5
    assert (sum(flights), min(flights), max(flights)) == (20, 3, 4)
    assert sum(flights) == 20
    assert np.array(base.stock) - loaded == pytest.approx(answer["bases"][0]["stock"])


def test_what_a_base_cannot_give_says_why(floods, floods_otherwise):
    _, answer = floods
    codes = {each["target_id"]: each["code"] for each in answer["unmet"]}
    far = dict.fromkeys(["gisenyi", "murunda", "mugonero", "kabaya", "shyira"], "no_time_for_reload")
    assert codes == far | {"butaro": "out_of_range"}
    assert answer["bases"][0]["stock"][:2] == [0, 0]
    _, one_more = floods_otherwise[1]
    assert {each["target_id"]: each["code"] for each in one_more["unmet"]}["murunda"] == "stock"
    _, all_in_stock = floods_otherwise[-1]
    assert {each["target_id"] for each in all_in_stock["unmet"]} == set(codes) - {"kabaya"} | {"kibogora"}
