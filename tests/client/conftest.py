"""A service with keys for all tests of the clients, and both clients of it."""

import asyncio
import inspect
import subprocess
import sys
from pathlib import Path

import pytest
from live_service import SMALL, LiveService

from app.client import AsyncClient, Client

ROOT = Path(__file__).parents[2]


class KeyedService:
    """A service that needs a key, and a key of each role."""

    def __init__(self, folder):
        self.keys = {role: self._new_key(role, folder) for role in ("allocate", "library")}
        self.live = LiveService(folder, workers=2, require_keys=True, **SMALL).start().await_ready()
        self.url, self.port, self.key = self.live.url, self.live.port, self.keys["library"]

    @staticmethod
    def _new_key(role, folder):
        command = [
            "-m",
            "app",
            "keys",
            "create",
            "--role",
            role,
            "--name",
            "tests",
            "--data-dir",
            str(folder),
        ]
        done = subprocess.run(
            [sys.executable, *command], cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
        )
        return done.stdout.strip()


class Waiting:
    """The asynchronous client, waited for: its methods are called as those of the other."""

    def __init__(self, *arguments, **options):
        self._runner = asyncio.Runner()
        self._client = AsyncClient(*arguments, **options)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()

    def close(self):
        self._runner.run(self._client.close())
        self._runner.close()

    def __getattr__(self, name):
        method = getattr(self._client, name)

        def call(*arguments, **options):
            found = method(*arguments, **options)
            return self._items(found) if inspect.isasyncgen(found) else self._runner.run(found)

        return call

    def _items(self, generator):
        async def following():
            return await anext(generator, None)

        async def close():
            await generator.aclose()

        try:
            while (item := self._runner.run(following())) is not None:
                yield item
        finally:
            self._runner.run(close())


@pytest.fixture(scope="session")
def service(tmp_path_factory):
    running = KeyedService(tmp_path_factory.mktemp("data"))
    try:
        yield running
    finally:
        running.live.stop()


@pytest.fixture(params=[Client, Waiting], ids=["waiting", "asynchronous"])
def new_client(request):
    """Makes clients, of one kind and the other."""
    made = []

    def make(*arguments, **options):
        made.append(request.param(*arguments, **options))
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.fixture
def client(new_client, service):
    return new_client(service.url, service.key)


@pytest.fixture(scope="session")
def problem(service):
    with Client(service.url, service.key) as client:
        return client.example("paper-5x10")
