"""Both clients against the service: what they return and raise, and what they do where connections break."""

import json
import re
import uuid
import zipfile
from io import BytesIO
from pathlib import Path

import httpx
import pytest
from cutting_proxy import CuttingProxy

from app.client import (
    AsyncClient,
    Client,
    JobCancelled,
    JobFailed,
    ServiceError,
    ServiceUnreachable,
    StreamCutOff,
)
from app.client.exchange import Call, may_come_again, pause_s

ROOT = Path(__file__).parents[2]
LONG = {"algorithm": "local_search", "time_limit_s": 60}


def test_the_two_clients_have_the_same_methods():
    def methods(kind):
        return {name for name in dir(kind) if not name.startswith("_")}

    assert methods(Client) == methods(AsyncClient)


def test_a_plan_is_found_followed_evaluated_and_taken_along(client, problem):
    answer = client.allocate(problem, algorithm="greedy", seed=7)
    assert (answer["algorithm"], answer["seed"]) == ("greedy", 7)
    job = client.submit(problem, algorithm="greedy", seed=7)
    *_, last = client.follow(job["id"])
    assert (last.name, last.data["status"]) == ("end", "succeeded")
    assert client.answer(job["id"])["assignment"] == answer["assignment"]
    assert client.wait(job["id"])["result"]["reward"] == answer["reward"]
    # Of one that has ended nothing more is told after its last event.
    assert list(client.follow(job["id"], last.id)) == []
    evaluated = client.evaluate(problem, answer["assignment"], at=0.1)
    assert evaluated["reward"] == pytest.approx(answer["reward"])
    assert evaluated["remaining"]["uavs"]
    assert client.problem_of(job["id"])["targets"][0]["level"] == problem["targets"][0]["level"]
    table = client.export(job["id"], "csv")
    assert table.text.startswith("uav_id,")
    assert (table.name, table.media_type) == (f"plan-{job['id'][:8]}.csv", "text/csv")
    flown = client.submit(client.example("cyclone-idai"), algorithm="greedy")
    client.wait(flown["id"])
    archive = client.export(flown["id"], "qgc-plan", delivery="gripper", gripper=2)
    with zipfile.ZipFile(BytesIO(archive.content)) as files:
        texts = [{"name": name, "content": files.read(name).decode()} for name in files.namelist()]
    items = json.loads(texts[0]["content"])["mission"]["items"]
    assert {each["params"][0] for each in items if each["command"] == 211} == {2.0}
    read = client.evaluate(client.problem_of(flown["id"]), flight_files=texts)
    assert read["assignment"] == client.answer(flown["id"])["assignment"]


def test_every_page_of_a_list_is_read(client, problem):
    made = [client.submit(problem, algorithm="greedy", seed=seed)["id"] for seed in range(23)]
    for job_id in made:
        client.wait(job_id)
    assert set(made) <= {job["id"] for job in client.jobs()}
    listed = [job["status"] for job in client.jobs("succeeded")]
    assert len(listed) >= 23
    assert set(listed) == {"succeeded"}


def test_a_batch_is_answered_line_by_line(client, problem):
    wrong = {**problem, "id": "wrong", "algorithm": "luck"}
    good = {**problem, "id": "good", "algorithm": "greedy"}
    lines = {line["id"]: line for line in client.allocate_many([wrong, good])}
    assert lines["wrong"]["problem"]["type"] == "/docs/errors#unknown-algorithm"
    assert len(lines["good"]["allocation"]["routes"]) == 5


def test_a_job_is_cancelled_and_says_so(client, problem):
    job = client.submit(problem, **LONG)
    for event in client.follow(job["id"]):
        if event.data["best_reward"] is not None:
            client.cancel(job["id"])
            break
    reward = client.answer(job["id"])["reward"]
    assert reward == pytest.approx(client.job(job["id"])["progress"]["best_reward"])
    busy = [client.submit(problem, **LONG)["id"] for _ in range(2)]
    waiting = client.submit(problem, **LONG)["id"]
    client.cancel(waiting)
    with pytest.raises(JobCancelled, match=f"job {waiting} cancelled"):
        client.answer(waiting)
    for job_id in busy:
        client.cancel(job_id)


def test_a_job_that_fails_says_why(client, problem):
    two = {**problem, "uavs": problem["uavs"][:2]}
    job = client.submit(two, algorithm="transfer_qmix", parameters={"mode": "paper"})
    with pytest.raises(JobFailed, match="no-compatible-source: no source policy for 2x10x3"):
        client.answer(job["id"])


def test_missions_are_begun_told_of_and_replayed(client, problem):
    key, planning = uuid.uuid4().hex, {"algorithm": "greedy", "time_limit_s": 5}
    mission = client.begin_mission(_task(problem), idempotency_key=key, **planning)["id"]
    assert client.begin_mission(_task(problem), idempotency_key=key, **planning)["id"] == mission
    seen = []
    for event in client.follow_mission(mission):
        seen.append(event)
        if event.name == "plan_proposed":
            proposal = int(event.id)
            client.tell(mission, {"type": "proposal_accepted", "id": "yes", "proposal": proposal})
        if event.name == "proposal_accepted":
            break
    assert [event.name for event in seen] == ["begun", "plan_proposed", "proposal_accepted"]
    assert client.proposals(mission)[0]["status"] == "accepted"
    told = client.tell(mission, {"type": "clock", "id": "tick", "at": 0.1})
    assert client.tell(mission, {"type": "clock", "id": "tick", "at": 0.1}) == told
    assert client.mission(mission)["clock"] == client.mission_state(mission)["state"]["clock"] == 0.1
    assert client.mission_plan(mission)["clock"] == 0.1
    assert [each["type"] for each in client.history(mission, after=1)] == [
        "plan_proposed",
        "proposal_accepted",
        "clock",
    ]
    assert client.differences(mission, 1, 3)["visits_changed"] > 0
    assert len(client.replay(mission)["events"]) == 4
    assert mission in [each["id"] for each in client.missions()]
    # Who listens is told by the end of the stream that there is no such mission any more.
    listening = client.follow_mission(mission, after="4")
    client.delete_mission(mission)
    with pytest.raises(ServiceError, match="mission-not-found"):
        list(listening)


def test_policies_are_found_loaded_and_deleted(client, problem):
    listed = list(client.policies())
    universal = client.policy("universal-6")
    assert universal["checkpoint"]["size"] == len(client.checkpoint("universal-6").content)
    nearest = client.similar(_task(problem), k=3)
    assert len(nearest) == 3
    learned = {"algorithm": "qmix", "parameters": {"mode": "paper", "n_epochs": 3}}
    job = client.register({"name": "tests", "task": _task(problem), "train": learned})
    policy_id = client.wait(job["id"])["result"]["policy_id"]
    assert client.policy(policy_id)["name"] == "tests"
    client.delete_policy(policy_id)
    assert len(list(client.policies())) == len(listed)


def test_a_refusal_names_the_field_the_value_and_the_limit(client, problem):
    uavs = [{**problem["uavs"][0], "speed": -5}, *problem["uavs"][1:]]
    with pytest.raises(ServiceError) as caught:
        client.allocate({**problem, "uavs": uavs})
    error = caught.value
    assert (error.status, error.type) == (422, "invalid-request")
    assert error.errors[0]["pointer"] == "/uavs/0/speed"
    assert "/uavs/0/speed: is -5, must be more than 0" in str(error)
    assert re.fullmatch("[0-9a-f]{32}", error.request_id)


def test_an_id_leads_nowhere_else(client, problem):
    job = client.submit(problem, **LONG)
    for path in (f"../jobs/{job['id']}", "..", "", "?"):
        with pytest.raises(ServiceError) as refused:
            client.delete_mission(path)
        assert refused.value.status in (307, 404, 405)
    assert client.job(job["id"])["status"] in ("queued", "running")
    client.cancel(job["id"])


def test_keys_are_sent(new_client, service, problem):
    with pytest.raises(ServiceError) as caught:
        new_client(service.url).allocate(problem)
    assert (caught.value.status, caught.value.type) == (401, "unauthenticated")
    with pytest.raises(ServiceError) as caught:
        new_client(service.url, service.keys["allocate"]).delete_policy("universal-6")
    assert (caught.value.status, caught.value.type) == (403, "forbidden")


def test_a_stream_that_is_cut_off_goes_on_after_its_last_event(new_client, service, client, problem):
    mission = client.begin_mission(_task(problem), algorithm="greedy")["id"]
    for number in range(40):
        client.tell(mission, {"type": "clock", "id": f"tick {number}"})
    path = f"{service.url}/missions/{mission}/events"
    headers = {"Authorization": f"Bearer {service.key}"}
    known = [each["number"] for each in httpx.get(path, headers=headers).json()["events"]]
    with CuttingProxy(service.port, cuts=[0, 900, 4000, 2500]) as proxy:
        cut = new_client(proxy.url, service.key)
        numbers = []
        for event in cut.follow_mission(mission):
            numbers.append(event.data["number"])
            if len(numbers) == len(known):
                break
        assert proxy.connections == 5
    assert numbers == known


def test_what_may_come_twice_is_sent_again_and_nothing_else(new_client, service, problem):
    with CuttingProxy(service.port, cuts=[0, 10, 30]) as proxy:
        answer = new_client(proxy.url, service.key).allocate(
            problem, algorithm="greedy", idempotency_key=uuid.uuid4().hex
        )
        assert answer["routes"]
        assert proxy.connections == 4
    with CuttingProxy(service.port, cuts=[10]) as proxy:
        once = new_client(proxy.url, service.key)
        with pytest.raises(ServiceUnreachable, match=r"POST http.*/allocate"):
            once.allocate(problem, algorithm="greedy")
        assert proxy.connections == 1
        assert once.health()["status"] == "ok"


def test_a_batch_that_breaks_off_says_so(new_client, service, problem):
    with CuttingProxy(service.port, cuts=[1500]) as proxy:
        lines = new_client(proxy.url, service.key).allocate_many([{**problem, "algorithm": "greedy"}] * 4)
        with pytest.raises(StreamCutOff):
            list(lines)


def test_nobody_there_is_told_with_the_address(new_client):
    with pytest.raises(ServiceUnreachable, match=r"GET http://127\.0\.0\.1:9/healthz"):
        new_client("http://127.0.0.1:9", retry_s=0).health()


@pytest.mark.parametrize(
    ("status", "kind", "repeatable", "again"),
    [
        (429, "queue-full", False, True),
        (503, "draining", False, True),
        (503, "store-unavailable", False, False),
        (503, "store-unavailable", True, True),
        (502, "", True, True),
        (422, "invalid-request", True, False),
        (500, "internal-error", True, False),
    ],
)
def test_what_is_sent_again(status, kind, repeatable, again):
    error = ServiceError(status, {"type": f"/docs/errors#{kind}"}, retry_after_s=3.0)
    assert may_come_again(Call("POST", "/", repeatable=repeatable), error) is again
    assert pause_s(1, error) == 3.0
    assert [pause_s(attempt) for attempt in (1, 2, 3, 9)] == [0.25, 0.5, 1.0, 5.0]


def test_every_operation_of_the_service_has_a_method(service, problem):
    described = json.loads((ROOT / "app/api/openapi.json").read_text("utf-8"))["paths"]
    code = (ROOT / "app/client/synchronous.py").read_text("utf-8")
    called = set(re.findall(r'"(GET|POST|DELETE)",\s*f?"(/[^"]*)"', code))
    called |= {("GET", path) for path in re.findall(r'(?:_get|_pages|events)\(\s*f?"(/[^"]*)"', code)}
    called |= {("GET", path) for path in re.findall(r'path = f"(/[^"]*)"', code)}
    paths = {(method, re.sub(r"\{[^}]*\}+", "{}", path)) for method, path in called}
    expected = {
        (method.upper(), re.sub(r"\{[^}]*\}", "{}", path))
        for path, operations in described.items()
        for method in operations
    }
    assert expected <= paths


def _task(problem):
    return {name: value for name, value in problem.items() if name not in ("algorithm", "time_limit_s")}
