"""Flight files that are read: what was written comes back as the same plan, and what is wrong is named."""

import json
from dataclasses import replace

import pytest

from app.api.evaluation_models import EvaluationRequest
from app.api.evaluation_payload import evaluation_payload
from app.api.plan_formats.altitudes import AltitudeBy, Separation
from app.api.plan_formats.archive import texts_of, zip_archive
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.flown_routes import ReadFile, plan_of_files
from app.api.plan_formats.launches import planned_flights
from app.api.plan_formats.mission import Delivery, Ending, FlightChoices
from app.api.plan_formats.qgroundcontrol import file_name, place_of, plan_file, waypoint_file
from app.domain.errors import InvalidProblem
from app.domain.plan import Plan
from app.domain.problem import UAV, Problem, Target
from app.domain.records import to_record
from app.domain.said import to_record as as_said
from app.domain.surroundings import Base, NoFlyZone
from app.settings import Settings
from app.simulation.explain import explain

PORT, DEPOT = (34.0, -19.0), (34.4, -19.0)
ZONE = NoFlyZone("z", ((34.12, -19.02), (34.18, -19.02), (34.18, -18.98), (34.12, -18.98)))
PROBLEM = Problem(
    uavs=tuple(
        UAV(name, *at, *at, 80.0, 400.0, (4.0,), full_load=(4.0,))
        for name, at in (("u/1", PORT), ("v-flight-2", DEPOT), ("idle", PORT), ("w", (34.05, -19.05)))
    ),
    targets=(
        Target("a", 34.2, -19.0, 1.0, (2.0,), service_time=0.05),
        Target("b", 34.5, -19.0, 1.0, (9.0,), earliest=1.0),
        Target("c", 34.3, -19.1, 1.0, (2.0,)),
        Target("d", 34.301, -19.1, 1.0, (9.0,)),
        Target("e", 34.1, -19.1, 1.0, (9.0,)),
    ),
    bases=(Base("depot", *DEPOT, (50.0,), 0.25), Base("spare", 34.0, -18.9, (9.0,))),
    no_fly_zones=(ZONE,),
    crs="wgs84",
)
N = 5
AT_DEPOT, AT_SPARE = N + 1, N + 2
ROWS = [[0, 1, N, 4], [AT_DEPOT, AT_DEPOT, N, N], [1, 2, N, N], [AT_SPARE, 3, N, N], [4, N, N, N]]
"""The first UAV flies three times and round the zone, the second one reloads where it was launched."""
PLACED, TOGETHER = FlightChoices(), Separation()
FORMATS = {"plan": plan_file, "waypoints": waypoint_file}


def written(write, ending, choices=PLACED, separation=TOGETHER, rows=ROWS, problem=PROBLEM):
    """The files of a plan, as they are taken away."""
    answer = {**to_record(explain(problem, Plan(tuple(map(tuple, rows))))), "job_id": "0" * 32}
    flights = planned_flights(flown_plan(problem, answer), choices, separation)
    return {
        file_name(each.flight, ending, numbered=True): write(each.flight, each.choices) for each in flights
    }


def files_of(texts, **of):
    return [ReadFile(name, of.get(name), text) for name, text in texts.items()]


def refused(files, problem=PROBLEM, within_m=50.0):
    with pytest.raises(InvalidProblem) as caught:
        plan_of_files(problem, files, within_m)
    return {each.pointer: each.detail for each in caught.value.violations}


@pytest.mark.parametrize("by", AltitudeBy)
@pytest.mark.parametrize("end", Ending)
@pytest.mark.parametrize("delivery", Delivery)
@pytest.mark.parametrize("ending", FORMATS)
def test_what_was_written_is_read_as_the_same_plan(ending, delivery, end, by):
    choices = FlightChoices(delivery=delivery, end=end)
    texts = written(FORMATS[ending], ending, choices, Separation(altitude_by=by))
    assert len(texts) == 6
    # Names say whose they are, in whatever order they come; an archive keeps them.
    packed = texts_of("plan.zip", zip_archive(dict(reversed(texts.items()))))
    read = plan_of_files(PROBLEM, files_of(packed), 50.0)
    assert read.assignment == ROWS
    assert read.warnings == ()


def test_a_plan_without_bases_and_one_in_which_nobody_flies():
    alone = replace(PROBLEM, bases=(), no_fly_zones=())
    rows = [[0, N, 2, 3], [1, N, 3, N]]
    texts = written(waypoint_file, "waypoints", rows=rows, problem=alone)
    assert plan_of_files(alone, files_of(texts), 50.0).assignment == rows
    nobody = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t-19\t34\t0\t1\n"
    assert plan_of_files(alone, [ReadFile("x", "idle", nobody)], 50.0).assignment == [[N] * 4]


def test_an_evaluation_of_files_is_that_of_the_plan():
    texts = written(plan_file, "plan")
    content = [{"name": name, "content": text} for name, text in texts.items()]
    body = {
        "crs": "wgs84",
        "uavs": [{"x_s": 34, "y_s": -19, "speed": 80, "voyage": 400, "loadlist": [4]}] * 4,
        "targets": [{"x": each.x, "y": each.y, "level": 1, "loadlist": [4]} for each in PROBLEM.targets],
        "bases": [{"id": each.id, "x": each.x, "y": each.y} for each in PROBLEM.bases],
    }
    request = EvaluationRequest.model_validate({**body, "flight_files": content})
    payload = evaluation_payload(request, Settings())
    as_rows = EvaluationRequest.model_validate({**body, "assignment": ROWS})
    same = evaluation_payload(as_rows, Settings())
    assert {**same, "warnings": payload["warnings"]} == payload
    # Without the zone its corners are on the way to nowhere.
    assert {each["code"] for each in payload["warnings"]} == {"waypoint_passed_over"}
    (first, *_) = payload["warnings"]
    assert first["pointer"] == "/flight_files/0/content"
    assert first["detail"].startswith("001-u_1-flight-1.plan: item 3 (NAV_WAYPOINT) at latitude -19.02")
    assert "the nearest, 'area-1', is " in first["detail"]
    for plans in ({}, {"assignment": ROWS, "flight_files": content}):
        with pytest.raises(InvalidProblem, match="one of `assignment` and `flight_files` is needed"):
            evaluation_payload(EvaluationRequest.model_validate({**body, **plans}), Settings())


def first_of(rows, **choices):
    """The name and the text of the first file of a plan."""
    return next(iter(written(plan_file, "plan", FlightChoices(**choices), rows=rows).items()))


def moved(text, by):
    """A .plan whose places are all moved to the north, by degrees."""
    content = json.loads(text)
    for item in content["mission"]["items"]:
        if "Altitude" in item:
            item["params"][4] += by
    return json.dumps(content)


def test_waypoints_are_matched_within_the_tolerance_to_what_is_nearest():
    """A ten-thousandth of a degree is 11.1 m; areas c and d are 105 m apart."""
    rows = [[2, N, N, N], [3, N, N, N]]
    name, text = first_of(rows)
    assert plan_of_files(PROBLEM, [ReadFile(name, None, moved(text, 0.0004))], 50.0).assignment == rows
    assert plan_of_files(PROBLEM, [ReadFile(name, None, moved(text, 0.008))], 900.0).assignment == rows
    far = refused([ReadFile(name, None, moved(text, 0.0005))])
    assert list(far) == ["/flight_files/0/content"]
    assert "item 4 (NAV_PAYLOAD_PLACE)" in far["/flight_files/0/content"]
    assert "'c', is 56 m away, more than 50 m" in far["/flight_files/0/content"]
    between = replace(PROBLEM, targets=(*PROBLEM.targets[:4], replace(PROBLEM.targets[2], id="e")))
    both = refused([ReadFile(name, None, text)], between)
    assert "is as near to 'c' as to 'e': the file does not say which" in both["/flight_files/0/content"]


def test_a_release_at_no_place_is_refused_and_one_that_flies_by_is_told():
    rows = [[4, N, N, N]]
    name, text = first_of(rows, delivery=Delivery.SERVO)
    detail = refused([ReadFile(name, None, moved(text, 0.001))])["/flight_files/0/content"]
    assert "(DO_SET_SERVO) at latitude -19.099" in detail
    name, text = first_of(rows, delivery=Delivery.NONE)
    read = plan_of_files(PROBLEM, [ReadFile(name, None, moved(text, 0.001))], 50.0)
    assert read.assignment == [[N] * 4]
    assert any("'e', is 111 m away" in warning.detail for warning in read.warnings)


HEAD = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t-19\t34\t0\t1\n"
PLAN = {"fileType": "Plan", "mission": {"plannedHomePosition": [-19, 34, 0]}}


def simple(**fields):
    item = {"type": "SimpleItem", "command": 16, "params": [0, 0, 0, None, -19, 34.2, 50], **fields}
    return json.dumps({**PLAN, "mission": {**PLAN["mission"], "items": [item]}})


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "it begins with ''; a .plan is a JSON object"),
        ("waypoints", "it begins with 'waypoints'"),
        ("{", "it is no JSON"),
        ("{" * 100_000, "it is no JSON"),
        ('{"a": ' * 100_000, "it is no JSON"),
        ('{"fileType": "Plan"}', "it is no .plan"),
        (json.dumps(PLAN), "`mission.items` is no list"),
        (
            simple(type="ComplexItem", complexItemType="survey"),
            "item 1 is a 'survey'; only simple items are read",
        ),
        (simple(params=[1, 2]), "`params` of item 1 is no list of 7 numbers"),
        (simple(params=[0, 0, 0, 0, 91, 34, 0]), "item 1: latitude 91 is not in -90..90"),
        (simple(params=[0, 0, 0, 0, -19, "east", 0]), "position of item 1: 'east' is no number"),
        (simple(command=True), "`command` of item 1: True is no number"),
        (simple(command=177), "item 1 (DO_JUMP): missions that repeat items are not read"),
        ("QGC WPL 110\n", "it has no waypoints"),
        (HEAD + "1\t0\t3\t16\n", "line 3 has 4 columns, and needs 12"),
        (HEAD + "1\t0\t3\tx\t0\t0\t0\t0\t-19\t34\t50\t1\n", "line 3, command: 'x' is no number"),
        (HEAD + "1\t0\t3\t16\t0\t0\t0\t0\t-19\tnan\t50\t1\n", "position of line 3: 'nan' is no number"),
        (HEAD + "1\t0\t3\t21\t0\t0\t0\t0\t-20\t34\t0\t1\n", "item 1 (NAV_LAND) at latitude -20.000000"),
    ],
)
def test_a_file_that_is_none_says_where(content, says):
    details = refused([ReadFile("001-a.plan", None, content)])
    assert list(details) == ["/flight_files/0/content"]
    assert says in details["/flight_files/0/content"]
    values = as_said(details["/flight_files/0/content"])["values"]
    assert values["file"] == "001-a.plan"
    assert values["why"].keys() == {"detail", "sentence", "values"}


def test_all_that_is_wrong_with_all_files_is_listed():
    rows = [[4, N, N, N]]
    _, text = first_of(rows)
    found = refused(
        [
            ReadFile("mine.plan", None, text),
            ReadFile("mine.plan", "nobody", text),
            ReadFile("009-x.plan", None, text),
            ReadFile("first.plan", "w", text),
            ReadFile("second.plan", "w", text),
        ]
    )
    assert found == {
        "/flight_files/0/name": "mine.plan: its name does not begin with the UAV's number, as 001-: "
        "`uav_id` is needed",
        "/flight_files/1/uav_id": "mine.plan: no UAV has the id 'nobody'",
        "/flight_files/2/name": "009-x.plan: its name begins with 9, and there are 4 UAVs",
        "/flight_files/3/content": "first.plan: 'w' lands at no base, and cannot fly again",
    }
    on_plane = refused([ReadFile("001-a.plan", None, text)], replace(PROBLEM, crs="local", no_fly_zones=()))
    assert on_plane == {"/crs": "'local'; flight files need 'wgs84'"}


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("003-uav-3.plan", (2, 1)),
        ("012-a-flight-3.waypoints", (11, 3)),
        ("3-uav.plan", None),
        ("uav.plan", None),
    ],
)
def test_names_say_whose_a_file_is(name, found):
    assert place_of(name) == found


def test_what_is_no_text_is_refused():
    with pytest.raises(ValueError, match=r"x\.zip has what is no text in UTF-8"):
        texts_of("x.zip", b"\xff\xfe")
