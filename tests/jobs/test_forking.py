"""Workers that are forked from one process, which has loaded what they need."""

import asyncio
import os
import signal
import subprocess
import sys
import threading
from multiprocessing import forkserver

import pytest
from harness import PATIENCE_S, eventually
from live_service import has_exited, workers_of

from app.jobs.local import LocalExecutor

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux only")


@pytest.fixture(autouse=True)
def own_fork_server():
    forkserver._forkserver._stop()
    yield
    forkserver._forkserver._stop()


async def asked(executor):
    """What a free worker tells of itself."""
    work = executor.submit("forked_from:where", {}, time_left_s=None, on_progress=lambda _progress: None)
    return (await work.outcome()).work.result


async def ready(executor):
    await executor.start(lambda: None)
    await eventually(lambda: executor.ready == executor.capacity)


def test_workers_have_what_was_loaded_once_and_so_has_one_that_replaces_another():
    async def scenario():
        executor = LocalExecutor(2, preload="forked_from")
        await ready(executor)
        first, second = await asyncio.gather(asked(executor), asked(executor))
        assert len({first["pid"], second["pid"], first["loaded_in"], os.getpid()}) == 4
        os.kill(first["pid"], signal.SIGKILL)
        await eventually(lambda: executor.restarts == 1 and executor.ready == 2)
        later = await asyncio.gather(asked(executor), asked(executor))
        assert {each["loaded_in"] for each in [second, *later]} == {first["loaded_in"]}
        assert first["pid"] not in [each["pid"] for each in later]
        await executor.close()

    asyncio.run(scenario())


def test_a_forked_worker_has_the_environment_of_its_executor():
    async def scenario():
        for told in ("first", "second"):
            executor = LocalExecutor(1, preload="forked_from", environment={"TOLD": told})
            await ready(executor)
            assert (await asked(executor))["told"] == told
            await executor.close()
        assert "TOLD" not in os.environ

    asyncio.run(scenario())


def test_workers_start_where_there_is_nothing_to_load():
    async def scenario():
        executor = LocalExecutor(1, preload="no_such_module")
        await ready(executor)
        assert (await asked(executor))["loaded_in"] == (await asked(executor))["pid"]
        await executor.close()

    asyncio.run(scenario())


def test_workers_end_with_a_service_that_is_killed():
    program = """
import asyncio, sys
from app.jobs.local import LocalExecutor
async def main():
    executor = LocalExecutor(2, preload="forked_from")
    await executor.start(lambda: None)
    while executor.ready < 2:
        await asyncio.sleep(0.01)
    print(*(worker.name for worker in executor.free._queue), flush=True)
    await asyncio.sleep(600)
asyncio.run(main())
"""
    path = os.pathsep.join(sys.path)
    with subprocess.Popen(
        [sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE
    ) as service:
        workers = [int(pid) for pid in service.stdout.readline().split()]
        assert len(workers) == 2
        assert sorted(workers) == workers_of(service.pid)
        service.kill()

    async def all_end():
        await eventually(lambda: all(has_exited(pid) for pid in workers))

    asyncio.run(all_end())


def test_closing_does_not_wait_for_what_is_being_loaded(tmp_path):
    gate = tmp_path / "gate"

    async def scenario():
        executor = LocalExecutor(2, preload="forked_from", environment={"GATE": str(gate)})
        await executor.start(lambda: None)
        await eventually(lambda: forkserver._forkserver._forkserver_pid is not None)
        await asyncio.wait_for(executor.close(), PATIENCE_S)
        assert starting()

    def starting():
        return [thread for thread in threading.enumerate() if thread.name == "worker-start"]

    asyncio.run(scenario())
    gate.touch()
    for thread in starting():
        thread.join(PATIENCE_S)
    assert not starting()
