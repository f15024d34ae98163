"""Services for the tests of this folder, with small limits: one with two workers for all, and others.

One takes more than ten seconds of a core to start. A test that needs another setting, or ends its service,
takes one that is there already if it can: `narrow` for one worker, the lives of `test_restarts.py` for ends.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from app.api.openapi_examples import example_problem

ROOT = Path(__file__).parents[2]
LIMITS = {
    "max_uavs": 40,
    "max_targets": 50,
    "max_materials": 8,
    "max_body_bytes": 250_000,
    "max_checkpoint_bytes": 150_000,
    "queue_limit": 2,
    "job_grace_s": 5.0,
    "shutdown_grace_s": 0.2,
}
READY_WITHIN_S = 300


class Service:
    """A running service and a client of it."""

    def __init__(self, data_dir: Path, workers: int = 2, **settings: object) -> None:
        arguments = {"data_dir": str(data_dir), "workers": workers, **LIMITS, **settings}
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("service_process.py")), json.dumps(arguments)],
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])},
        )
        assert self.process.stdout is not None
        port = int(self.process.stdout.readline())
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60)

    def await_ready(self) -> "Service":
        end = time.monotonic() + READY_WITHIN_S
        while True:
            try:
                answer = self.client.get("/readyz")
            except httpx.TransportError:
                assert self.process.poll() is None, "the service has ended"
                answer = None
            if answer is not None and answer.status_code == 200:
                return self
            assert time.monotonic() < end, "the service did not become ready"
            threading.Event().wait(0.05)

    def stop(self, how: signal.Signals = signal.SIGTERM) -> int:
        self.client.close()
        self.process.send_signal(how)  # does nothing if it has ended
        code = self.process.wait(30)
        self.process.stdout.close()
        return code


@pytest.fixture(scope="session")
def service(tmp_path_factory):
    running = Service(tmp_path_factory.mktemp("data"))
    try:
        yield running.await_ready()
    finally:
        running.stop()


@pytest.fixture(scope="session")
def narrow(tmp_path_factory):
    """A service with one worker, small batches, and places for all that Schemathesis asks for.

    Its source policies may be gone.
    """
    running = Service(tmp_path_factory.mktemp("narrow"), workers=1, queue_limit=64, batch_limit=3)
    try:
        yield running.await_ready()
    finally:
        running.stop()


@contextmanager
def starting(folder):
    """Start services on one data folder, and end those that have not ended before."""
    started = []

    def start(**settings):
        started.append(Service(folder, **settings))
        return started[-1]

    try:
        yield start
    finally:
        for each in started:
            each.stop()


@pytest.fixture
def start_service(tmp_path):
    """Starts services for one test."""
    with starting(tmp_path) as start:
        yield start


@pytest.fixture(scope="module")
def data_folder(tmp_path_factory):
    """The data folder of the services of a module."""
    return tmp_path_factory.mktemp("data")


@pytest.fixture(scope="module")
def start_for_module(data_folder):
    """Starts services for all tests of a module."""
    with starting(data_folder) as start:
        yield start


@pytest.fixture
def client(service):
    return service.client


@pytest.fixture
def problem():
    return example_problem("paper-5x10")


def finished(client: httpx.Client, job_id: str) -> dict:
    """Follow a job by its event stream to its end, and return it."""
    with client.stream("GET", f"/jobs/{job_id}/events") as stream:
        for _ in stream.iter_lines():
            pass
    job = client.get(f"/jobs/{job_id}").json()
    assert job["status"] in ("succeeded", "failed", "cancelled")
    return job


@pytest.fixture
def follow(client):
    return lambda job_id: finished(client, job_id)
