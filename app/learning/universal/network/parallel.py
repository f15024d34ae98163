"""Work on cores that are idle at the moment; compiled code runs on several at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

_HELPERS = max(1, (os.cpu_count() or 1) - 1)


@cache
def helpers() -> ThreadPoolExecutor:
    """The threads beside the calling one; started when they are first needed."""
    return ThreadPoolExecutor(_HELPERS, "parallel")


def parallel_threads(spare: int) -> int:
    """How many threads work together where so many cores are idle, the calling one included."""
    return 1 + max(0, min(spare, _HELPERS))


def in_parallel(work: Callable[[Item], Result], items: Sequence[Item], spare: int) -> Iterator[Result]:
    """Work on items side by side; return the results in the items' order, each as soon as it is there.

    Parameters
    ----------
    work
        What is done with each. It must not wait for other work that is done in parallel.
    items
        With none of them left out, unless the caller stops iterating: then those that have not begun.
    spare
        Cores that are idle.
    """
    count = min(parallel_threads(spare), len(items))
    if count <= 1:
        yield from map(work, items)
        return
    # Every `count`-th is the calling thread's, which would only wait otherwise.
    pending = {place: helpers().submit(work, items[place]) for place in range(len(items)) if place % count}
    try:
        for place, item in enumerate(items):
            yield pending[place].result() if place in pending else work(item)
    finally:
        for future in pending.values():
            future.cancel()
