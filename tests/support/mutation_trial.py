"""Sends mutated bodies over many connections, and judges every answer."""

from __future__ import annotations

import http.client
import json
import threading
import time
from collections import Counter
from itertools import count
from typing import Any

from mutations import Sent, mutant, sound_bodies

PROBLEM_TYPE = "application/problem+json"
NAMES_FIELDS = frozenset({"invalid-request", "invalid-problem", "invalid-parameters", "problem-too-large"})
"""Problem types that have to say which field is wrong."""

_TIMEOUT_S = 60.0
_LARGE_BYTES = 8 * 1024**2

_IDLE_S = 2.0
"""After so long without a request a new connection is made: the server closes idle ones after 5 s."""


class MutationTrial:
    """What came back.

    Attributes
    ----------
    answers
        By path, status and problem type.
    faults
        Answers that must not be, with the number of their mutant.
    """

    def __init__(self, host: str, port: int, seed: int, paths: list[str]) -> None:
        self.answers: Counter[str] = Counter()
        self.faults: list[str] = []
        self._at = host, port
        self._seed, self._paths, self._sound = seed, paths, sound_bodies()
        self._numbers = count()
        self._lock = threading.Lock()

    def run(self, bodies: int, connections: int) -> None:
        """Send so many over so many connections."""
        shares = [bodies // connections + (each < bodies % connections) for each in range(connections)]
        threads = [threading.Thread(target=self._send, args=(share,)) for share in shares]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _send(self, share: int) -> None:
        connection, used = http.client.HTTPConnection(*self._at, timeout=_TIMEOUT_S), time.monotonic()
        for _ in range(share):
            number = next(self._numbers)
            sent = mutant(self._seed, number, self._paths, self._sound)
            if time.monotonic() - used > _IDLE_S:
                connection.close()
            try:
                status, kind, fault = _exchange(connection, sent)
            except (OSError, http.client.HTTPException) as error:
                connection.close()
                # Who is refused while it still sends may find its connection closed.
                status, kind = "closed", ""
                fault = None if len(sent.body) > _LARGE_BYTES else f"{type(error).__name__}: {error}"
            used = time.monotonic()
            with self._lock:
                self.answers[f"{sent.path} {status} {kind}".strip()] += 1
                if fault:
                    self.faults.append(f"mutant {number} to {sent.path}: {status} {kind}: {fault}")
        connection.close()


def _exchange(connection: http.client.HTTPConnection, sent: Sent) -> tuple[str, str, str | None]:
    headers = {name: value.encode("latin-1", "replace") for name, value in sent.headers.items()}
    connection.request("POST", sent.path, sent.body, headers)  # type: ignore[arg-type]
    response = connection.getresponse()
    body = response.read()
    if response.status == 202:
        job_id = json.loads(body)["id"]
        connection.request("DELETE", f"/jobs/{job_id}")
        connection.getresponse().read()
    if response.status < 300:
        return str(response.status), "", None if json.loads(body) else "an empty answer"
    media = response.getheader("Content-Type", "")
    if media != PROBLEM_TYPE:
        return str(response.status), "", f"it is {media}"
    problem = json.loads(body)
    return str(response.status), problem["type"], _fault(response, problem)


def _fault(response: http.client.HTTPResponse, problem: dict[str, Any]) -> str | None:
    """Say what is wrong with a refusal."""
    if response.status >= 500:
        return f"the service is at fault: {problem['detail']}"
    if not {"type", "title", "status", "detail", "instance"} <= problem.keys():
        return "members are missing"
    if not response.getheader("X-Request-ID"):
        return "no request id"
    if response.status == 429 and not response.getheader("Retry-After"):
        return "no Retry-After"
    if problem["type"].rpartition("#")[2] in NAMES_FIELDS:
        errors = problem.get("errors", [])
        if not errors or not all("pointer" in each and each["detail"] for each in errors):
            return "no field is named"
    return None
