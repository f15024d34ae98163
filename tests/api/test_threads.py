"""Threads that were started before the system had none left."""

import asyncio
import threading
from contextlib import contextmanager

import pytest

from app.api.threads import started_threads


@pytest.fixture
def none_left(monkeypatch):
    """Makes the system refuse every further thread, after so many."""

    @contextmanager
    def after(count):
        start, left = threading.Thread.start, [count]

        def refuse(thread):
            if not left[0]:
                raise RuntimeError("can't start new thread")
            left[0] -= 1
            start(thread)

        with monkeypatch.context() as patched:
            patched.setattr(threading.Thread, "start", refuse)
            yield

    return after


def test_requests_have_theirs_when_the_system_gives_no_more(none_left):
    async def scenario():
        asyncio.get_running_loop().set_default_executor(started_threads(4))
        together = threading.Barrier(4)
        with none_left(0):
            # All four at once, and more than there are in turn.
            at_once = await asyncio.gather(*(asyncio.to_thread(together.wait) for _ in range(4)))
            in_turn = await asyncio.gather(*(asyncio.to_thread(lambda n=n: n) for n in range(20)))
        assert (sorted(at_once), in_turn) == ([0, 1, 2, 3], list(range(20)))

    asyncio.run(scenario())


def test_too_few_are_said_at_once(none_left):
    with none_left(2), pytest.raises(RuntimeError, match="new thread"):
        started_threads(4)
