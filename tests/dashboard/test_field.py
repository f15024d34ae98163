"""In the field: the state at a moment is worked out again here, and the new plan is replayed from it."""

import math

import httpx
import pytest
from answers import but_for_reasons
from dashboard_steps import go, open_problem, ready, show_answer, state
from page_modules import run_module
from playwright.sync_api import expect
from referee import replay

from app.api.openapi_examples import example_problem
from app.domain.geometry import distance


def expected_state(problem, answer, time):
    """The mid-mission state by hand: place, distance flown, returning, load of each UAV; needs of areas."""
    targets = {target["id"]: target for target in problem["targets"]}
    needs = {name: list(target["loadlist"]) for name, target in targets.items()}
    uavs = {}
    for uav, route in zip(problem["uavs"], answer["routes"], strict=True):
        load, flown, clock = list(uav["loadlist"]), 0.0, 0.0
        here, aim, left, ret = (uav["x_s"], uav["y_s"]), None, 0.0, 0
        for stop in route["stops"]:
            target = targets[stop["target_id"]]
            aim = (target["x"], target["y"])
            if stop["arrival_time"] > time:
                left = (stop["arrival_time"] - max(time, clock)) * uav["speed"]
                flown += stop["distance"] - left
                break
            here, flown = aim, flown + stop["distance"]
            clock = stop["arrival_time"] + target.get("service_time", 0)
            for k, amount in enumerate(stop["delivered"]):
                load[k] -= amount
                needs[stop["target_id"]][k] -= amount
        else:
            if time > clock and route["stops"]:
                aim, ret = (uav["x_s"], uav["y_s"]), 1
                back = min(route["return_distance"], (time - clock) * uav["speed"])
                left = route["return_distance"] - back
                flown += back
        uavs[uav["id"]] = {"dis": flown, "ret": ret, "load": load, "aim": aim, "left": left, "from": here}
    return uavs, needs


@pytest.mark.parametrize(("example", "time"), [("cyclone-idai", 0.6), ("paper-5x10", 0.35)])
def test_state_at_a_moment_is_the_specifications(page, service, example, time):
    ready(page)
    open_problem(page, example_problem(example))
    answer = show_answer(page, service.url, algorithm="local_search", time_limit_s=0.5)
    problem = state(page, "problem")

    now = page.evaluate(
        "async (time) => { const { get } = await import('/dashboard/js/state.js');"
        " const { problemAt } = await import('/dashboard/js/mid_mission.js');"
        " return problemAt(get().answerProblem, get().answer, time); }",
        time,
    )

    uavs, needs = expected_state(problem, answer, time)
    assert {target["id"]: target["loadlist"] for target in now["targets"]} == {
        name: pytest.approx(need, abs=1e-9) for name, need in needs.items()
    }
    crs = problem.get("crs", "local")
    for uav in now["uavs"]:
        is_at = uavs[uav["id"]]
        assert uav["loadlist"] == pytest.approx(is_at["load"], abs=1e-9)
        assert uav["dis"] == pytest.approx(is_at["dis"])
        assert uav["ret"] == is_at["ret"]
        if is_at["aim"]:
            to_go = distance(crs, uav["x_c"], uav["y_c"], *is_at["aim"])
            assert to_go == pytest.approx(is_at["left"], abs=1e-6)
            come = distance(crs, *is_at["from"], uav["x_c"], uav["y_c"])
            whole = distance(crs, *is_at["from"], *is_at["aim"])
            if is_at["left"] != 0:
                assert come + to_go == pytest.approx(whole, rel=1e-9)
    assert now["objective"]["distance_weight"] == answer["distance_weight"]


def test_lost_changed_and_new_are_allocated_again_and_the_difference_is_shown(page, service):
    ready(page)
    before = show_answer(page, service.url, algorithm="local_search", time_limit_s=0.5)
    lost = max(before["routes"], key=lambda route: route["distance"])["uav_id"]
    go(page, "field")
    page.locator("#field-time").fill("0.3")
    page.locator("#field-time").press("Tab")
    expect(page.get_by_test_id("field-clock")).to_contain_text("0.3 of")
    page.get_by_label(f"{lost} is lost").check()
    expect(page.locator(f"[data-testid=field-uavs] tr[data-uav={lost}]")).to_contain_text("lost")
    changed = before["routes"][0]["stops"][-1]["target_id"]
    page.get_by_label(f"level of {changed}", exact=True).fill("9")
    page.get_by_label(f"level of {changed}", exact=True).press("Tab")
    page.get_by_role("button", name="Add an area").click()
    expect(page.locator("[data-testid=field-areas] tr.new")).to_have_count(1)
    page.locator("#view-field select[name=algorithm]").select_option("local_search")
    page.locator("#view-field input[name=time_limit_s]").fill("0.5")

    page.get_by_role("button", name="Allocate again from here").click()

    expect(page.get_by_test_id("field-changes")).to_be_visible()
    problem, answer = state(page, "answerProblem"), state(page, "answer")
    assert lost not in {uav["id"] for uav in problem["uavs"]}
    assert len(problem["targets"]) == 20
    assert next(target for target in problem["targets"] if target["id"] == changed)["level"] == 9
    stored = httpx.get(f"{service.url}/jobs/{answer['job_id']}").json()["result"]
    assert but_for_reasons(answer) == but_for_reasons(stored)
    assert replay(problem, answer["assignment"])["reward"] == pytest.approx(answer["reward"])
    shown = page.get_by_test_id("field-changes")
    values = [float(each.get_attribute("value")) for each in shown.locator("p data").all()]
    assert values[1] == answer["reward"]
    assert values[1] >= values[0] - 1e-9 or math.isclose(*values, rel_tol=0.05)
    expect(shown.locator(f"tr[data-uav={lost}]")).to_contain_text("lost")
    for route in answer["routes"]:
        if route["stops"]:
            row = shown.locator(f"tr[data-uav={route['uav_id']}]")
            expect(row.locator("td").nth(1)).to_have_text(" → ".join(s["target_id"] for s in route["stops"]))


def test_clock_runs_from_event_to_event_and_by_itself(page, service):
    ready(page)
    answer = show_answer(page, service.url, algorithm="greedy")
    first = min(stop["arrival_time"] for route in answer["routes"] for stop in route["stops"])
    go(page, "field")

    page.get_by_role("button", name="Next event").click()

    assert float(page.locator("#field-time").input_value()) == pytest.approx(first, rel=1e-4)
    page.get_by_role("button", name="Event before").click()
    assert float(page.locator("#field-time").input_value()) == 0
    page.get_by_role("button", name="Let it run").click()
    expect(page.locator("#field-time")).not_to_have_value("0")
    page.get_by_role("button", name="Halt").click()
    expect(page.get_by_role("button", name="Let it run")).to_be_visible()


def test_keeping_the_plan_is_worth_what_its_rest_earns(page, service):
    ready(page)
    answer = show_answer(page, service.url, algorithm="local_search", time_limit_s=0.5)

    kept = page.evaluate(
        "async () => { const { get } = await import('/dashboard/js/state.js');"
        " const m = await import('/dashboard/js/mid_mission.js');"
        " const { answerProblem: p, answer: a } = get();"
        " return m.changes(m.problemAt(p, a, 0), m.remainder(p, a, 0), a); }"
    )

    assert kept["kept"]["reward"] == pytest.approx(answer["reward"])
    assert {route["kind"] for route in kept["routes"]} == {"same"}


def test_uavs_on_their_way_home_are_called_back_only_where_that_is_chosen(page, service):
    ready(page)
    answer = show_answer(page, service.url, algorithm="greedy")
    last = max(stop["arrival_time"] for route in answer["routes"] for stop in route["stops"])

    kept, recalled = page.evaluate(
        "async (time) => { const { get } = await import('/dashboard/js/state.js');"
        " const { problemAt } = await import('/dashboard/js/mid_mission.js');"
        " const { answerProblem: p, answer: a } = get();"
        " return [false, true].map((recall) => problemAt(p, a, time, { recall })); }",
        last + 0.2,
    )

    flown = [bool(route["stops"]) for route in answer["routes"]]
    assert [uav["ret"] for uav in kept["uavs"]] == [int(flies) for flies in flown]
    assert [uav["ret"] for uav in recalled["uavs"]] == [0] * len(flown)


MID_MISSION = """
    const { changes, problemAt, remainder, withNeeds } = await load("mid_mission.js");
    const { met } = await load("plan.js");
    const now = problemAt(given.problem, given.answer, given.time);
    const rest = remainder(given.problem, given.answer, given.time);
    return {
        now,
        more: withNeeds(now.targets[0], [12, 0]),
        fewer: withNeeds(now.targets[0], [0, 0]),
        untouched: withNeeds(now.targets[2], [1, 0]),
        met: [...met(now, null).values()],
        metThen: [...met(now, { unmet: [{ target_id: "half", remaining: [1, 0] }] }).values()],
        kept: changes(now, rest, { routes: [], reward: 0, distance_weight: 0 }),
    };
"""


def test_what_an_area_asked_for_at_first_stays_the_measure_of_what_it_has():
    """82 are needed, 80 come at time 1; 90 were asked for at another area, of which 40 came before."""
    uav = {"id": "u", "x_s": 0, "y_s": 0, "speed": 1, "voyage": 99, "loadlist": [130, 0]}
    place = {"x": 1, "y": 0}
    problem = {
        "uavs": [uav],
        "targets": [
            {"id": "nearly", **place, "level": 2, "loadlist": [82, 0]},
            {"id": "half", **place, "level": 3, "loadlist": [50, 0], "requested": [90, 0]},
            {"id": "none", **place, "level": 1, "loadlist": [5, 5]},
        ],
    }
    stops = [
        {"target_id": "nearly", "step": 1, "arrival_time": 1, "distance": 1, "delivered": [80, 0]},
        {"target_id": "half", "step": 2, "arrival_time": 2, "distance": 1, "delivered": [45, 0]},
    ]
    answer = {
        "routes": [{"uav_id": "u", "distance": 2, "return_distance": 1, "stops": stops}],
        "distance_weight": 0,
    }

    found = run_module(MID_MISSION, {"problem": problem, "answer": answer, "time": 1.5})

    nearly, half, none = found["now"]["targets"]
    assert (nearly["loadlist"], nearly["requested"]) == ([2, 0], [82, 0])
    assert (half["loadlist"], half["requested"]) == ([50, 0], [90, 0])
    assert (none["loadlist"], "requested" in none) == ([5, 5], False)
    assert (found["more"]["loadlist"], found["more"]["requested"]) == ([12, 0], [92, 0])
    assert (found["fewer"]["loadlist"], found["fewer"]["requested"]) == ([0, 0], [80, 0])
    assert "requested" not in found["untouched"]
    assert found["met"] == pytest.approx([80 / 82, 40 / 90, 0])
    assert found["metThen"] == pytest.approx([1, 89 / 90, 1])
    # What is still to come earns as the service reckons it: level · delivered / requested.
    assert found["kept"]["kept"]["satisfaction"] == pytest.approx(3 * 45 / 90)
    assert [area["before"] for area in found["kept"]["areas"]] == pytest.approx([80 / 82, 85 / 90, 0])
    assert [area["after"] for area in found["kept"]["areas"]] == pytest.approx([80 / 82, 40 / 90, 0])


def test_an_area_that_is_nearly_served_is_shown_and_weighed_as_that(page, service):
    ready(page)
    answer = show_answer(page, service.url, algorithm="greedy")
    first = min(
        (stop for route in answer["routes"] for stop in route["stops"]), key=lambda s: s["arrival_time"]
    )
    wanted = next(t for t in state(page, "problem")["targets"] if t["id"] == first["target_id"])["loadlist"]
    go(page, "field")
    page.get_by_role("button", name="Next event").click()
    row = page.locator(f"[data-testid=field-areas] tr[data-area={first['target_id']}]")
    expect(row).to_contain_text(f"of {wanted[0]:g}")
    page.locator("#view-field select[name=algorithm]").select_option("greedy")
    page.get_by_role("button", name="Allocate again from here").click()
    expect(page.get_by_test_id("field-changes")).to_be_visible()

    asked = next(t for t in state(page, "answerProblem")["targets"] if t["id"] == first["target_id"])
    assert asked["requested"] == wanted
    assert asked["loadlist"] == pytest.approx([wanted[0] - first["delivered"][0]])
    go(page, "problem")
    cell = page.locator(
        f"table[data-kind=targets] tr[data-id={first['target_id']}] td[data-column='requested/0']"
    )
    expect(cell).to_have_text(f"{wanted[0]:g}")
