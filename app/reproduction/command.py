"""``python -m app reproduce``: the runs, then the tables and figures."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.reproduction.errors import ImpossibleScale
from app.reproduction.figures import require_packages
from app.reproduction.grid import Run, missing_packages, runs_of
from app.reproduction.race.outcome import Outcome
from app.reproduction.race.places import RACE_PROBLEMS, Place
from app.reproduction.race.report import write_race
from app.reproduction.race.runs import RaceRun, race_runs
from app.reproduction.records import RecordStore
from app.reproduction.report import command_line, describe, write_report, write_sums
from app.reproduction.runner import Work, do_runs
from app.reproduction.scale import QUICK, Cell, Scale

__all__ = ["count_runs", "missing_packages", "reproduce", "scale_of"]

PARTS = ("paper", "race")
"""The paper's experiments, and the race of its rivals."""

Advance = Callable[[float, str], None]
"""Takes how many runs are done, and a word about the last."""

_SECONDS_A_MINUTE = 60.0


def scale_of(
    quick: bool, given: Mapping[str, Any], cells: str | None, race_places: str | None = None
) -> Scale:
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
    race_places
        Places of the race with spaces between them; None: all.

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
    if race_places is not None:
        chosen["race_places"] = tuple(str(Place.parse(text)) for text in race_places.split())
    return replace(start, **chosen)


def parts_of(scale: Scale, parts: Collection[str]) -> tuple[list[Run], list[RaceRun]]:
    """Return the runs of the paper's experiments, and those of the race, as far as they are asked for.

    Raises
    ------
    ImpossibleScale
        If a part does not exist.
    """
    for part in parts:
        if part not in PARTS:
            raise ImpossibleScale(f"{part!r} is no part: {' '.join(PARTS)}")
    return runs_of(scale) if PARTS[0] in parts else [], race_runs(scale) if PARTS[1] in parts else []


def count_runs(scale: Scale, parts: Collection[str] = PARTS) -> int:
    """Return how many runs there are."""
    paper, race = parts_of(scale, parts)
    return len(paper) + len(race)


def reproduce(
    scale: Scale,
    out: Path,
    workers: int,
    for_minutes: float | None,
    advance: Advance,
    parts: Collection[str] = PARTS,
) -> bool:
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
    parts
        Of :data:`PARTS`.

    Returns
    -------
    bool
        Whether all runs are done; tables and figures are only written then.

    Raises
    ------
    ImpossibleScale
        If a part does not exist.
    MissingPackage
        If matplotlib or scipy is not installed.
    """
    require_packages()
    paper, race = parts_of(scale, parts)
    runs: list[Work] = [*paper, *race]
    until = None if for_minutes is None else time.monotonic() + _SECONDS_A_MINUTE * for_minutes
    finished = 0
    for done in do_runs(runs, out, workers, until):
        finished = done.finished
        advance(finished, done.last.id if done.last else "")
    if finished < len(runs):
        return False
    if paper:
        write_report(scale, paper, out)
    if race:
        outcome = Outcome(race, RecordStore(out))
        command = f"{command_line(scale)} --parts '{' '.join(parts)}'"
        write_race(outcome, out, describe(command, RACE_PROBLEMS, outcome.sources))
    write_sums(out)
    return True
