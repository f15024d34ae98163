"""Plans to take away as the service sends them: files, their types and names, and what it refuses."""

import io
import json
import zipfile

import pytest
from mission_files import WAYPOINT, check_as_qgroundcontrol, commands

from app.api.openapi_examples import example_problem
from app.api.plan_formats.archive import texts_of


@pytest.fixture(scope="module")
def flown(service):
    """The job and the answer of an allocation on a geographic problem."""
    body = {**example_problem("cyclone-idai"), "algorithm": "greedy", "parameters": {}}
    return body, service.client.post("/allocate", json=body).raise_for_status().json()


def take(client, answer, format, **choices):
    return client.get(f"/jobs/{answer['job_id']}/plan", params={"format": format, **choices})


@pytest.mark.parametrize(("format", "ending"), [("qgc-plan", ".plan"), ("qgc-wpl", ".waypoints")])
def test_flight_files_of_all_uavs_come_in_an_archive(client, flown, format, ending):
    body, answer = flown

    response = take(client, answer, format, delivery="gripper", altitude=120)

    assert response.status_code == 200, response.text
    assert response.headers["content-type"] == "application/zip"
    archive = zipfile.ZipFile(io.BytesIO(response.content))
    places = {target["id"]: [target["y"], target["x"]] for target in body["targets"]}
    flying = [route for route in answer["routes"] if route["stops"]]
    assert len(archive.namelist()) == len(flying)
    for name, route in zip(archive.namelist(), flying, strict=True):
        assert name.endswith(ending)
        text = archive.read(name).decode()
        alone = take(client, answer, format, delivery="gripper", altitude=120, uav=route["uav_id"])
        assert alone.text == text
        if format == "qgc-plan":
            content = json.loads(text)
            check_as_qgroundcontrol(content)
            flown_to = [i["params"][4:6] for i in content["mission"]["items"] if i["command"] == WAYPOINT]
        else:
            codes, loader = commands(text)
            points = [loader.wp(i) for i, code in enumerate(codes) if i and code == WAYPOINT]
            flown_to = [[point.x, point.y] for point in points]
        for (latitude, longitude), stop in zip(flown_to, route["stops"], strict=True):
            assert [latitude, longitude] == pytest.approx(places[stop["target_id"]], abs=1e-7)


@pytest.mark.parametrize(
    ("format", "media_type"),
    [("geojson", "application/geo+json"), ("csv", "text/csv"), ("html", "text/html")],
)
def test_documents_come_with_their_type_and_name(client, flown, format, media_type):
    _, answer = flown

    response = take(client, answer, format)

    assert response.status_code == 200
    assert response.headers["content-type"].split(";")[0] == media_type
    assert answer["job_id"][:8] in response.headers["content-disposition"]
    for stop in answer["routes"][0]["stops"]:
        assert stop["target_id"] in response.text


def test_flight_files_of_a_local_problem_are_refused(client, problem):
    answer = client.post("/allocate", json={**problem, "algorithm": "greedy"}).json()

    refused = take(client, answer, "qgc-plan")

    assert refused.status_code == 409
    assert refused.json()["type"] == "/docs/errors#plan-not-geographic"
    (error,) = refused.json()["errors"]
    assert (error["pointer"], error["detail"]) == ("/crs", "'local'; 'qgc-plan' needs 'wgs84'")
    assert take(client, answer, "csv").status_code == 200
    assert take(client, answer, "geojson").json()["coordinates_are"] == "x and y, local"


@pytest.mark.parametrize(
    ("choices", "parameter"),
    [
        ({"altitude": 0}, "altitude"),
        ({"altitude": "nan"}, "altitude"),
        ({"altitude": 1e9}, "altitude"),
        ({"delivery": "catapult"}, "delivery"),
        ({"servo_pwm": 100}, "servo_pwm"),
        ({"format": "dxf"}, "format"),
        ({"altitude_step": -1}, "altitude_step"),
        ({"launch_interval": 1e9}, "launch_interval"),
        ({"altitude_of": "long-1"}, "altitude_of/0"),
    ],
)
def test_choice_out_of_range_is_named(client, flown, choices, parameter):
    refused = client.get(f"/jobs/{flown[1]['job_id']}/plan", params={"format": "qgc-plan", **choices})

    assert refused.status_code == 422
    assert [error["parameter"] for error in refused.json()["errors"]] == [parameter]


def test_job_without_plan_and_unknown_uav_are_told_apart(client, problem, flown):
    unknown = take(client, flown[1], "qgc-wpl", uav="nobody")
    nowhere = client.get(f"/jobs/{'0' * 32}/plan", params={"format": "csv"})
    body = {**problem, "algorithm": "qmix", "parameters": {"n_epochs": 10_000_000}}
    running = client.post("/allocate", json=body, headers={"Prefer": "respond-async"}).json()
    early = client.get(f"/jobs/{running['id']}/plan", params={"format": "csv"})
    client.delete(f"/jobs/{running['id']}")

    assert (unknown.status_code, unknown.json()["type"]) == (404, "/docs/errors#uav-not-found")
    assert (nowhere.status_code, nowhere.json()["type"]) == (404, "/docs/errors#job-not-found")
    assert (early.status_code, early.json()["type"]) == (409, "/docs/errors#no-plan")


@pytest.mark.parametrize(
    ("format", "media_type"),
    [
        ("briefing", "text/plain"),
        ("kml", "application/vnd.google-earth.kml+xml"),
        ("gpx", "application/gpx+xml"),
    ],
)
def test_flights_of_all_uavs_come_in_one_document(client, flown, problem, format, media_type):
    _, answer = flown
    flying = [route["uav_id"] for route in answer["routes"] if route["stops"]]
    response = take(client, answer, format, altitude=40, altitude_step=5, launch_interval=90)
    assert response.headers["content-type"].split(";")[0] == media_type
    assert all(uav_id in response.text for uav_id in flying)
    alone = take(client, answer, format, altitude=40, altitude_step=5, launch_interval=90, uav=flying[2])
    assert "50 m above the ground below" in alone.text
    assert "it takes off 180 s later than planned" in alone.text
    assert flying[1] not in alone.text
    own = take(client, answer, format, uav=flying[2], altitude_of=[f"{flying[2]}=77.5", f"{flying[0]}=60"])
    assert "77.5 m above" in own.text
    high = take(client, answer, format, altitude_of=f"{flying[0]}=10001")
    assert (high.status_code, high.json()["type"]) == (409, "/docs/errors#plan-out-of-range")
    assert f"'{flying[0]}' would fly at 10001 m, which is not in 1..10000" in high.json()["detail"]
    local = client.post("/allocate", json={**problem, "algorithm": "greedy"}).json()
    assert take(client, local, format).json()["type"] == "/docs/errors#plan-not-geographic"
    unknown = take(client, answer, format, altitude_of="nobody=50")
    assert (unknown.status_code, unknown.json()["type"]) == (404, "/docs/errors#uav-not-found")
    assert unknown.json()["errors"][0]["parameter"] == "altitude_of"


@pytest.mark.parametrize(("format", "by"), [("qgc-plan", "leg"), ("qgc-wpl", "uav")])
def test_flight_files_come_back_as_the_same_evaluation(client, flown, format, by):
    body, answer = flown
    packed = take(client, answer, format, altitude_by=by, delivery="servo")
    files = [{"name": name, "content": text} for name, text in texts_of("plan.zip", packed.content).items()]
    problem = {name: value for name, value in body.items() if name not in ("algorithm", "parameters")}
    problem.pop("time_limit_s", None)
    read = client.post("/evaluate", json={**problem, "flight_files": files}).raise_for_status().json()
    own = client.post("/evaluate", json={**problem, "assignment": answer["assignment"]}).json()
    assert read["assignment"] == own["assignment"] == answer["assignment"]
    changing = {"job_id", "elapsed_s"}
    assert {name: read[name] for name in read.keys() - changing} == {
        name: own[name] for name in own.keys() - changing
    }
    far = [{**each, "content": each["content"].replace("-19.", "-18.")} for each in files]
    refused = client.post("/evaluate", json={**problem, "flight_files": far})
    assert (refused.status_code, refused.json()["type"]) == (422, "/docs/errors#invalid-problem")
    assert refused.json()["errors"][0]["pointer"] == "/flight_files/0/content"
    assert "is at no area or base" in refused.json()["errors"][0]["detail"]


def test_a_leg_has_the_altitude_that_is_asked_for(client, flown):
    _, answer = flown
    flying = next(route["uav_id"] for route in answer["routes"] if route["stops"])
    own = [f"{flying}/1=77.5@home", f"{flying}=90"]
    high = {"altitude_by": "leg", "clearance": 250, "altitude_of": own}
    text = take(client, answer, "briefing", uav=flying, **high).text
    assert "77.5 m above its start, 90 m above the ground below" in text
    assert ", flown to at 77.5 m above its start" in text
    unknown = take(client, answer, "briefing", altitude_of=f"{flying}/0=50")
    assert (unknown.status_code, unknown.json()["type"]) == (404, "/docs/errors#uav-not-found")
    beyond = take(client, answer, "briefing", altitude_of=f"{flying}/99=50")
    assert (beyond.status_code, beyond.json()["errors"][0]["parameter"]) == (409, "altitude_of")
    wrong = take(client, answer, "briefing", altitude_by="stop")
    assert (wrong.status_code, wrong.json()["errors"][0]["parameter"]) == (422, "altitude_by")


def test_without_a_format_a_plan_is_the_page_to_print(client, flown):
    _, answer = flown
    page = client.get(f"/jobs/{answer['job_id']}/plan", params={"begins": "2026-11-30T06:30"})
    assert page.headers["content-type"].startswith("text/html")
    assert "begins on 2026-11-30 at 06:30" in page.text


@pytest.mark.parametrize("begins", ["0.5", "1764484200", "2026-11-30", "tomorrow"])
def test_a_plan_begins_at_a_date_and_a_time(client, flown, begins):
    _, answer = flown
    refused = take(client, answer, "html", begins=begins)
    assert refused.status_code == 422
    assert "is not a date and time such as 2026-11-30T06:30" in refused.json()["detail"]
