"""In the field: the state at a moment is worked out by hand, and the new plan is replayed from it."""

import json

import httpx
import pytest
from answers import but_for_reasons
from dashboard_steps import begin_again, go, open_problem, ready, show_answer, state, value
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


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins with the problem that a new page has."""
    yield begin_again(shared_page)
    shared_page.unroute_all()


def moment(page, **mission):
    """What the page makes of a moment of the plan on screen."""
    return page.evaluate(
        """async (patch) => {
            const { get } = await import("/dashboard/js/state.js");
            const { allTimes } = await import("/dashboard/js/times.js");
            const { momentOf } = await import("/dashboard/js/mid_mission.js");
            const { answer, answerProblem: problem, fields, mission } = get();
            const times = allTimes(problem, answer);
            return momentOf({ problem, answer, fields, times }, { ...mission, ...patch });
        }""",
        mission,
    )


@pytest.mark.parametrize(("example", "time"), [("cyclone-idai", 0.6), ("paper-5x10", 0.35)])
def test_state_at_a_moment_is_the_specifications(page, service, example, time):
    ready(page)
    open_problem(page, example_problem(example))
    answer = show_answer(page, service.url, algorithm="local_search", time_limit_s=0.5)
    problem = state(page, "problem")

    now = moment(page, clock=time)["now"]

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
    # The rest of the old plan is what the new one begins with.
    assert values[1] >= values[0] - 1e-9
    assert {uav["available_from"] for uav in problem["uavs"] if not uav.get("ret")} >= {0.3}
    assert page.locator("#field-time").input_value() == "0.3"
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

    begin = moment(page, clock=0)

    assert begin["rest"]["reward"] == pytest.approx(answer["reward"])
    assert begin["before"] == [[stop["target_id"] for stop in r["stops"]] for r in answer["routes"]]
    later = moment(page, clock=0.3)
    assert later["rest"]["reward"] == pytest.approx(
        replay(later["now"], later["now"]["start_plan"])["reward"]
    )


def test_uavs_on_their_way_home_are_called_back_only_where_that_is_chosen(page, service):
    ready(page)
    answer = show_answer(page, service.url, algorithm="greedy")
    last = max(stop["arrival_time"] for route in answer["routes"] for stop in route["stops"])

    kept, recalled = (moment(page, clock=last + 0.2, recall=recall)["now"] for recall in (False, True))

    flown = [bool(route["stops"]) for route in answer["routes"]]
    assert [uav.get("ret", 0) for uav in kept["uavs"]] == [int(flies) for flies in flown]
    assert [uav.get("ret", 0) for uav in recalled["uavs"]] == [0] * len(flown)


def test_visits_that_are_not_allowed_any_more_fall_out_of_the_rest(page, service):
    ready(page)
    page.expected_troubles.append("422")
    show_answer(page, service.url, algorithm="greedy")
    before = moment(page, clock=0.01)
    name = next(visits[-1] for visits in before["before"] if visits)

    after = moment(page, clock=0.01, happened={name: {"loadlist": [0]}})

    assert name not in {stop["target_id"] for r in after["rest"]["routes"] for stop in r["stops"]}
    assert after["rest"]["reward"] < before["rest"]["reward"]
    assert replay(after["now"], after["now"]["start_plan"])["reward"] == pytest.approx(
        after["rest"]["reward"]
    )


def test_a_service_that_is_away_takes_nothing_of_the_mission(page, service):
    ready(page)
    page.expected_troubles.append("ERR_FAILED")
    show_answer(page, service.url, algorithm="greedy")
    go(page, "field")
    expect(page.locator("[data-testid=field-uavs] tbody tr").first).to_be_visible()
    page.route("**/evaluate", lambda route: route.abort())
    page.locator("#field-time").fill("0.3")
    page.locator("#field-time").press("Tab")
    says = page.get_by_test_id("field-moment")
    expect(says).to_contain_text("What remains at 0.3 is not known: The service cannot be reached")
    page.get_by_label("mid-2 is lost").check()
    page.get_by_role("button", name="Allocate again from here").click()
    expect(page.get_by_test_id("field-status")).to_have_text("The service does not say what remains")
    mission = state(page, "mission")
    assert (mission["clock"], mission["lost"]) == (0.3, ["mid-2"])

    page.unroute("**/evaluate")
    page.get_by_role("button", name="Ask again").click()
    expect(page.locator("[data-testid=field-uavs] tr[data-uav=mid-2]")).to_contain_text("lost")
    expect(says).to_have_text("")


def test_a_slow_service_is_shown_of_the_newest_moment_only(page, service):
    ready(page)
    answer = show_answer(page, service.url, algorithm="greedy")
    route = max(answer["routes"], key=lambda each: each["distance"])
    go(page, "field")
    row = page.locator(f"[data-testid=field-uavs] tr[data-uav={route['uav_id']}]")
    expect(row).to_be_visible()
    held, asked = [], []

    def hold_the_first(route):
        asked.append(json.loads(route.request.post_data).get("at"))
        held.append(route) if len(asked) == 1 else route.continue_()

    page.route("**/evaluate", hold_the_first)
    with page.expect_request("**/evaluate"):
        page.locator("#field-time").fill("0.1")
        page.locator("#field-time").press("Tab")
    for clock in ("0.2", "0.4"):
        page.locator("#field-time").fill(clock)
        page.locator("#field-time").press("Tab")
    expect(page.get_by_test_id("field-moment")).to_have_text("The service is asked what remains …")
    held[0].continue_()
    expect(page.get_by_test_id("field-moment")).to_have_text("")
    # What was asked first is heard to its end; nothing between is asked for.
    assert [at for at in asked if at is not None] == [0.1, 0.4]
    uav = next(each for each in moment(page, clock=0.4)["now"]["uavs"] if each["id"] == route["uav_id"])
    assert value(row.locator("td.n").first) == pytest.approx(uav["voyage"] - uav["dis"])


def test_another_problem_while_the_service_is_asked_ends_the_mission(page, service):
    ready(page)
    page.expected_troubles.append("ERR_FAILED")
    show_answer(page, service.url, algorithm="greedy")
    go(page, "field")
    expect(page.locator("[data-testid=field-uavs] tbody tr").first).to_be_visible()
    held = []
    page.route("**/evaluate", lambda route: held.append(route))  # noqa: PLW0108 - it takes no built-in
    with page.expect_request("**/evaluate"):
        page.locator("#field-time").fill("0.1")
        page.locator("#field-time").press("Tab")
    open_problem(page, state(page, "problem"))
    with page.expect_event("requestfailed"):
        held[0].abort()
    # What the page makes of that it has made by now; trouble is told at the end of these tests.
    expect(page.locator("[data-testid=field-uavs]")).to_be_hidden()


MEASURE = """
    const { changes, withNeeds } = await load("mid_mission.js");
    const { met } = await load("plan.js");
    const { now } = given;
    return {
        more: withNeeds(now.targets[0], [12, 0]),
        fewer: withNeeds(now.targets[0], [0, 0]),
        untouched: withNeeds(now.targets[2], [1, 0]),
        met: [...met(now, null).values()],
        changes: changes({ uavs: [{ id: "u" }, { id: "gone" }] }, given, given.answer),
    };
"""


def test_what_an_area_asked_for_at_first_stays_the_measure_of_what_it_has():
    """82 were needed and 80 have come; 90 were asked for at another area, of which 40 came before."""
    place = {"x": 1, "y": 0}
    now = {
        "uavs": [{"id": "u"}],
        "targets": [
            {"id": "nearly", **place, "level": 2, "loadlist": [2, 0], "requested": [82, 0]},
            {"id": "half", **place, "level": 3, "loadlist": [50, 0], "requested": [90, 0]},
            {"id": "none", **place, "level": 1, "loadlist": [5, 5]},
        ],
    }
    lacking = [
        {"target_id": "nearly", "remaining": [2, 0]},
        {"target_id": "half", "remaining": [5, 0]},
        {"target_id": "none", "remaining": [5, 5]},
    ]
    answer = {"routes": [{"uav_id": "u", "stops": [{"target_id": "nearly"}]}], "unmet": lacking[1:]}
    before = [["half"], ["none"]]

    given = {"now": now, "rest": {"reward": 1.5, "unmet": lacking}, "before": before, "answer": answer}
    found = run_module(MEASURE, given)

    assert (found["more"]["loadlist"], found["more"]["requested"]) == ([12, 0], [92, 0])
    assert (found["fewer"]["loadlist"], found["fewer"]["requested"]) == ([0, 0], [80, 0])
    assert "requested" not in found["untouched"]
    assert found["met"] == pytest.approx([80 / 82, 40 / 90, 0])
    assert found["changes"]["kept"] == {"reward": 1.5}
    assert [area["before"] for area in found["changes"]["areas"]] == pytest.approx([80 / 82, 85 / 90, 0])
    assert [area["after"] for area in found["changes"]["areas"]] == pytest.approx([1, 85 / 90, 0])
    assert found["changes"]["routes"] == [
        {"uav_id": "u", "before": ["half"], "after": ["nearly"], "kind": "changed"},
        {"uav_id": "gone", "before": ["none"], "after": [], "kind": "lost"},
    ]


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
