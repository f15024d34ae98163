"""What a worker waits for before it gets work, and what follows."""

import contextlib

import pytest

from app.allocation import warm_up


@pytest.fixture
def done(monkeypatch):
    """What the warm-up does, in its order, without doing any of it."""
    steps = []
    for name in ("_time_answers", "_time_bound", "compile_in_turns"):
        monkeypatch.setattr(warm_up, name, lambda *_arguments: None)
    monkeypatch.setattr(
        warm_up, "_time_preparations", lambda algorithm, *_: steps.append(f"time {algorithm}")
    )
    parts = {part: lambda part=part: steps.append(part) for part in warm_up.PARTS}
    monkeypatch.setattr(warm_up, "PARTS", parts)
    return steps


class Compiling:
    """The process that compiles what is left."""

    def __init__(self, target):
        self.target = target

    def start(self):
        assert self.target is warm_up._compile_others

    def join(self):
        """It has compiled at once."""


def test_a_worker_that_finds_code_compiled_loads_everything_first(done, monkeypatch):
    monkeypatch.setattr(warm_up, "compiled_here", lambda: 0)
    assert warm_up.warm_up_worker(5, 5) is None
    assert set(warm_up.PARTS) <= set(done)
    worker, done[:] = [*done], []
    warm_up.warm_up(5, 5)
    assert done == worker


def test_a_worker_that_compiles_is_ready_with_the_default_algorithm(done, monkeypatch):
    monkeypatch.setattr(warm_up, "compiled_here", lambda: 1)
    ready = []

    class Context:
        def Process(self, target):  # noqa: N802 - as multiprocessing has it
            ready.extend(done)
            return Compiling(target)

    monkeypatch.setattr(warm_up.multiprocessing, "get_context", lambda _method: Context())
    later = warm_up.warm_up_worker(5, 5)
    later.join(60)
    assert set(ready) == {*warm_up.DEFAULT, "time transfer_qmix"}
    assert set(warm_up.PARTS) <= set(done)
    assert "time ga" in done


def test_parts_that_another_process_is_at_come_last(done, monkeypatch):
    monkeypatch.setattr(warm_up, "first_at", lambda part: contextlib.nullcontext(part != "ga"))
    warm_up._load(("ga", "dqn", "exact"))
    assert done == ["dqn", "exact", "ga"]
