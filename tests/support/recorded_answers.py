"""Answers of a running service to requests about a real case, as the description shows them.

`python tests/support/recorded_answers.py` starts a service and writes `app/examples/answers/`; a test records
again and compares. What takes much space is cut: lists to their first items, texts to their first lines.
"""

import json
import re
import sys
import tempfile
import time
from pathlib import Path

import httpx

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "app/examples/answers"
JSON, PROBLEM = "application/json", "application/problem+json"
UAVS, SITES = {"long-1", "mid-2"}, {"site-1", "site-3", "site-9", "site-12"}
WEIGHTS = "AgAAAAAAAAB7fQ=="
CUT = " … (cut here)"
LINES, CHARACTERS = 12, 600
PATIENCE_S = 60.0


class Recorder:
    """Sends requests, and keeps what came back by operation, status, media type and name."""

    def __init__(self, client):
        self.client = client
        description = client.get("/openapi.json").json()
        self._operations = [
            (method.upper(), re.compile(re.sub(r"\{\w+\}", "[^/]+", path)), operation["operationId"])
            for path, operations in description["paths"].items()
            for method, operation in operations.items()
        ]
        self._schemas = description["components"]["schemas"]
        self._operations.sort(key=lambda each: "[^/]+" in each[1].pattern)
        self.answers, self.problems = {}, {}

    def most(self, schema, name):
        """Return how many items the service takes in a list."""
        return self._schemas[schema]["properties"][name]["maxItems"]

    def send(self, method, path, body=None, *, name="beira", cut=lambda value: value, **options):
        """Send a request and keep its answer, if it is the first of its kind."""
        response = self.client.request(method, path, json=body, **options)
        written = response.content and "json" in response.headers.get("content-type", "")
        value = response.json() if written else response.text
        if response.headers.get("content-type") == PROBLEM:
            self.problems.setdefault(value["type"].rpartition("#")[2], value)
            return value
        response.raise_for_status()
        self.keep(method, path, response, cut(value), name)
        return value

    def keep(self, method, path, response, value, name):
        """Keep a value that came back; an answer without a body has none."""
        plain = path.partition("?")[0]
        operation = next(
            found
            for verb, template, found in self._operations
            if verb == method and template.fullmatch(plain)
        )
        media = value and response.headers.get("content-type", "").partition(";")[0]
        by_status = self.answers.setdefault(operation, {}).setdefault(str(response.status_code), {})
        if media:
            by_status.setdefault(media, {}).setdefault(name, value)

    def listen(self, path, until):
        """Keep the text of a stream of events up to one that is told by its name or number."""
        with self.client.stream("GET", path) as response:
            text = ""
            for line in response.iter_lines():
                text += line + "\n"
                if not line and until in text:
                    break
            self.keep("GET", path, response, text, "beira")


def beira(client):
    """A part of the example of cyclone Idai: two UAVs and four sites."""
    problem = client.get("/examples/cyclone-idai").json()
    for name in ("algorithm", "time_limit_s"):
        problem.pop(name, None)
    uavs = [each for each in problem["uavs"] if each["id"] in UAVS]
    targets = [each for each in problem["targets"] if each["id"] in SITES]
    return {**problem, "uavs": uavs, "targets": targets}


def record(client):
    """Record an example of every answer that the service gives; return them, and those of problems."""
    recorder = Recorder(client)
    problem = beira(client)
    greedy = {**problem, "algorithm": "greedy"}
    recorder.send("GET", "/healthz")
    recorder.send("GET", "/readyz")
    recorder.send("GET", "/metrics", cut=_lines)
    recorder.send("GET", "/examples")
    recorder.send(
        "GET", "/examples/cyclone-idai", cut=lambda each: {**each, **_part(each, "uavs", "targets")}
    )
    recorder.send("GET", "/algorithms", cut=_greedy_alone)
    answer = _allocations(recorder, greedy)
    _jobs(recorder, answer["job_id"], greedy)
    _files(recorder, answer["job_id"])
    _library(recorder, problem)
    _missions(recorder, problem)
    _refusals(recorder, greedy, answer)
    return recorder.answers, recorder.problems


def _allocations(recorder, greedy):
    answer = recorder.send("POST", "/allocate", greedy)
    accepted = recorder.send("POST", "/allocate", greedy, headers={"Prefer": "respond-async"})
    recorder.listen(f"/jobs/{accepted['id']}/events", "event: end")
    plan = {**_problem_of(greedy), "assignment": answer["assignment"]}
    recorder.send("POST", "/evaluate", plan)
    recorder.send("POST", "/evaluate", {**plan, "at": 0.5}, name="what remains after half an hour")
    unknown = {**greedy, "id": "tuesday", "algorithm": "luck"}
    body = {"problems": [{**greedy, "id": "monday"}, unknown]}
    response = recorder.client.post("/allocate/batch", json=body)
    for line in sorted(map(json.loads, response.text.splitlines()), key=lambda each: each["index"]):
        named = "a plan" if "allocation" in line else "a problem that is refused"
        recorder.keep("POST", "/allocate/batch", response, line, named)
    return answer


def _jobs(recorder, job_id, greedy):
    recorder.send("GET", "/jobs", params={"limit": 1, "status": "succeeded"})
    recorder.send("GET", f"/jobs/{job_id}")
    recorder.send("GET", f"/jobs/{job_id}/problem")
    recorder.send("DELETE", f"/jobs/{job_id}", name="it had ended before")
    long = {**greedy, "algorithm": "local_search", "time_limit_s": 30}
    running = recorder.client.post("/allocate", json=long, headers={"Prefer": "respond-async"}).json()["id"]
    _until(lambda: recorder.client.get(f"/jobs/{running}").json()["progress"]["assignment"])
    recorder.send("DELETE", f"/jobs/{running}", name="it stops soon", cut=_without_progress)


def _files(recorder, job_id):
    for format, choices in (
        ("geojson", {}),
        ("csv", {}),
        ("qgc-plan", {"uav": "long-1", "delivery": "gripper"}),
        ("qgc-wpl", {"uav": "long-1"}),
        ("html", {}),
        ("briefing", {}),
        ("kml", {"uav": "long-1"}),
        ("gpx", {"uav": "long-1"}),
    ):
        cut = (lambda text: text[:CHARACTERS] + CUT) if format == "html" else (lambda text: text)
        path = f"/jobs/{job_id}/plan"
        recorder.send("GET", path, params={"format": format, **choices}, name=format, cut=cut)


def _library(recorder, problem):
    page = recorder.send("GET", "/library", params={"limit": 2})
    policy = page["policies"][0]["id"]
    recorder.send(
        "GET", f"/library/{policy}", cut=lambda each: {**each, "task": _part(each["task"], "targets")}
    )
    recorder.send("POST", "/library/similar", {"task": problem, "k": 2, "similarity": "summary"})
    learned = {"algorithm": "qmix", "parameters": {"mode": "paper", "n_epochs": 3}, "seed": 1}
    body = {"name": "Beira", "task": problem, "train": learned}
    job = recorder.send("POST", "/library", body, name="a training")
    trained = _until(lambda: recorder.client.get(f"/jobs/{job['id']}").json()["result"])
    recorder.send("DELETE", f"/library/{trained['policy_id']}")
    body = {"name": "Beira", "job_id": job["id"]}
    registered = recorder.send(
        "POST", "/library", body, cut=lambda each: {**each, "task": _part(each["task"])}
    )
    recorder.client.delete(f"/library/{registered['id']}").raise_for_status()


def _missions(recorder, problem):
    body = {"name": "Beira, 21 March", "problem": problem, "algorithm": "greedy", "time_limit_s": 5}
    once = {"Idempotency-Key": "beira-21-march"}
    mission = recorder.send("POST", "/missions", body, headers=once)["id"]
    path = f"/missions/{mission}"

    def settled():
        return not recorder.client.get(path).json()["searching"]

    def tell(name, **event):
        return recorder.send("POST", f"{path}/events", event, name=name)

    _until(settled)
    recorder.send("POST", "/missions", body, name="the same request once more", headers=once)
    found = recorder.send("GET", f"{path}/proposals")["proposals"][0]["number"]
    accepted = tell("a plan is accepted", type="proposal_accepted", id="yes-1", proposal=found)
    tell("six minutes later", type="clock", id="tick-1", at=0.1)
    seen = {"uav_id": "long-1", "time": 0.15, "x": 34.733, "y": -19.641, "dis": 22.5}
    tell("positions", type="telemetry", id="seen-1", positions=[seen])
    lost = {"type": "uav_lost", "id": "lost-1", "at": 0.2, "uav_id": "mid-2"}
    told = tell("a UAV is lost", **lost)
    tell("the same event once more", **lost)
    _until(settled)
    recorder.send("GET", "/missions", params={"limit": 1})
    for part in ("", "/state", "/plan"):
        recorder.send("GET", path + part)
    recorder.send("GET", f"{path}/events", params={"limit": 3})
    recorder.send(
        "GET", f"{path}/differences", params={"before": accepted["number"], "after": told["number"]}
    )
    replay = recorder.send(
        "GET", f"{path}/replay", cut=lambda each: {**each, **_part(each, "events", most=2)}
    )
    recorder.listen(f"{path}/stream", f"id: {replay['events'][2]['number']}")
    tell("refused", type="uav_lost", id="lost-2", uav_id="mid-7")
    tell("refused", type="clock", id="tick-1", at=0.3)
    tell("refused", type="proposal_accepted", id="yes-2", proposal=found)
    recorder.send("DELETE", path)
    recorder.send("GET", path)


def _refusals(recorder, greedy, answer):
    """Provoke what can be provoked without another service."""
    send, problem, job = recorder.send, _problem_of(greedy), f"/jobs/{answer['job_id']}"
    send("GET", "/nowhere")
    send("PUT", "/allocate")
    send("POST", "/allocate", headers={"Content-Type": "application/json"}, content=b'{"uavs": [')
    send("POST", "/allocate", headers={"Content-Type": "text/plain"}, content=b"{}")
    send("POST", "/allocate", _with(greedy, "uavs", 0, speed=-5))
    send("POST", "/allocate", _with(greedy, "targets", 1, loadlist=[48, 12]))
    send("POST", "/allocate", {**greedy, "algorithm": "luck"})
    send("POST", "/allocate", {**greedy, "algorithm": "ga", "parameters": {"num_total": 1}})
    send("POST", "/allocate", {**greedy, "uavs": greedy["uavs"] * recorder.most("ProblemModel", "uavs")})
    send("POST", "/allocate", {**greedy, "algorithm": "transfer_qmix", "parameters": {"mode": "paper"}})
    send("POST", "/evaluate", {**problem, "assignment": [[0, 0], [2, 2], [3, 3], [1, 1]]})
    send("POST", "/allocate", {**greedy, "seed": 1}, headers={"Idempotency-Key": "beira-recorded"})
    send("POST", "/allocate", {**greedy, "seed": 2}, headers={"Idempotency-Key": "beira-recorded"})
    send("POST", "/allocate/batch", {"problems": [{}] * (recorder.most("BatchRequest", "problems") + 1)})
    send("GET", "/jobs", params={"cursor": "yesterday"})
    send("GET", "/jobs/" + "0" * 32)
    send("GET", f"{job}/plan", params={"format": "qgc-plan", "uav": "mid-7"})
    local = recorder.client.post("/allocate", json={**greedy, "crs": "local"}).json()["job_id"]
    send("GET", f"/jobs/{local}/plan", params={"format": "qgc-plan"})
    slow = _with(greedy, "uavs", 0, speed=2000)
    slow = recorder.client.post("/allocate", json=slow).json()["job_id"]
    send("GET", f"/jobs/{slow}/plan", params={"format": "qgc-plan"})
    nobody = {**greedy, "objective": {"distance_weight": 10}}
    nobody = recorder.client.post("/allocate", json=nobody).json()["job_id"]
    send("GET", f"/jobs/{nobody}/plan", params={"format": "qgc-plan"})
    send("POST", "/library", {"name": "Beira", "job_id": answer["job_id"]})
    send("POST", "/library", {"name": "Beira", "task": problem, "checkpoint": WEIGHTS})
    send("GET", "/library/nothing")
    training = {"name": "Beira", "task": problem, "train": {"parameters": {"n_epochs": 10_000_000}}}
    begun = recorder.client.post("/library", json=training).json()["id"]
    send("GET", f"/jobs/{begun}/plan", params={"format": "csv"})
    recorder.client.delete(f"/jobs/{begun}")
    _until(lambda: recorder.client.get(f"/jobs/{begun}").json()["finished_at"])


def _problem_of(request):
    return {name: value for name, value in request.items() if name != "algorithm"}


def _with(problem, group, number, **fields):
    items = [{**each, **fields} if place == number else each for place, each in enumerate(problem[group])]
    return {**problem, group: items}


def _part(of, *names, most=1):
    return {**of, **{name: of[name][:most] for name in names}}


def _greedy_alone(answer):
    return {"algorithms": [each for each in answer["algorithms"] if each["name"] == "greedy"]}


def _without_progress(job):
    return {**job, "progress": {**job["progress"], "fraction": 0.5}}


def _lines(text):
    return "\n".join(text.splitlines()[:LINES]) + CUT


def _until(found):
    end = time.monotonic() + PATIENCE_S
    while True:
        value = found()
        if value:
            return value
        assert time.monotonic() < end, "it did not come to that"
        time.sleep(0.05)


def main():
    """Record with a service of its own, and write the files."""
    from live_service import LiveService  # noqa: PLC0415 - starts processes

    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=2).start().await_ready()
        try:
            answers, problems = record(httpx.Client(base_url=service.url, timeout=120))
        finally:
            service.stop()
    FOLDER.mkdir(exist_ok=True)
    for name, value in {**answers, "problems": problems}.items():
        text = json.dumps(value, indent=1, ensure_ascii=False) + "\n"
        (FOLDER / f"{name}.json").write_text(text, "utf-8")


if __name__ == "__main__":
    sys.exit(main())
