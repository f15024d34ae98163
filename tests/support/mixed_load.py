"""Many clients at once, good and bad ones, each answer counted and each promised job kept in mind."""

from __future__ import annotations

import json
import random
import socket
import threading
from collections import Counter
from collections.abc import Callable
from typing import Any

import httpx
import numpy as np

from app.domain.records import problem_to_record
from app.simulation.generator import FAMILIES, generate

_TIMEOUT_S = 120.0
_LONGEST_PAUSE_S = 5.0
_EXPLAINED = frozenset(
    {"429 queue-full", "409 job-without-checkpoint", "409 job-cancelled", "404 policy-not-found"}
)
"""Refusals that belong to this load: a full queue, jobs that learned nothing, policies deleted meanwhile."""

SIZES = ((3, 5), (5, 10), (10, 20), (20, 30), (50, 100), (100, 300))
_SHORT: dict[str, dict[str, Any]] = {
    "qmix": {"n_epochs": 50, "mode": "paper"},
    "dqn": {"n_epochs": 50},
    "ga": {"iteration": 50},
}


class MixedLoad:
    """What the clients did and were told.

    Attributes
    ----------
    answers
        By request, status and problem type.
    promised
        Ids of all jobs that were acknowledged.
    unexplained
        Answers that no client can be blamed for, one line each.
    """

    def __init__(self, url: str, algorithms: list[str], seed: int) -> None:
        self.answers: Counter[str] = Counter()
        self.promised: set[str] = set()
        self.unexplained: list[str] = []
        self._url, self._algorithms, self._seed = url, algorithms, seed
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._threads: list[threading.Thread] = []

    def start(self, clients: int) -> None:
        """Let so many clients begin."""
        self._threads = [threading.Thread(target=self._client, args=(number,)) for number in range(clients)]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Wait until every client has its last answer."""
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def _client(self, number: int) -> None:
        with httpx.Client(base_url=self._url, timeout=_TIMEOUT_S) as http:
            client = _Client(self, http, random.Random(f"{self._seed}/{number}"), number, self._algorithms)
            while not self._stop.is_set():
                client.act()

    def note(self, request: str, response: httpx.Response) -> None:
        """Count an answer and judge it; who is told to come back later does so."""
        kind = "" if response.status_code < 400 else response.json()["type"].rpartition("#")[2]
        told = f"{response.status_code} {kind}".strip()
        with self._lock:
            self.answers[f"{request}: {told}"] += 1
            later = response.headers.get("Retry-After")
            if response.status_code >= 400 and (
                told not in _EXPLAINED or (told.startswith("429") and not later)
            ):
                self.unexplained.append(f"{request}: {told}: {response.json()['detail'][:200]}")
        if later is not None:
            self._stop.wait(min(float(later), _LONGEST_PAUSE_S))

    def note_failure(self, request: str, error: Exception) -> None:
        """Count a request without an answer, which no client of this load deserves."""
        with self._lock:
            self.answers[f"{request}: {type(error).__name__}"] += 1
            self.unexplained.append(f"{request}: {error!r}")

    def count(self, what: str) -> None:
        """Count what has no answer by intention."""
        with self._lock:
            self.answers[what] += 1

    def promise(self, job_id: str) -> None:
        """Keep a job in mind that was acknowledged."""
        with self._lock:
            self.promised.add(job_id)

    def some_job(self, rng: random.Random) -> str | None:
        """Return a job that was acknowledged."""
        with self._lock:
            return rng.choice(sorted(self.promised)[-200:]) if self.promised else None


class _Client:
    """What one client does; its problems are few, since making and writing them is not what is tried."""

    def __init__(
        self, load: MixedLoad, http: httpx.Client, rng: random.Random, number: int, algorithms: list[str]
    ) -> None:
        self._load, self._http, self._rng, self._algorithms = load, http, rng, algorithms
        families = list(FAMILIES)
        draws = np.random.default_rng(number)
        self._tasks = [
            problem_to_record(generate(families[(number + each) % len(families)], m, n, 3, draws))
            for each, (m, n) in enumerate(SIZES)
        ]
        self._own: list[str] = []
        self._acts: list[tuple[Callable[[], None], int]] = [
            (self._allocate, 12),
            (self._allocate_later, 6),
            (self._look, 6),
            (self._listen, 3),
            (self._cancel, 3),
            (self._drop, 3),
            (self._similar, 3),
            (self._browse, 3),
            (self._register, 1),
            (self._train, 1),
            (self._delete, 1),
            (self._blunder, 2),
        ]

    def act(self) -> None:
        """Do one thing."""
        acts, weights = zip(*self._acts, strict=True)
        act = self._rng.choices(acts, weights)[0]
        try:
            act()
        except httpx.TransportError as error:
            self._load.note_failure(act.__name__, error)

    def _send(self, method: str, path: str, **request: Any) -> httpx.Response:
        response = self._http.request(method, path, **request)
        steps = path.partition("?")[0].split("/")
        # Ids of jobs and of policies are no places of their own here.
        place = "/".join("*" if at == 2 and step != "similar" else step for at, step in enumerate(steps))
        self._load.note(f"{method} {place}", response)
        return response

    def _body(self) -> dict[str, Any]:
        algorithm = self._rng.choice(self._algorithms)
        # A table over all joint actions is for small problems only.
        task = self._tasks[0] if algorithm == "dqn" else self._rng.choices(self._tasks, (4, 6, 5, 4, 2, 1))[0]
        task = (
            {**task, "uavs": task["uavs"][:2], "targets": task["targets"][:4]} if algorithm == "dqn" else task
        )
        limit = self._rng.choice((0.05, 0.2, 0.5, 1.0))
        return {
            **task,
            "algorithm": algorithm,
            "parameters": _SHORT.get(algorithm, {}),
            "time_limit_s": limit,
            "seed": self._rng.randrange(1000),
        }

    def _allocate(self) -> None:
        response = self._send("POST", "/allocate", json=self._body())
        if response.status_code == 200:
            self._load.promise(response.json()["job_id"])

    def _allocate_later(self) -> None:
        headers = {"Prefer": self._rng.choice(("respond-async", "wait=1"))}
        if self._rng.random() < 0.5:
            headers["Idempotency-Key"] = f"{self._rng.random()}"
        body = self._body()
        for _ in range(self._rng.choice((1, 1, 2))):
            response = self._send("POST", "/allocate", json=body, headers=headers)
            if response.is_success:
                answer = response.json()
                self._load.promise(answer["id"] if response.status_code == 202 else answer["job_id"])

    def _look(self) -> None:
        if (job_id := self._load.some_job(self._rng)) is not None:
            self._send("GET", f"/jobs/{job_id}")

    def _listen(self) -> None:
        """Listen to a job to its end, or go in the midst of it."""
        if (job_id := self._load.some_job(self._rng)) is None:
            return
        patience = self._rng.choice((1, 3, 10_000))
        with self._http.stream("GET", f"/jobs/{job_id}/events") as events:
            for seen, _line in enumerate(events.iter_lines()):
                if seen >= patience:
                    break
        self._load.count(f"events: {events.status_code}")

    def _cancel(self) -> None:
        if (job_id := self._load.some_job(self._rng)) is not None:
            self._send("DELETE", f"/jobs/{job_id}")

    def _drop(self) -> None:
        """Hang up in the midst of a request, or while its answer is worked on."""
        body = json.dumps(self._body()).encode()
        lines = "POST /allocate HTTP/1.1", "Host: localhost", "Content-Type: application/json"
        whole = "\r\n".join((*lines, f"Content-Length: {len(body)}", "", "")).encode() + body
        share = self._rng.choice((0.0, 0.01, 0.5, 1.0))
        url = self._http.base_url
        with socket.create_connection((url.host, url.port or 80), timeout=_TIMEOUT_S) as connection:
            connection.sendall(whole[: int(share * len(whole))])
        self._load.count("hung up")

    def _similar(self) -> None:
        self._send("POST", "/library/similar", json={"task": self._rng.choice(self._tasks), "k": 3})

    def _browse(self) -> None:
        listed = self._send(
            "GET", self._rng.choice(("/library?limit=5", "/jobs?limit=50", "/readyz", "/algorithms"))
        )
        if (
            policies := listed.json().get("policies")
            if isinstance(listed.json().get("policies"), list)
            else None
        ):
            policy = self._rng.choice(policies)["id"]
            self._send(
                "GET", f"/library/{policy}" if self._rng.random() < 0.5 else f"/library/{policy}/checkpoint"
            )

    def _register(self) -> None:
        if (job_id := self._load.some_job(self._rng)) is not None:
            response = self._send("POST", "/library", json={"name": "load", "job_id": job_id})
            if response.status_code == 201:
                self._own.append(response.json()["id"])

    def _train(self) -> None:
        train = {"algorithm": "qmix", "parameters": {"mode": "paper", "n_epochs": 20}}
        response = self._send(
            "POST", "/library", json={"name": "load", "task": self._tasks[0], "train": train}
        )
        if response.status_code == 202:
            self._load.promise(response.json()["id"])

    def _delete(self) -> None:
        if self._own:
            self._send("DELETE", f"/library/{self._own.pop()}")

    def _blunder(self) -> None:
        """Send what is refused; that it is refused with 4xx is what is counted."""
        body = self._rng.choice((b"{", b'{"uavs": []}', b"[" * 5000, b'{"uavs": NaN}'))
        response = self._http.post("/allocate", content=body, headers={"Content-Type": "application/json"})
        kind = response.json()["type"].rpartition("#")[2]
        self._load.count(f"nonsense: {response.status_code} {kind}")
        if response.status_code not in (400, 422):
            self._load.note("nonsense", response)
