"""The threads in which requests wait for the database."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor


def started_threads(count: int) -> ThreadPoolExecutor:
    """Return threads that run already: requests are answered where the system gives no more of them later.

    Parameters
    ----------
    count
        How many.

    Raises
    ------
    RuntimeError
        If the system does not give so many.
    """
    threads = ThreadPoolExecutor(count, thread_name_prefix="requests")
    together = threading.Barrier(count + 1)
    try:
        for _ in range(count):
            threads.submit(together.wait)
        together.wait()
    except BaseException:
        together.abort()
        threads.shutdown()
        raise
    return threads
