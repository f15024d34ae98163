"""A bar of progress on a terminal, lines of text elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

PLAIN_LINE_EVERY_S = 2.0
"""Seconds between two lines of progress where there is no terminal."""

Advance = Callable[[float, str], None]
"""Takes how much of the total is done, and a word about it."""


@contextmanager
def bar(title: str, total: float) -> Iterator[Advance]:
    """Draw a progress bar on a terminal; elsewhere a line from time to time. Both go to standard error."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _PlainLines(title, total)
        return
    columns = (
        TextColumn(title),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("", total=total)
        yield lambda done, said: bar.update(task, completed=done, description=said)


class _PlainLines:
    """Progress as lines of text, not more often than every ``PLAIN_LINE_EVERY_S`` seconds."""

    def __init__(self, title: str, total: float) -> None:
        self._title, self._total = title, total
        self._next = time.monotonic() + PLAIN_LINE_EVERY_S

    def __call__(self, done: float, said: str) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + PLAIN_LINE_EVERY_S
            typer.echo(f"{self._title}: {100 * done / self._total:.1f} % {said}".rstrip(), err=True)
