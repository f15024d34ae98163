"""Missions over HTTP: what is told is kept, in order and once; plans follow it."""

import json
import threading
import time

import pytest
from mission_days import require_sound

SMALL = {
    "uavs": [{"x_s": 0.0, "y_s": y, "speed": 1.0, "voyage": 40.0, "loadlist": [6.0]} for y in (0.0, 1.0)],
    "targets": [{"id": f"area-{j}", "x": 2.0 * j, "y": 1.0, "level": 1, "loadlist": [2]} for j in (1, 2, 3)],
    "objective": {"distance_weight": 0.01},
    "max_steps": 6,
}
QUICK = {"algorithm": "greedy", "time_limit_s": 0.5}
PLANNED = {**SMALL, "start_plan": [[0, 3], [1, 3]]}
WITHIN_S = 60


class Mission:
    """A mission, and a client of it."""

    def __init__(self, client, headers=None, **body):
        self.client = client
        answer = client.post("/missions", json={"problem": SMALL, **QUICK, **body}, headers=headers)
        assert answer.status_code == 201, answer.text
        self.id = answer.json()["id"]
        assert answer.headers["location"] == self.path
        self._told = 0

    @property
    def path(self):
        return f"/missions/{self.id}"

    def get(self, below="", **query):
        answer = self.client.get(self.path + below, params=query)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def send(self, type_, at=None, id=None, **fields):
        self._told += 1
        body = {"type": type_, "id": id or f"e-{self._told}", **({} if at is None else {"at": at}), **fields}
        return self.client.post(f"{self.path}/events", json=body)

    def tell(self, type_, at=None, **fields):
        answer = self.send(type_, at, **fields)
        assert answer.status_code == 201, answer.text
        return answer.json()

    def settle(self):
        """Wait until no plan is looked for, and return the mission."""
        end = time.monotonic() + WITHIN_S
        while (mission := self.get())["searching"]:
            assert time.monotonic() < end, "the search does not end"
            threading.Event().wait(0.02)
        return mission

    def routes(self):
        return [[stop.get("target_id") for stop in route["stops"]] for route in self.get("/plan")["routes"]]


@pytest.fixture
def begin(client):
    """Begins missions, and leaves none behind whose plan is still being looked for."""
    begun = []

    def begin(**body):
        begun.append(Mission(client, **body))
        return begun[-1]

    yield begin
    for mission in begun:
        if client.get(mission.path).is_success:
            mission.settle()
            client.delete(mission.path)


def test_a_plan_is_proposed_and_accepted(begin):
    mission = begin(name="a town")
    assert mission.routes() == [[], []]
    settled = mission.settle()
    assert (settled["name"], settled["clock"], settled["state_number"]) == ("a town", 0.0, 1)
    (proposal,) = mission.get("/proposals")["proposals"]
    assert proposal["status"] == "open"
    assert proposal["gained"] == pytest.approx(proposal["reward"]) != 0
    assert proposal["differences"]["visits_changed"] == 3
    told = mission.tell("proposal_accepted", proposal=proposal["number"])
    assert told["effect"]["reward"] == pytest.approx(proposal["reward"])
    assert mission.get("/proposals")["proposals"][0]["status"] == "accepted"
    assert {stop for route in mission.routes() for stop in route} == {"area-1", "area-2", "area-3"}
    again = mission.send("proposal_accepted", proposal=proposal["number"])
    assert (again.status_code, again.json()["type"]) == (409, "/docs/errors#proposal-closed")


def test_plans_take_effect_by_themselves_where_that_is_asked_for(begin):
    mission = begin(plans="automatic")
    end = time.monotonic() + WITHIN_S
    while not any(mission.routes()):
        assert time.monotonic() < end
        threading.Event().wait(0.02)
    types = [each["type"] for each in mission.get("/events")["events"]]
    assert types == ["begun", "plan_proposed", "proposal_accepted"]
    assert mission.get("/proposals")["proposals"][0]["status"] == "accepted"


def test_an_event_says_what_it_did_and_makes_a_proposal(begin):
    mission = begin(problem=PLANNED)
    told = mission.tell("uav_lost", 1.0, uav_id="uav-1")
    assert told["effect"]["flyable"] is False
    assert [each["target_id"] for each in told["effect"]["broken"]] == ["area-1", "area-2"]
    assert mission.settle()["trouble"] is None
    newest = mission.get("/proposals")["proposals"][0]
    # It is from the state now: the other one flies all of it.
    assert newest["of_number"] == told["number"]
    assert newest["routes"][0]["stops"] == []
    assert newest["routes"][1]["stops"]
    mission.tell("proposal_refused", proposal=newest["number"])
    assert mission.get("/proposals")["proposals"][0]["status"] == "refused"


def test_a_proposal_is_outdated_by_what_makes_another_plan_wanted(begin):
    mission = begin()
    mission.settle()
    mission.tell("clock", 0.5)
    first = mission.get("/proposals")["proposals"][0]
    assert first["status"] == "open"
    mission.tell("level_changed", 0.6, target_id="area-1", level=5.0)
    mission.settle()
    statuses = {each["number"]: each["status"] for each in mission.get("/proposals")["proposals"]}
    assert statuses.pop(first["number"]) == "outdated"
    assert list(statuses.values()) == ["open"]


def test_a_search_ends_once_an_event_outdates_it_or_its_mission_is_deleted(begin, client):
    def statuses():
        jobs = client.get("/jobs", params={"limit": 100}).json()["jobs"]
        return {
            job["id"]: job["status"] for job in jobs if job["kind"] == "replan" and job["id"] not in before
        }

    def await_that(holds):
        end = time.monotonic() + WITHIN_S
        while not holds(list(statuses().values())):
            assert time.monotonic() < end, statuses()
            threading.Event().wait(0.02)

    before: set[str] = set()
    before = set(statuses())
    # No search comes to its end here by itself.
    long = {"algorithm": "qmix", "parameters": {"n_epochs": 10_000_000}, "time_limit_s": 2 * WITHIN_S}
    mission = begin(problem=PLANNED, **long)
    await_that(lambda found: found == ["running"])
    (first,) = statuses()
    for k in range(10):
        mission.tell("level_changed", target_id="area-1", level=float(k))
    await_that(lambda found: sorted(set(found)) == ["cancelled", "running"] and found.count("running") == 1)
    # One for the beginning, and at most one an event; those that come meanwhile have one together.
    assert 2 <= len(statuses()) <= 11
    assert statuses()[first] == "cancelled"
    now = mission.get()
    assert (now["searching"], now["trouble"]) == (True, None)
    assert mission.get("/proposals")["proposals"] == []
    assert client.delete(mission.path).status_code == 204
    await_that(lambda found: set(found) == {"cancelled"})


def test_the_same_event_is_kept_once(begin):
    mission = begin(problem=PLANNED)
    new = {"id": "x", "x": 1.0, "y": 1.0, "level": 1.0, "loadlist": [1.0]}
    first = mission.send("areas_added", 1.0, id="call-1", targets=[new])
    again = mission.send("areas_added", 1.0, id="call-1", targets=[new])
    other = mission.send("areas_added", 1.0, id="call-1", targets=[new | {"x": 2.0}])
    assert (first.status_code, again.status_code) == (201, 200)
    assert again.json() == first.json()
    assert (other.status_code, other.json()["type"]) == (422, "/docs/errors#event-id-reused")
    assert other.json()["errors"][0]["pointer"] == "/id"
    assert len(mission.get()["state"]["problem"]["targets"]) == 4


@pytest.mark.parametrize(
    ("type_", "fields", "pointer", "says"),
    [
        ("uav_lost", {"uav_id": "uav-9"}, "/uav_id", "'uav-9' is no UAV of this mission"),
        ("clock", {"at": 0.5}, "/at", "0.5 is in the past: the mission's clock is 1"),
        ("uav_delayed", {"uav_id": "uav-1", "until": 0.5}, "/until", "0.5 is not after the event"),
        ("stock_changed", {"base_id": "b", "stock": [1.0]}, "/base_id", "'b' is no base"),
        ("proposal_accepted", {"proposal": 999}, "/proposal", "999 is no number of a proposal"),
        (
            "visit_done",
            {"uav_id": "uav-1", "target_id": "area-3", "delivered": [7.0]},
            "/delivered/0",
            "7 of material 1, but uav-1 had 6 aboard",
        ),
        (
            "telemetry",
            {"positions": [{"uav_id": "uav-7", "time": 1.0, "x": 0.0, "y": 0.0}]},
            "/positions/0/uav_id",
            "'uav-7' is no UAV",
        ),
        (
            "areas_added",
            {"targets": [{"id": "area-1", "x": 0.0, "y": 0.0, "level": 1.0, "loadlist": [1.0]}]},
            "/targets/0/id",
            "'area-1' is the id of another one already",
        ),
    ],
)
def test_what_cannot_be_is_refused(begin, type_, fields, pointer, says):
    mission = begin(problem=PLANNED)
    mission.tell("clock", 1.0)
    before = mission.settle()
    refused = mission.send(type_, **fields)
    assert (refused.status_code, refused.json()["type"]) == (422, "/docs/errors#event-refused")
    (error,) = refused.json()["errors"]
    assert error["pointer"] == pointer
    assert says in error["detail"]
    assert mission.get() == before


def test_fields_are_checked_as_those_of_a_problem_are(begin):
    mission = begin()
    wrong = mission.send("level_changed", target_id="area-1", level=-1.0, more=1)
    assert (wrong.status_code, wrong.json()["type"]) == (422, "/docs/errors#invalid-request")
    assert {each["pointer"] for each in wrong.json()["errors"]} == {"/level", "/more"}
    control = mission.send("clock", id="a\u009b")
    assert (control.status_code, control.json()["errors"][0]["pointer"]) == (422, "/id")
    unknown = mission.send("earthquake")
    assert unknown.status_code == 422
    assert "uav_lost" in unknown.json()["detail"]
    assert mission.client.get("/missions/" + "0" * 32).json()["type"] == "/docs/errors#mission-not-found"


def test_positions_count_with_the_next_event(begin):
    mission = begin(problem=PLANNED)
    told = mission.tell(
        "telemetry",
        positions=[
            {"uav_id": "uav-1", "time": 1.0, "x": 0.5, "y": 0.5},
            {"uav_id": "uav-1", "time": 0.5, "x": 0.1, "y": 0.1},
        ],
    )
    assert (told["effect"], told["passed_over"], told["at"]) == (None, 1, 1.0)
    late = mission.tell("telemetry", positions=[{"uav_id": "uav-1", "time": 0.9, "x": 0.0, "y": 0.0}])
    assert late["passed_over"] == 1
    assert mission.get()["positions"]["uav-1"]["x"] == 0.5
    now = mission.tell("clock")
    assert now["at"] == 1.0
    assert {each["target_id"] for each in now["effect"]["late"]} == {"area-1", "area-2"}
    assert mission.get()["state"]["problem"]["uavs"][0]["x_c"] == 0.5


def test_a_proposal_that_fits_no_more_is_outdated_and_another_plan_is_looked_for(begin):
    mission = begin(problem=PLANNED)
    mission.settle()
    (proposal,) = mission.get("/proposals")["proposals"]
    voyage = SMALL["uavs"][0]["voyage"]
    mission.tell(
        "telemetry", positions=[{"uav_id": "uav-1", "time": 0.2, "x": 0.1, "y": 0.1, "dis": 0.999 * voyage}]
    )
    refused = mission.send("proposal_accepted", proposal=proposal["number"])
    assert (refused.status_code, refused.json()["type"]) == (409, "/docs/errors#proposal-closed")
    assert mission.get("/proposals")["proposals"][-1]["status"] == "outdated"
    settled = mission.settle()
    assert settled["clock"] == 0.2
    assert settled["state"]["problem"]["uavs"][0]["dis"] == pytest.approx(0.999 * voyage)
    assert [event["type"] for event in mission.get("/events")["events"]][-1] in {"clock", "plan_proposed"}


def test_positions_of_a_uav_that_is_new_are_taken(begin):
    mission = begin(problem=PLANNED)
    new = {**SMALL["uavs"][0], "id": "new"}
    seen = {"time": 1.0, "x": 0.0, "y": 0.0}
    mission.tell("telemetry", positions=[{**seen, "uav_id": "uav-1"}])
    mission.tell("uavs_added", uavs=[new])
    assert mission.tell("telemetry", positions=[{**seen, "uav_id": "new"}])["passed_over"] == 0


def test_the_state_is_known_at_every_moment(begin):
    mission = begin(problem=PLANNED)
    mission.tell("clock", 1.0)
    mission.tell("level_changed", 2.0, target_id="area-3", level=9.0)

    def x_of(at):
        return mission.get("/state", at=at)["state"]["problem"]["uavs"][0]["x_c"]

    start = mission.get("/state", at=0.0)
    assert (start["number"], start["state"]["problem"]["targets"][2]["level"]) == (1, 1.0)
    way = (2.0**2 + 1.0) ** 0.5
    assert x_of(1.5) == pytest.approx(2.0 * 1.5 / way)
    assert mission.get("/state", at=1.5)["state"]["problem"]["targets"][2]["level"] == 1.0
    later = mission.get("/state", at=way + 1.0)
    assert [each["target_id"] for each in later["state"]["done"]] == ["area-1"]
    assert later["state"]["problem"]["targets"][2]["level"] == 9.0
    assert later["plan"]["routes"][0]["stops"][0]["arrival_time"] == pytest.approx(way + 2.0)
    assert mission.get("/state")["state"] == mission.get()["state"]


def test_two_plans_are_compared(begin):
    mission = begin(problem=PLANNED)
    lost = mission.tell("uav_lost", 0.5, uav_id="uav-1")
    found = mission.get("/differences", before=1, after=lost["number"])
    assert found["visits_changed"] == 2
    (one,) = found["uavs"]
    assert one["removed"] == [{"target_id": "area-1"}, {"target_id": "area-2"}]


def test_history_is_paged_and_replayed(begin):
    mission = begin(problem=PLANNED)
    for k in range(5):
        mission.tell("clock", float(k))
    mission.settle()
    first = mission.get("/events", limit=4)
    assert [each["number"] for each in first["events"]] == [1, 2, 3, 4]
    rest = mission.get("/events", after=first["next_after"])
    assert rest["next_after"] is None
    replay = mission.get("/replay")
    assert [{k: v for k, v in each.items() if k != "state"} for each in replay["events"]] == (
        first["events"] + rest["events"]
    )
    states = [each["state"] for each in replay["events"] if each["state"]]
    assert states[-1] == mission.get()["state"]
    assert replay["problem"]["targets"][0]["id"] == "area-1"
    require_sound(states[-1], mission.get("/plan"))


def test_a_stream_tells_what_happens_and_goes_on_where_it_was(begin):
    mission = begin(problem=PLANNED)
    mission.settle()
    last = mission.get()["last_number"]
    heard = []

    def listen(after, count):
        headers = {"Last-Event-ID": str(after)} if after else {}
        with mission.client.stream(
            "GET", f"{mission.path}/stream", headers=headers, timeout=WITHIN_S
        ) as stream:
            for line in stream.iter_lines():
                if line.startswith("data:"):
                    heard.append(json.loads(line.removeprefix("data:")))
                    if len(heard) == count:
                        return

    listener = threading.Thread(target=listen, args=(0, last + 2))
    listener.start()
    mission.tell("clock", 1.0)
    mission.tell("clock", 2.0)
    listener.join(WITHIN_S)
    assert [each["number"] for each in heard] == list(range(1, last + 3))
    heard.clear()
    listen(last + 1, 1)
    assert heard == mission.get("/events", after=last + 1)["events"]


def test_missions_are_listed_and_deleted(begin, client):
    first, second = begin(name="one"), begin(name="two")
    page = client.get("/missions", params={"limit": 1}).json()
    assert [each["id"] for each in page["missions"]] == [second.id]
    following = client.get("/missions", params={"limit": 1, "cursor": page["next_cursor"]}).json()
    assert [each["id"] for each in following["missions"]] == [first.id]
    assert client.delete(first.path).status_code == 204
    assert client.delete(first.path).json()["type"] == "/docs/errors#mission-not-found"
    assert first.send("clock").status_code == 404


def test_a_retry_with_the_same_key_is_the_same_mission(begin, client):
    key = {"Idempotency-Key": "mission-retry-1"}
    body = {"problem": PLANNED, **QUICK, "name": "once"}
    mission = begin(headers=key, **body)
    mission.tell("clock", at=0.5)
    mission.settle()

    again = client.post("/missions", json=dict(reversed(body.items())), headers=key)
    other = client.post("/missions", json={**body, "seed": 1}, headers=key)

    assert (again.status_code, again.headers["location"]) == (200, mission.path)
    now = mission.get()
    assert again.json() == {name: now[name] for name in again.json()}
    assert again.json()["clock"] == 0.5
    assert (other.status_code, other.json()["type"]) == (422, "/docs/errors#idempotency-key-reused")
    assert mission.id in other.json()["detail"]
    assert [each["name"] for each in client.get("/missions").json()["missions"]].count("once") == 1


def test_a_plan_that_breaks_a_rule_begins_nothing(client):
    body = {"problem": {**SMALL, "start_plan": [[0, 0], [0, 0], [0, 0]]}, **QUICK}
    refused = client.post("/missions", json=body)
    assert (refused.status_code, refused.json()["type"]) == (422, "/docs/errors#illegal-plan")
    assert refused.json()["errors"][0]["pointer"].startswith("/problem/start_plan")
    unknown = client.post("/missions", json={"problem": SMALL, "algorithm": "magic"})
    assert unknown.json()["type"] == "/docs/errors#unknown-algorithm"


def test_change_weight_keeps_the_plan_in_force(begin):
    dear = begin(problem=PLANNED, change_weight=100.0)
    dear.tell("level_changed", 0.1, target_id="area-3", level=3.0)
    dear.settle()
    for proposal in dear.get("/proposals")["proposals"]:
        assert all(each["removed"] == [] for each in proposal["differences"]["uavs"])
