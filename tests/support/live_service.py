"""The service as its operator starts it, in a process of its own that can be killed and started again."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Self

import httpx

ROOT = Path(__file__).parents[2]
SMALL = {"max_uavs": 50, "max_targets": 100}
"""Limits with which workers start sooner: they try how long the largest problem takes."""


def variables(**settings: object) -> dict[str, str]:
    """Return the variables of the environment that set settings, by their names in lower case."""
    return {f"ALLOCATOR_{name.upper()}": str(value) for name, value in settings.items()}


ONE_WORKER = variables(workers=1, **SMALL)
"""Of a service that starts soon."""

_READY_WITHIN_S = 300.0
_ENDS_WITHIN_S = 60.0
_SAMPLE = re.compile(r"^(\w+)(\{.*\})? (\S+)$", re.MULTILINE)


class LiveService:
    """`python -m app serve` on a free port of the loopback interface, which it keeps over restarts.

    Parameters
    ----------
    folder
        Of the database and of the log.
    settings
        By their names in lower case.
    """

    def __init__(self, folder: Path, **settings: object) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self.database = folder / "allocator.sqlite3"
        self.log = folder / "service.log"
        self._environment = {**os.environ, **variables(data_dir=folder, **settings)}
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        """Of the server."""
        assert self._process is not None, "the service was not started"
        return self._process.pid

    def start(self) -> Self:
        """Start it; :meth:`await_ready` waits until it works."""
        arguments = [sys.executable, "-m", "app", "serve", "--port", str(self.port)]
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(arguments, cwd=ROOT, env=self._environment, stderr=log)
        return self

    def await_ready(self, workers: int = 1) -> Self:
        """Wait until so many workers are warm."""
        self._await("/readyz", lambda answer: answer.is_success and answer.json()["workers_ready"] >= workers)
        return self

    def await_alive(self) -> Self:
        """Wait until the server answers; its workers may still be starting."""
        self._await("/healthz", lambda answer: answer.is_success)
        return self

    def _await(self, path: str, holds) -> None:
        end = time.monotonic() + _READY_WITHIN_S
        while True:
            try:
                if holds(httpx.get(self.url + path, timeout=10)):
                    return
            except httpx.TransportError:
                assert self._process is not None
                assert self._process.poll() is None, self.log.read_text()[-2000:]
            if time.monotonic() > end:
                self.kill_all()
                raise AssertionError(f"{path} did not say yes within {_READY_WITHIN_S:g} s")
            threading.Event().wait(0.05)

    def workers(self) -> list[int]:
        """Return the process ids of the workers there are."""
        return workers_of(self.pid)

    def kill(self) -> None:
        """Kill the server as `kill -9` does; its workers notice by themselves."""
        assert self._process is not None
        self._process.kill()
        self._process.wait(_ENDS_WITHIN_S)

    def kill_all(self) -> None:
        """Kill the server and its workers at once."""
        for pid in (*self.workers(), self.pid):
            kill(pid)
        assert self._process is not None
        self._process.wait(_ENDS_WITHIN_S)

    def stop(self) -> int:
        """End it as an operator does, and return its exit status."""
        if self._process is None or self._process.poll() is not None:
            return 0
        self._process.send_signal(signal.SIGTERM)
        return self._process.wait(_ENDS_WITHIN_S)

    def memory_mb(self) -> tuple[float, float]:
        """Return the resident memory of the server, and of all workers together."""
        return _resident_mb(self.pid), sum(map(_resident_mb, self.workers()))

    def metrics(self) -> dict[str, float]:
        """Return the metrics by name and labels, as `allocator_worker_restarts_total`."""
        text = httpx.get(self.url + "/metrics", timeout=30).text
        return {name + labels: float(value) for name, labels, value in _SAMPLE.findall(text)}


def workers_of(pid: int) -> list[int]:
    """Return the workers of a server: what its fork server has forked, and what it spawned."""
    family = [folder for folder in Path("/proc").iterdir() if folder.name.isdigit()]
    children = [folder for folder in family if _parent(folder) == pid]
    servers = {int(folder.name) for folder in children if b"forkserver" in _command(folder)}
    spawned = {int(folder.name) for folder in children if b"spawn_main" in _command(folder)}
    return sorted(spawned | {int(folder.name) for folder in family if _parent(folder) in servers})


def kill(pid: int) -> None:
    """Kill a process, if there still is one."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return


def has_exited(pid: int) -> bool:
    """Say whether a process runs no more; its entry may still wait for its parent."""
    stat = _read(Path(f"/proc/{pid}/stat"))
    return not stat or stat.rpartition(b")")[2].split()[0] in (b"Z", b"X")


def _parent(folder: Path) -> int:
    stat = _read(folder / "stat")
    return int(stat.rpartition(b")")[2].split()[1]) if stat else 0


def _command(folder: Path) -> bytes:
    return _read(folder / "cmdline")


def _resident_mb(pid: int) -> float:
    found = re.search(rb"VmRSS:\s+(\d+) kB", _read(Path(f"/proc/{pid}/status")))
    return int(found[1]) / 1024 if found else 0.0


def _read(file: Path) -> bytes:
    """Read a file of a process; nothing if it has ended."""
    try:
        return file.read_bytes()
    except OSError:
        return b""
