"""How late allocations with a time limit come, measured by their client, one at a time or many at once."""

from __future__ import annotations

import http.client
import json
import threading
import time
from dataclasses import dataclass
from typing import Any

_TIMEOUT_S = 180.0


@dataclass(frozen=True, slots=True)
class Answered:
    """What came of a request.

    Attributes
    ----------
    status
        Of HTTP.
    answer
        The allocation, or the problem.
    late_s
        From the first byte that was sent to the last one that came, less the time limit.
    """

    status: int
    answer: dict[str, Any]
    late_s: float

    @property
    def refused(self) -> bool:
        """Whether the algorithm cannot hold the problem."""
        return self.status == 422 and self.answer["type"] == "/docs/errors#problem-too-large"


def ask(port: int, request: dict[str, Any]) -> Answered:
    """Ask for an allocation on this machine, and wait for it; writing the JSON does not count."""
    return _send(http.client.HTTPConnection("127.0.0.1", port, timeout=_TIMEOUT_S), request)


def ask_at_once(port: int, requests: list[dict[str, Any]]) -> list[Answered]:
    """Ask for allocations all at once, each by a connection of its own."""
    answers: list[Answered | None] = [None] * len(requests)
    together = threading.Barrier(len(requests))

    def one(place: int) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_TIMEOUT_S)
        connection.connect()
        answers[place] = _send(connection, requests[place], together)

    threads = [threading.Thread(target=one, args=(place,)) for place in range(len(requests))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [answer for answer in answers if answer is not None]


def _send(
    connection: http.client.HTTPConnection, request: dict[str, Any], together: threading.Barrier | None = None
) -> Answered:
    body = json.dumps(request).encode()
    if together is not None:
        together.wait()
    begun = time.perf_counter()
    connection.request("POST", "/allocate", body, {"Content-Type": "application/json"})
    response = connection.getresponse()
    text = response.read()
    late = time.perf_counter() - begun - request["time_limit_s"]
    connection.close()
    return Answered(response.status, json.loads(text), late)
