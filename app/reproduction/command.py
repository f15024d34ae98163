"""``python -m app reproduce``: the runs, then the tables and figures."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.reproduction.figures import require_matplotlib
from app.reproduction.grid import missing_packages, runs_of
from app.reproduction.report import write_report
from app.reproduction.runner import do_runs
from app.reproduction.scale import QUICK, Cell, Scale

__all__ = ["count_runs", "missing_packages", "reproduce", "scale_of"]

Advance = Callable[[float, str], None]
"""Takes how many runs are done, and a word about the last."""

_SECONDS_A_MINUTE = 60.0


def scale_of(quick: bool, given: Mapping[str, Any], cells: str | None) -> Scale:
    """Return how much is to be run.

    Parameters
    ----------
    quick
        Whether to begin from :data:`~app.reproduction.scale.QUICK`; otherwise from the full protocol.
    given
        What replaces its values, by the names of :class:`~app.reproduction.scale.Scale`. Where only
        `problems` is given, the learners and the timed comparison get no more than that.
    cells
        Sizes with spaces between them; None: all.

    Raises
    ------
    ImpossibleScale
        If a size does not exist or the numbers do not fit together.
    """
    start = QUICK if quick else Scale()
    chosen = dict(given)
    if "problems" in chosen:
        for name in ("learning_problems", "timed_problems"):
            chosen.setdefault(name, min(getattr(start, name), chosen["problems"]))
    if cells is not None:
        chosen["cells"] = tuple(map(Cell.parse, cells.split()))
    return replace(start, **chosen)


def count_runs(scale: Scale) -> int:
    """Return how many runs there are."""
    return len(runs_of(scale))


def reproduce(scale: Scale, out: Path, workers: int, for_minutes: float | None, advance: Advance) -> bool:
    """Do what is not done yet, then write tables and figures.

    Parameters
    ----------
    scale
        How much.
    out
        Folder for everything; made where it is missing.
    workers
        Processes.
    for_minutes
        No run is begun after this time; None: all are.
    advance
        Told about progress.

    Returns
    -------
    bool
        Whether all runs are done; tables and figures are only written then.

    Raises
    ------
    MissingPackage
        If matplotlib is not installed.
    """
    require_matplotlib()
    runs = runs_of(scale)
    until = None if for_minutes is None else time.monotonic() + _SECONDS_A_MINUTE * for_minutes
    finished = 0
    for done in do_runs(runs, out, workers, until):
        finished = done.finished
        advance(finished, done.last.id if done.last else "")
    if finished < len(runs):
        return False
    write_report(scale, runs, out)
    return True
