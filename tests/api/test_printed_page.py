"""The page to print: what it is called and when, figures for people, remedies, the dashboard's colours."""

import re
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import app
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.printed_page import COLOURS, printed_page
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import to_record
from app.domain.surroundings import Base, Material
from app.simulation.explain import explain

NIGHT = datetime.fromisoformat("2026-03-01T22:00")
PROBLEM = Problem(
    uavs=(UAV("u", 0.0, 0.0, 0.0, 0.0, 100.0, 900.0, (5.0, 2.0), name="Kestrel"),),
    targets=(
        Target("a", 1.0, 0.0, 1.0, (3.0, 1.0), service_time=0.25),
        Target("b", 2.0, 0.0, 1.0, (3.0, 1.0)),
    ),
    crs="wgs84",
    materials=(Material("cholera kits"), Material("food <dry>")),
)
ANSWER = {
    "job_id": "0123456789abcdef" * 2,
    "algorithm": "greedy",
    "reward": 1.0,
    "satisfaction": 1.5,
    "distance": 222.0,
    "routes": [
        {
            "uav_id": "u",
            "distance": 222.0,
            "return_distance": 222.0,
            "stops": [
                {
                    "target_id": "a",
                    "step": 1,
                    "arrival_time": 1.1,
                    "distance": 111.0,
                    "delivered": [3.0, 1.0],
                },
                {
                    "target_id": "b",
                    "step": 2,
                    "arrival_time": 2.5,
                    "distance": 111.0,
                    "delivered": [2.0, 1.0],
                },
            ],
        }
    ],
    "unmet": [
        {"target_id": "b", "remaining": [1.0, 0.0], "reason": "1 of 3 missing", "remedy": "1 more aboard <u>"}
    ],
}


def text_of(plan):
    return re.sub(r"<[^>]+>", " ", re.sub(r"<style>.*?</style>", "", printed_page(plan), flags=re.DOTALL))


def test_the_figures_for_people_come_first():
    page = text_of(flown_plan(PROBLEM, ANSWER))
    assert "1 of 2 areas get all they need." in page
    assert "Delivered: cholera kits · food &lt;dry&gt;: 5 of 6 · 2 of 2." in page
    assert "Last delivery +2:30 h, all home +4:43 h." in page
    assert page.index("areas get all") < page.index("reward 1")


def test_times_are_of_the_day_where_it_is_known_when_the_plan_begins():
    plan = replace(flown_plan(PROBLEM, ANSWER), title="Flood <north>", begins=NIGHT)
    page = text_of(plan)
    assert "Flood &lt;north&gt;" in page
    assert "begins on 2026-03-01 at 22:00; times are of the day" in page
    assert "Last delivery 00:30 +1 d, all home 02:43 +1 d." in page
    assert " 23:06 " in page
    assert "+0:" not in page


def test_a_plan_without_a_begin_has_a_place_to_write_it_on_paper():
    page = text_of(flown_plan(PROBLEM, ANSWER))
    assert "begins on ____________ at ________; times count from then" in page
    assert page.count("Loaded by") == page.count("Checked by") == 1


def test_what_would_help_is_printed():
    page = text_of(flown_plan(PROBLEM, ANSWER))
    assert "1 more aboard &lt;u&gt;" in page


def test_the_colours_are_those_of_the_dashboard_in_daylight():
    style = (Path(app.__file__).parent / "dashboard" / "style.css").read_text("utf-8")
    light, _ = style.split("prefers-color-scheme: dark", 1)
    assert tuple(re.findall(r"--uav-\d: (#[0-9a-f]{6})", light)) == COLOURS


def test_one_in_the_air_whose_way_home_the_plan_does_not_have_is_on_the_map():
    problem = Problem(
        uavs=(UAV("stork", 0, 0, 3, 3, 1.0, 9.0, (5.0,)),),
        targets=(Target("there", 1, 1, 1.0, (5.0,)),),
        bases=(Base("depot", 2, 0),),
        objective=Objective(return_to_base=False),
    )
    answer = {**to_record(explain(problem, Plan(((1,),)))), "job_id": "0" * 32, "algorithm": "greedy"}
    page = printed_page(flown_plan(problem, answer))
    assert re.search(r"<text [^>]*>stork</text>", page)
