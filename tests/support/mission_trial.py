"""Random days of missions on a service that is killed in between, and the reckoning after each."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import httpx
import numpy as np
from crash_trial import await_exits
from live_service import LiveService
from mission_days import Day, require_sound
from problems import random_plan, random_problem
from referee import Illegal
from worlds import random_loading, random_sorties, random_world

from app.domain.errors import IllegalPlan
from app.domain.records import problem_to_record
from app.jobs.worker import WorkContext
from app.missions import judging
from app.missions.state import MissionState, routes_of

_DRAWS = (random_problem, random_world, random_sorties, random_loading)
_SETTLES_WITHIN_S = 600.0
_PAUSE_S = 0.05
_CONTEXT = WorkContext.in_process(lambda _progress: None)


@dataclass
class Reckoning:
    """What days came to.

    Attributes
    ----------
    told
        Events by type that were acknowledged.
    refused
        Events by the problem's type that were refused.
    kills
        How often the service was killed.
    plans
        Plans in force that the referee has replayed.
    broken
        What did not hold, a line each.
    """

    told: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    kills: int = 0
    plans: int = 0
    broken: list[str] = field(default_factory=list)


class Trial:
    """One day on a service.

    Parameters
    ----------
    service
        It is started, and is left running.
    seed
        Of the problem, the events, and the kills.
    reckoning
        Where it is written down.
    """

    def __init__(self, service: LiveService, seed: int, reckoning: Reckoning) -> None:
        self._service, self._reckoning, self._seed = service, reckoning, seed
        self._rng, self._kills = np.random.default_rng(seed), random.Random(seed)
        self._http = httpx.Client(base_url=service.url, timeout=60)
        self._acknowledged: dict[str, dict[str, Any]] = {}

    def run(self, events: int, kills: int) -> None:
        """Let so many events happen, with so many kills among them, and hold the history against them."""
        body, pace = self._drawn()
        mission = f"/missions/{self._send('POST', '/missions', body)['id']}"
        day, fatal = Day(self._rng, pace), set(self._kills.sample(range(events), min(kills, events)))
        for number in range(events):
            now = self._send("GET", mission)
            event = day.event(now["state"], {}) | {"id": f"event-{number}"}
            if event["type"] == "telemetry":
                event.pop("at")
            self._tell(mission, event, number in fatal)
        self._settle(mission)
        self._hold(self._send("GET", f"{mission}/replay"), self._send("GET", f"{mission}/plan"))
        self._send("DELETE", mission)
        self._http.close()

    def _drawn(self) -> tuple[dict[str, Any], float]:
        """Draw a problem with a plan that the service takes, and how to plan it."""
        draw = _DRAWS[self._seed % len(_DRAWS)]
        while True:
            problem = draw(self._rng)
            plan = random_plan(problem, self._rng).assignment
            tried = replace(problem, start_plan=plan)
            record = problem_to_record(tried)
            try:
                judging.begin({"problem": record}, _CONTEXT)
            except IllegalPlan:
                continue  # a plan of greedy unloading, which planned amounts forbid
            break
        across = problem.extent / float(np.median([uav.speed for uav in problem.uavs]))
        plans = "automatic" if self._seed % 3 else "proposed"
        how = {"algorithm": "local_search", "parameters": {"moves": 300}, "time_limit_s": 0.3, "plans": plans}
        return {"problem": record, **how}, across / 8

    def _send(self, method: str, path: str, body: Any = None) -> dict[str, Any]:
        """Send a request until it is answered with success; a service that is killed comes again."""
        answer = self._answer(method, path, body)
        assert answer.is_success, answer.text
        return answer.json() if answer.content else {}

    def _answer(self, method: str, path: str, body: Any) -> httpx.Response:
        end = time.monotonic() + _SETTLES_WITHIN_S
        while True:
            try:
                answer = self._http.request(method, path, json=body)
                if answer.status_code != 503:
                    return answer
            except httpx.TransportError:
                pass
            assert time.monotonic() < end, f"{method} {path} is not answered"
            time.sleep(_PAUSE_S)

    def _tell(self, mission: str, event: dict[str, Any], fatal: bool) -> None:
        """Tell an event, maybe while the service is killed; then it is told once more with its id."""
        if not fatal:
            self._told(event, self._answer("POST", f"{mission}/events", event))
            return
        before, known = self._send("GET", mission), dict(self._acknowledged)
        killer = threading.Thread(target=self._kill, args=(self._kills.uniform(0.0, 0.1),))
        killer.start()
        with suppress(httpx.TransportError):  # whether it was kept is not known: it comes again
            self._told(event, self._http.post(f"{mission}/events", json=event))
        killer.join()
        after = self._send("GET", mission)
        if after["state_number"] == before["state_number"] and after["state"] != before["state"]:
            self._reckoning.broken.append(f"day {self._seed}: a state has changed by a restart")
        for each in known:
            if after["last_number"] < self._acknowledged[each]["number"]:
                self._reckoning.broken.append(f"day {self._seed}: event {each} was lost")
        self._told(event, self._answer("POST", f"{mission}/events", event))

    def _told(self, event: dict[str, Any], answer: httpx.Response) -> None:
        if not answer.is_success:
            problem = answer.json()
            self._reckoning.refused[f"{event['type']}: {problem['type']}"] += 1
            if problem["status"] >= 500:
                self._reckoning.broken.append(f"day {self._seed}: {problem['detail']}")
            return
        told = answer.json()
        known = self._acknowledged.setdefault(event["id"], told)
        if known != told:
            self._reckoning.broken.append(f"day {self._seed}: event {event['id']} was answered twice")
        self._reckoning.told[event["type"]] += known is told

    def _kill(self, after_s: float) -> None:
        time.sleep(after_s)
        workers = self._service.workers()
        self._service.kill()
        await_exits(workers)
        self._reckoning.kills += 1
        self._service.start().await_alive()

    def _settle(self, mission: str) -> None:
        end = time.monotonic() + _SETTLES_WITHIN_S
        while self._send("GET", mission)["searching"]:
            assert time.monotonic() < end, "the search does not end"
            time.sleep(_PAUSE_S)

    def _hold(self, replay: dict[str, Any], plan: dict[str, Any]) -> None:
        """Hold the history against what was acknowledged, and against a day without kills."""
        broken, about = self._reckoning.broken, f"day {self._seed}"
        numbers = [each["number"] for each in replay["events"]]
        if numbers != list(range(1, len(numbers) + 1)):
            broken.append(f"{about}: numbers have gaps")
        kept = {each["id"]: each for each in replay["events"] if each["id"] is not None}
        if len(kept) != sum(each["id"] is not None for each in replay["events"]):
            broken.append(f"{about}: an event is there twice")
        for event_id, told in self._acknowledged.items():
            found = {name: value for name, value in kept.get(event_id, {}).items() if name != "state"}
            if found != told:
                broken.append(f"{about}: event {event_id} is not as it was acknowledged")
        for number, state, in_force in rebuilt(replay):
            if state != replay["events"][number - 1]["state"]:
                broken.append(f"{about}: the state after event {number} is not that of the events")
                return
            try:
                require_sound(state, in_force, replay["problem"].get("matrices"))
            except (Illegal, AssertionError) as fault:
                broken.append(f"{about}: the plan after event {number}: {fault!r}")
            self._reckoning.plans += 1
        if plan["assignment"] != state["problem"]["start_plan"]:
            broken.append(f"{about}: the plan in force is not that of the state")


def rebuilt(replay: dict[str, Any]) -> Any:
    """Yield number, state and plan of every event that makes one, worked out of problem and events anew."""
    matrices = replay["problem"].get("matrices")
    proposals = {each["number"]: each for each in replay["proposals"]}
    made = judging.begin({"problem": replay["problem"]}, _CONTEXT).result
    states, positions = {1: made["state"]}, {}
    yield 1, made["state"], made["plan"]
    for entry in replay["events"][1:]:
        event = entry["event"]
        if event["type"] == "telemetry":
            for each in event["positions"]:
                known = positions.get(each["uav_id"], {}).get("time", -1.0)
                if each["time"] > known:
                    positions[each["uav_id"]] = each | {"new": True}
        elif entry["state"] is not None:
            content = None
            if event["type"] == "proposal_accepted":
                found = proposals[event["proposal"]]
                state = states[found["of_number"]]
                problem = MissionState.from_record(state, matrices).problem
                stops = [[s.to_record() for s in r] for r in routes_of(problem, found["assignment"])]
                content = {"stops": stops, "done": len(state["done"])}
            seen = {uav_id: each for uav_id, each in positions.items() if each.pop("new", False)}
            made = judging.apply(
                {
                    "state": made["state"],
                    "matrices": matrices,
                    "event": event,
                    "at": entry["at"],
                    "positions": seen,
                    "proposal": content,
                },
                _CONTEXT,
            ).result
            states[entry["number"]] = made["state"]
            yield entry["number"], made["state"], made["plan"]
