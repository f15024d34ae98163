"""Take away: what the browser saves is what the API gives, and it is the plan."""

import io
import json
import zipfile
from pathlib import Path

import httpx
import pytest
from dashboard_steps import begin_again, go, open_problem, ready, show_answer, state
from playwright.sync_api import expect
from pymavlink import mavwp

from app.api.openapi_examples import example_problem


def saved(page, button):
    with page.expect_download() as caught:
        page.locator(f"#view-take-away button[data-format={button}]").click()
    return caught.value.suggested_filename, Path(caught.value.path()).read_bytes()


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins with the problem that a new page has."""
    return begin_again(shared_page)


@pytest.fixture
def planned(page, service):
    answer = show_answer(page, service.url, algorithm="greedy")
    go(page, "take-away")
    page.locator("select[name=uav]").select_option("")
    return page, answer


def test_flight_files_of_all_uavs(planned):
    page, answer = planned
    page.locator("select[name=delivery]").select_option("gripper")

    name, content = saved(page, "qgc-plan")

    assert name == f"plan-{answer['job_id'][:8]}-qgc-plan.zip"
    archive = zipfile.ZipFile(io.BytesIO(content))
    flying = [route for route in answer["routes"] if route["stops"]]
    assert len(archive.namelist()) == len(flying)
    for member, route in zip(archive.namelist(), flying, strict=True):
        items = json.loads(archive.read(member))["mission"]["items"]
        assert [item["command"] for item in items].count(211) == len(route["stops"])


def test_waypoints_of_one_uav_load_in_pymavlink(planned, service, tmp_path):
    page, answer = planned
    route = next(route for route in answer["routes"] if route["stops"])
    page.locator("select[name=uav]").select_option(route["uav_id"])
    page.locator("input[name=altitude]").fill("75")
    page.locator("select[name=delivery]").select_option("servo")
    page.locator("input[name=servo_channel]").fill("5")

    name, content = saved(page, "qgc-wpl")

    asked = {
        "format": "qgc-wpl",
        "uav": route["uav_id"],
        "altitude": 75,
        "delivery": "servo",
        "servo_channel": 5,
    }
    assert content == httpx.get(f"{service.url}/jobs/{answer['job_id']}/plan", params=asked).content
    file = tmp_path / name
    file.write_bytes(content)
    loader = mavwp.MAVWPLoader()
    loader.load(str(file))
    items = [loader.wp(i) for i in range(1, loader.count())]
    targets = {target["id"]: target for target in state(page, "problem")["targets"]}
    flown = [(item.x, item.y, item.z) for item in items if item.command == 16]
    for (latitude, longitude, altitude), stop in zip(flown, route["stops"], strict=True):
        place = targets[stop["target_id"]]
        assert (latitude, longitude) == pytest.approx((place["y"], place["x"]), abs=1e-7)
        assert altitude == 75
    assert {item.param1 for item in items if item.command == 183} == {5}


@pytest.mark.parametrize("format", ["geojson", "csv", "load-sheet", "html"])
def test_documents_are_the_services(planned, service, format):
    page, answer = planned

    _, content = saved(page, format)

    # A page to print has above it what the problem is called.
    asked = {"format": format} | ({"title": state(page, "problemName")} if format == "html" else {})
    response = httpx.get(f"{service.url}/jobs/{answer['job_id']}/plan", params=asked)
    assert content == response.content


def test_page_to_print_has_every_stop(planned):
    page, answer = planned
    with page.context.expect_page() as opened:
        page.get_by_test_id("print").click()
    printed = opened.value
    printed.wait_for_load_state()

    text = printed.locator("body").inner_text()

    for route in answer["routes"]:
        for stop in route["stops"]:
            assert stop["target_id"] in text
    expect(printed.locator("svg polyline")).to_have_count(sum(bool(r["stops"]) for r in answer["routes"]))


def test_choice_out_of_range_is_shown_at_its_field(planned):
    page, _ = planned
    page.expected_troubles.append("422")
    page.locator("input[name=altitude]").fill("99999")

    page.locator("button[data-format=qgc-plan]").click()

    expect(page.locator("label:has(input[name=altitude]) .error")).to_contain_text(
        "99999, must be at most 10000"
    )


def test_local_problem_has_no_flight_files(page, service):
    ready(page)
    open_problem(page, example_problem("paper-5x10"))
    show_answer(page, service.url, algorithm="greedy")
    go(page, "take-away")

    expect(page.locator("button[data-format=qgc-plan]")).to_be_disabled()
    expect(page.get_by_test_id("take-status")).to_contain_text("crs is local; flight files need wgs84")
    name, _ = saved(page, "csv")
    assert name.endswith(".csv")
