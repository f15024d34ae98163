"""One torch thread while a learner runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def one_thread() -> Iterator[None]:
    """Run torch's operations on one thread, and put the number back afterwards.

    The networks are small, so a second thread costs more than it gives; and how sums are split between
    threads changes their last digits, so the same request would not give the same answer everywhere.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
