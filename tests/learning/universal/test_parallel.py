"""Work on idle cores."""

import threading

import pytest

from app.learning.universal.network.parallel import helpers, in_parallel, parallel_threads


@pytest.mark.parametrize("spare", [-1, 0, 1, 7])
def test_results_come_in_order(spare):
    assert list(in_parallel(lambda item: item * item, range(9), spare)) == [item * item for item in range(9)]


def test_two_work_at_the_same_time():
    both = threading.Barrier(2, timeout=20)
    assert list(in_parallel(lambda _item: both.wait(), range(2), 1)) != []


def test_without_an_idle_core_only_the_caller_works():
    threads = in_parallel(lambda _item: threading.current_thread(), range(3), 0)
    assert set(threads) == {threading.current_thread()}
    assert parallel_threads(0) == 1


def test_whoever_leaves_early_waits_for_nobody():
    hold, done = threading.Event(), []

    def work(item):
        if item % 2:
            hold.wait(20)
        done.append(item)
        return item

    for first in in_parallel(work, range(9), 1):
        assert first == 0
        break
    hold.set()
    helpers().submit(lambda: None).result()
    assert set(done) <= {0, 1}


def test_an_error_comes_through():
    def work(item):
        raise ValueError(item)

    with pytest.raises(ValueError, match="0"):
        list(in_parallel(work, range(4), 1))
