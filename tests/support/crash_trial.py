"""Clients that write down what they were promised while the service is killed, and the reckoning after it."""

from __future__ import annotations

import random
import sqlite3
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import httpx
import numpy as np
from answers import but_for_reasons
from live_service import LiveService, has_exited, kill

from app.domain.records import problem_to_record
from app.simulation.generator import FAMILIES, generate

KINDS = ("server", "worker", "both")
"""Who is killed: the server alone, one worker, or the server with all of its workers."""

_FINAL = frozenset({"succeeded", "failed", "cancelled"})
_SETTLES_WITHIN_S = 900.0
_CLIENT_TIMEOUT_S = 30.0
_PAUSE_S = 0.1


class Ledger:
    """What clients were told, and where it was broken.

    Attributes
    ----------
    promised
        By the id of every job that a client was told of with 200, 201 or 202: how it was asked for.
    broken
        Promises that were not kept, one line each.
    answered
        Responses by status and problem type; lost connections as ``no answer``.
    """

    def __init__(self) -> None:
        self.promised: dict[str, str] = {}
        self.broken: list[str] = []
        self.answered: Counter[str] = Counter()
        self._cancelled: set[str] = set()
        self._of_key: dict[str, str] = {}
        self._final: dict[str, dict[str, Any]] = {}
        self._lock = threading.Lock()

    def answer(self, text: str) -> None:
        """Count a response."""
        with self._lock:
            self.answered[text] += 1

    def promise(self, job_id: str, how: str, key: str | None = None) -> None:
        """Write down a job, and that its key belongs to it alone."""
        with self._lock:
            self.promised.setdefault(job_id, how)
            if key is not None and self._of_key.setdefault(key, job_id) != job_id:
                self.broken.append(f"key {key} gave job {self._of_key[key]} and job {job_id}")

    def cancel(self, job_id: str) -> None:
        """Write down that a job was promised to be cancelled."""
        with self._lock:
            self._cancelled.add(job_id)

    def read(self, job: dict[str, Any]) -> None:
        """Compare a finished job with how it was when it was read first.

        Reasons for unmet needs that its time limit left no room for come after its end.
        """
        seen = {name: job[name] for name in ("status", "result", "error")}
        if seen["result"] is not None:
            seen["result"] = but_for_reasons(seen["result"])
        with self._lock:
            if self._final.setdefault(job["id"], seen) != seen:
                self.broken.append(f"job {job['id']} has changed after its end")
            if job["id"] in self._cancelled and job["status"] != "cancelled":
                self.broken.append(f"job {job['id']} was to be cancelled and has {job['status']}")

    def answered_with(self, job_id: str, result: dict[str, Any]) -> None:
        """Compare the answer that a waiting caller got with the job."""
        self.read({"id": job_id, "status": "succeeded", "result": result, "error": None})

    def some(self, rng: random.Random) -> str | None:
        """Return a job that was promised, one of the last mostly."""
        with self._lock:
            known = list(self.promised)
        return rng.choice(known[-20:] if rng.random() < 0.7 else known) if known else None


class _Client:
    """One client: sends what comes to its mind, and repeats with the same key what got no answer."""

    def __init__(self, url: str, ledger: Ledger, seed: int, stop: threading.Event) -> None:
        self._http = httpx.Client(base_url=url, timeout=_CLIENT_TIMEOUT_S)
        self._ledger = ledger
        self._rng = random.Random(seed)
        self._stop = stop
        self._prefix = f"client-{seed}"
        self._keyed: list[tuple[str, dict[str, Any]]] = []
        self._tasks = [_task(seed, number) for number in range(12)]
        self._actions: tuple[tuple[Callable[[], None], int], ...] = (
            (self._allocate, 8),
            (self._allocate_later, 8),
            (self._allocate_with_key, 6),
            (self._cancel, 3),
            (self._look, 6),
            (self._train, 1),
            (self._register, 2),
        )

    def run(self) -> None:
        """Go on until told to stop."""
        actions, weights = zip(*self._actions, strict=True)
        with self._http:
            while not self._stop.is_set():
                self._rng.choices(actions, weights)[0]()

    def _send(self, method: str, path: str, **request: Any) -> httpx.Response | None:
        """Send a request; None without an answer."""
        try:
            response = self._http.request(method, path, **request)
        except httpx.TransportError:
            self._ledger.answer("no answer")
            self._stop.wait(_PAUSE_S)
            return None
        kind = "" if response.is_success else f" {response.json()['type']}"
        self._ledger.answer(f"{response.status_code}{kind}")
        if response.status_code in (429, 503):
            self._stop.wait(_PAUSE_S)
        return response

    def _body(self) -> dict[str, Any]:
        algorithm, parameters = self._rng.choice(
            [
                ("greedy", {}),
                ("ga", {"iteration": 50}),
                ("local_search", {}),
                ("transfer_qmix", {"n_epochs": 1, "samples": 4}),
                ("qmix", {"mode": "paper", "n_epochs": self._rng.choice([5, 100, 1000])}),
            ]
        )
        limit = self._rng.choice([0.2, 0.5, 1.0, 2.0])
        task = self._rng.choice(self._tasks)
        return {**task, "algorithm": algorithm, "parameters": parameters, "time_limit_s": limit}

    def _allocate(self) -> None:
        response = self._send("POST", "/allocate", json=self._body())
        if response is not None and response.status_code == 200:
            result = response.json()
            self._ledger.promise(result["job_id"], "allocate")
            self._ledger.answered_with(result["job_id"], result)

    def _allocate_later(self) -> None:
        prefer = self._rng.choice(["respond-async", "wait=0", "wait=1"])
        self._accept(self._send("POST", "/allocate", json=self._body(), headers={"Prefer": prefer}), "async")

    def _allocate_with_key(self) -> None:
        if self._keyed and self._rng.random() < 0.4:
            key, body = self._rng.choice(self._keyed)
        else:
            key, body = f"{self._prefix}-{len(self._keyed)}", self._body()
            self._keyed.append((key, body))
        headers = {"Prefer": "respond-async", "Idempotency-Key": key}
        response = None
        while response is None and not self._stop.is_set():
            response = self._send("POST", "/allocate", json=body, headers=headers)
        self._accept(response, "key", key)

    def _accept(self, response: httpx.Response | None, how: str, key: str | None = None) -> None:
        if response is not None and response.is_success:
            answer = response.json()
            self._ledger.promise(answer["id"] if response.status_code == 202 else answer["job_id"], how, key)

    def _train(self) -> None:
        train = {"algorithm": "qmix", "parameters": {"mode": "paper", "n_epochs": self._rng.choice([5, 50])}}
        body = {"name": self._prefix, "task": self._rng.choice(self._tasks), "train": train}
        self._accept(self._send("POST", "/library", json=body), "train")

    def _register(self) -> None:
        """Register what a job has learned; that it has learned nothing is an answer too."""
        if (job_id := self._ledger.some(self._rng)) is not None:
            self._send("POST", "/library", json={"name": self._prefix, "job_id": job_id})

    def _cancel(self) -> None:
        if (job_id := self._ledger.some(self._rng)) is not None:
            response = self._send("DELETE", f"/jobs/{job_id}")
            if response is not None and response.status_code == 202:
                self._ledger.cancel(job_id)

    def _look(self) -> None:
        if (job_id := self._ledger.some(self._rng)) is None:
            return
        response = self._send("GET", f"/jobs/{job_id}")
        if response is None:
            return
        if response.status_code != 200:
            self._ledger.broken.append(f"job {job_id} was promised and answers {response.status_code}")
        elif response.json()["status"] in _FINAL:
            self._ledger.read(response.json())


@contextmanager
def load(service: LiveService, ledger: Ledger, clients: int, seed: int) -> Iterator[None]:
    """Let so many clients work while the block runs."""
    stop = threading.Event()
    threads = [
        threading.Thread(target=_Client(service.url, ledger, 1000 * seed + number, stop).run)
        for number in range(clients)
    ]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        for thread in threads:
            thread.join()


def crash(service: LiveService, kind: str, rng: random.Random, after_s: float) -> None:
    """Kill as the kind says after some seconds, and bring the service back on the same database.

    Sometimes it is not waited for the workers to be warm: the next one is then killed as it starts.
    """
    time.sleep(rng.uniform(0.0, after_s))
    if kind == "worker":
        if workers := service.workers():
            kill(rng.choice(workers))
        return
    workers = service.workers()
    if kind == "both":
        service.kill_all()
    else:
        service.kill()
    await_exits(workers)
    service.start().await_alive()
    if rng.random() < 0.8:
        service.await_ready()


def await_exits(pids: Sequence[int]) -> None:
    """Wait until processes have ended, as workers do whose server is dead."""
    end = time.monotonic() + _CLIENT_TIMEOUT_S
    while not all(map(has_exited, pids)):
        assert time.monotonic() < end, "workers outlive their server"
        time.sleep(0.01)


def reckon(service: LiveService, ledger: Ledger) -> Counter[str]:
    """Wait until every promised job has ended, read it, stop the service, and look into its database.

    Returns
    -------
    Counter
        How the promised jobs ended; what was broken is in the ledger.
    """
    ends: Counter[str] = Counter()
    with httpx.Client(base_url=service.url, timeout=_CLIENT_TIMEOUT_S) as http:
        patience = time.monotonic() + _SETTLES_WITHIN_S
        for job_id in ledger.promised:
            job = _ended(http, job_id, patience)
            if job is None:
                ledger.broken.append(f"job {job_id} ({ledger.promised[job_id]}) has not ended")
                continue
            ledger.read(job)
            ends[job["status"] if job["error"] is None else f"failed: {job['error']['type']}"] += 1
            if fault := _fault(job):
                ledger.broken.append(f"job {job_id} {fault}")
    service.stop()
    ledger.broken += database_faults(service)
    return ends


def _ended(http: httpx.Client, job_id: str, patience: float) -> dict[str, Any] | None:
    while True:
        response = http.get(f"/jobs/{job_id}")
        if response.status_code != 200:
            return None
        job: dict[str, Any] = response.json()
        if job["status"] in _FINAL:
            return job
        if time.monotonic() > patience:
            return None
        time.sleep(0.05)


def _fault(job: dict[str, Any]) -> str | None:
    """Say what a finished job lacks."""
    if job["status"] == "succeeded" and not (job["result"] or {}).get("assignment"):
        return "has succeeded without a plan"
    if job["status"] == "failed" and not (job["error"] and job["error"]["detail"]):
        return "has failed without a reason"
    if job["status"] == "failed" and job["error"]["type"] != "/docs/errors#worker-lost":
        return f"has failed with {job['error']['type']}: {job['error']['detail']}"
    return None


def database_faults(service: LiveService) -> list[str]:
    """Look for damage, for jobs that have not ended, and for policies that were registered twice."""
    faults = []
    with sqlite3.connect(service.database) as connection:
        (integrity,) = connection.execute("PRAGMA integrity_check").fetchone()
        if integrity != "ok":
            faults.append(f"integrity check: {integrity}")
        if broken := connection.execute("PRAGMA foreign_key_check").fetchall():
            faults.append(f"{len(broken)} references to nothing")
        marks = ",".join("?" * len(_FINAL))
        query = f"SELECT count(*) FROM jobs WHERE status NOT IN ({marks})"
        if (open_jobs := connection.execute(query, [*_FINAL]).fetchone()[0]) != 0:
            faults.append(f"{open_jobs} jobs have not ended in the table")
        registered = connection.execute(
            "SELECT count(*) FROM jobs WHERE kind IN ('train', 'register') AND status = 'succeeded'"
        ).fetchone()[0]
        policies = connection.execute("SELECT count(*) FROM policies WHERE name LIKE 'client-%'").fetchone()[
            0
        ]
        if policies != registered:
            faults.append(f"{registered} registrations have succeeded, {policies} policies are there")
    connection.close()
    return faults


def _task(seed: int, number: int) -> dict[str, Any]:
    rng = np.random.default_rng([seed, number])
    m, n, k = (int(size) for size in rng.integers((3, 4, 1), (9, 13, 4)))
    return problem_to_record(generate(list(FAMILIES)[number % len(FAMILIES)], m, n, k, rng))
