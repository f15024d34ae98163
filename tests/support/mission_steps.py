"""Steps that tests of missions on the page begin with, and a mission as another client has it."""

import threading
from collections.abc import Iterator

from dashboard_steps import begin_again
from playwright.sync_api import Page, expect
from told_mission import ToldMission

AREA = {"level": 1, "loadlist": [3], "service_time": 0.5}
UAV = {"x_s": 0, "y_s": 0, "speed": 2, "voyage": 60, "loadlist": [6], "full_load": [6]}
SMALL = {
    "crs": "local",
    "uavs": [{**UAV, "id": "u1"}, {**UAV, "id": "u2"}],
    "targets": [{**AREA, "id": "near", "x": 8, "y": 0}, {**AREA, "id": "far", "x": 0, "y": 14}],
    "bases": [{"id": "depot", "x": 10, "y": 10, "stock": [9], "turnaround": 1}],
    "no_fly_zones": [{"id": "tower", "polygon": [[30, 30], [31, 30], [31, 31]]}],
    "objective": {"distance_weight": 0.001},
    "start_plan": [[0, 1]],
}


def without_a_mission(page: Page) -> Iterator[Page]:
    """One page for all tests of a module: each begins with the problem of a new page, and no mission open."""
    begin_again(page)
    page.evaluate("async () => (await import('/dashboard/js/missions/feed.js')).openMission(null)")
    yield page
    page.unroute_all()


class Mission(ToldMission):
    """A mission as another client of the service sees it."""

    def __init__(self, service, problem=SMALL, **planning):
        body = {"problem": problem, "time_limit_s": 0.2, "algorithm": "local_search", **planning}
        super().__init__(service.url, body)

    def delete(self):
        self._ask("DELETE")

    def types(self):
        return [each["type"] for each in self.read("/events?limit=1000")["events"]]

    def search_ends(self):
        while self.read()["searching"]:
            threading.Event().wait(0.05)
        return self

    def open(self, page):
        """Open it by its address, and wait until it is on screen."""
        page.evaluate("(id) => { location.hash = `#/missions/${id}`; }", self.id)
        expect(page.get_by_test_id("mission-link")).to_have_text("live")
        expect(page.get_by_test_id("mission-UAVs")).to_be_visible()
        return self


def at_the_newest(page, mission):
    """Wait until the page has the newest event, and the state that it made."""
    number = mission.read()["last_number"]
    page.wait_for_function(
        """async (number) => {
            const { events, head, plan } = (await import("/dashboard/js/state.js")).get().openMission;
            const heard = Math.min(events[0].number, head.last_number);
            return heard >= number && plan.number === head.state_number;
        }""",
        arg=number,
    )


def select(page, kind, name):
    page.evaluate(
        "async ([kind, id]) => (await import('/dashboard/js/state.js')).select({ kind, id })", [kind, name]
    )


def tell(page):
    page.get_by_test_id("mission-happened").get_by_role("button", name="Tell").click()


def newest(page, mission, of_type):
    """Wait for the page to have an event of a type; return it as the service has it."""
    row = page.locator(f"[data-testid=mission-log] li[data-type={of_type}]").first
    expect(row).to_be_attached()
    at_the_newest(page, mission)
    return next(each for each in reversed(mission.read("/events")["events"]) if each["type"] == of_type)


def look_at(page, at):
    page.locator("#mission-time").fill(str(at))
    page.locator("#mission-time").press("Tab")
