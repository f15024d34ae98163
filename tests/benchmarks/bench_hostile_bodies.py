"""What a body that no route takes costs a server of its own: time to the answer, others' wait, memory.

    PYTHONPATH=tests/support python tests/benchmarks/bench_hostile_bodies.py [--port 9120] [--chunks]

Each kind of ``tests/support/hostile_bodies.py`` is sent to each route that takes a body; meanwhile `/healthz`
is asked every 10 ms over a connection of its own. Processor time and memory are the server's, without its
workers. The last column says how long the longest `/healthz` took. ``--chunks`` sends bodies of one-byte
chunks over some connections instead.
"""

from __future__ import annotations

import argparse
import http.client
import json
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from hostile_bodies import AREAS, hostile_bodies

ROOT = Path(__file__).parents[2]
ROUTES = ("/allocate", "/allocate/batch", "/library", "/library/similar")
_CHUNKED_CONNECTIONS = 8
_TICKS = 100.0
"""Clock ticks a second in /proc."""


class Server:
    """A server with its defaults, on a port and in a folder of its own."""

    def __init__(self, port: int, folder: str) -> None:
        self.port = port
        command = [sys.executable, "-m", "app", "serve", "--port", str(port), "--data-dir", folder]
        self.process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL)
        while True:
            try:
                if ask(port, "/healthz") == 200:
                    return
            except OSError:
                assert self.process.poll() is None, "the server has ended"
                time.sleep(0.1)

    def cpu_s(self) -> float:
        """Processor time so far, without the workers'."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / _TICKS

    def memory_mb(self, what: str = "VmRSS") -> float:
        """Resident memory now, or with ``VmHWM`` the most since :meth:`forget_peak`."""
        for line in Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith(what):
                return int(line.split()[1]) / 1024
        raise AssertionError(what)

    def forget_peak(self) -> None:
        """Begin to measure the peak anew."""
        Path(f"/proc/{self.process.pid}/clear_refs").write_text("5")


def ask(port: int, path: str, body: bytes | None = None) -> int:
    """Return the status of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=120)
    method, headers = ("GET", {}) if body is None else ("POST", {"Content-Type": "application/json"})
    try:
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        answer.read()
        return answer.status
    finally:
        connection.close()


class Watch:
    """Asks for /healthz until it is told to stop."""

    def __init__(self, port: int) -> None:
        self.longest_s, self._port = 0.0, port
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._end.is_set():
            begun = time.perf_counter()
            ask(self._port, "/healthz")
            self.longest_s = max(self.longest_s, time.perf_counter() - begun)
            time.sleep(0.01)


def measure(server: Server, what: str, send: Callable[[], object]) -> None:
    """Send, and print a line of what it cost."""
    server.forget_peak()
    before, cpu = server.memory_mb(), server.cpu_s()
    with Watch(server.port) as watch:
        begun = time.perf_counter()
        status = send()
        took = time.perf_counter() - begun
    peak, used = server.memory_mb("VmHWM") - before, server.cpu_s() - cpu
    cost = f"{took:7.3f} s, cpu {used:6.2f} s, +{peak:5.0f} MB, healthz {watch.longest_s:.3f} s"
    print(f"{what:64} {status} {cost}")


def send_chunks(port: int, count: int) -> str:
    """Send bodies of so many one-byte chunks over several connections at once."""

    def one() -> None:
        with socket.create_connection(("127.0.0.1", port), timeout=120) as connection:
            head = "POST /allocate HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
            try:
                connection.sendall((head + "Transfer-Encoding: chunked\r\n\r\n").encode())
                for _ in range(count // 1000):
                    connection.sendall(b"1\r\n \r\n" * 1000)
                connection.sendall(b"0\r\n\r\n")
                connection.recv(65536)
            except OSError:
                return

    threads = [threading.Thread(target=one) for _ in range(_CHUNKED_CONNECTIONS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return "   "


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=9120)
    parser.add_argument("--sizes", type=int, nargs="+", default=[200_000, 1_200_000, 8_300_000])
    parser.add_argument("--chunks", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options.port, folder)
        try:
            if options.chunks:
                measure(server, "one-byte chunks, 8 connections", lambda: send_chunks(server.port, 150_000))
                return
            for size in options.sizes:
                count = max(1, (size - 80) // 3)
                body = ("{" + AREAS + ',"uavs":[' + ",".join(["{}"] * count) + "]}").encode()
                measure(server, f"the body that killed, {size}", partial(ask, server.port, "/allocate", body))
                for kind, body in hostile_bodies(size):
                    for route in ROUTES:
                        what = f"{kind}, {size}, {route}"
                        measure(server, what, partial(ask, server.port, route, body))
        finally:
            server.process.terminate()
            server.process.wait(60)


if __name__ == "__main__":
    print(json.dumps({"python": sys.version.split()[0]}))
    main()
