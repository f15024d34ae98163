"""Clients that send their requests byte by byte: do they delay the others?

    python tests/benchmarks/bench_slow_senders.py [--senders 64] [--requests 200]

The senders keep their connections open and send a byte of an allocation now and then, some of the request
line, some of the headers, some of the body; who is closed for it comes again. Meanwhile another client asks
for `greedy` on 5x10, one request at a time, in turns with and without the senders. Printed is what it waits.
The exit status is 1 if one of its requests is not answered by 200, or if no sender was closed in the end.
"""

from __future__ import annotations

import argparse
import contextlib
import http.client
import json
import random
import socket
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from live_service import LiveService  # noqa: E402

from app.domain.records import problem_to_record  # noqa: E402
from app.simulation.generator import generate  # noqa: E402

RECEIVE_TIMEOUT_S = 4.0
BYTE_EVERY_S = 0.25
ROUNDS = 4


class SlowSenders:
    """So many connections at a time, each with a request that does not end.

    Attributes
    ----------
    closed
        How many were closed by the service.
    """

    def __init__(self, port: int, count: int, whole: bytes) -> None:
        self.closed = 0
        self._port, self._whole = port, whole
        self._stop, self._lock = threading.Event(), threading.Lock()
        self._threads = [threading.Thread(target=self._send, args=(number,)) for number in range(count)]

    def start(self) -> None:
        """Open the connections."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Close them."""
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def _send(self, number: int) -> None:
        rng = random.Random(number)
        while not self._stop.is_set():
            with socket.create_connection(("127.0.0.1", self._port), timeout=60) as connection:
                connection.sendall(self._whole[: rng.choice((1, 10, 60, 300))])
                sent = 300
                with contextlib.suppress(OSError):
                    while not self._stop.wait(BYTE_EVERY_S):
                        connection.sendall(self._whole[sent : sent + 1])
                        sent += 1
                        connection.setblocking(False)
                        with contextlib.suppress(BlockingIOError):
                            connection.recv(65536)
                            break
                        connection.setblocking(True)
            if not self._stop.is_set():
                with self._lock:
                    self.closed += 1


def main() -> int:
    """Print what the other client waits, with and without the senders."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--senders", type=int, default=64)
    parser.add_argument("--requests", type=int, default=200)
    given = parser.parse_args()
    problem = problem_to_record(generate("uniform", 5, 10, 3, np.random.default_rng(1)))
    body = json.dumps({**problem, "algorithm": "greedy"}).encode()
    head = "POST /allocate HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n"
    whole = f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body
    waits: dict[bool, list[float]] = {False: [], True: []}
    closed = failed = 0
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=2, receive_timeout_s=RECEIVE_TIMEOUT_S)
        try:
            service.start().await_ready(workers=2)
            for number in range(2 * ROUNDS):
                senders = SlowSenders(service.port, given.senders if number % 2 else 0, whole)
                senders.start()
                time.sleep(0.5)
                connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=60)
                for _ in range(given.requests // ROUNDS):
                    begun = time.perf_counter()
                    connection.request("POST", "/allocate", body, {"Content-Type": "application/json"})
                    answer = connection.getresponse()
                    answer.read()
                    waits[bool(number % 2)].append(1000 * (time.perf_counter() - begun))
                    failed += answer.status != 200
                if number % 2:
                    time.sleep(RECEIVE_TIMEOUT_S)
                senders.stop()
                closed += senders.closed
        finally:
            service.stop()
    print(f"{'slow senders':>14} {'p50 ms':>8} {'p95 ms':>8} {'max ms':>8}")
    for slow, each in waits.items():
        cuts = statistics.quantiles(each, n=100, method="inclusive")
        print(f"{given.senders if slow else 0:>14} {cuts[49]:>8.1f} {cuts[94]:>8.1f} {max(each):>8.1f}")
    print(f"\nsenders closed after {RECEIVE_TIMEOUT_S:g} s: {closed}; requests not answered by 200: {failed}")
    return 1 if failed or not closed else 0


if __name__ == "__main__":
    sys.exit(main())
