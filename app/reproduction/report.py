"""Tables and figures from records: what only depends on seeds apart from what depends on time."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path

from app.reproduction.claims import claims_table
from app.reproduction.figures import write_figures
from app.reproduction.grid import FAMILY, FIRST_SEED, PROBLEM_SEED, Run
from app.reproduction.records import RecordStore
from app.reproduction.results import Results
from app.reproduction.scale import QUICK, Scale
from app.reproduction.tables import tables

SUMS = "SHA256SUMS"
"""Name of the file of checksums."""

_PROBLEMS = f"problems of the family {FAMILY}, seeds [{PROBLEM_SEED}, M, N, number] with numbers from 0"

_OPTIONS = (
    "problems",
    "seeds",
    "learning_problems",
    "learning_seeds",
    "epochs",
    "grid_epochs",
    "service_epochs",
    "timed_problems",
    "race_problems",
    "race_seeds",
    "race_evaluations",
)


def write_report(scale: Scale, runs: Sequence[Run], out: Path) -> None:
    """Write ``tables/`` and ``figures/``, and ``timed/`` for what differs from run to run.

    :func:`write_sums` follows: ``SHA256SUMS`` is of all tables and figures that do not, and a second run is
    compared by it.

    Parameters
    ----------
    scale, runs
        What was run, all of it finished.
    out
        Folder of the records, and for the report.
    """
    results = Results(runs, RecordStore(out))
    provenance = describe(command_line(scale), _PROBLEMS, results.sources)
    for table in (*tables(results), claims_table(results)):
        table.write(out / ("timed" if table.timed else "") / "tables", provenance)
    write_figures(results, out / "figures", out / "timed" / "figures", provenance)


def write_sums(out: Path) -> None:
    """Write ``SHA256SUMS``."""
    (out / SUMS).write_text(sums_of(out), encoding="utf-8")


def sums_of(folder: Path) -> str:
    """Return the SHA-256 of every table and figure that only depends on seeds, as ``sha256sum`` writes it."""
    files = sorted(file for part in ("figures", "tables") for file in (folder / part).iterdir())
    lines = [
        f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.relative_to(folder)}\n" for file in files
    ]
    return "".join(lines)


def describe(command: str, problems: str, sources: Iterable[tuple[str, str, str]]) -> str:
    """Say in one line where figures come from: command, problems, seeds, commit, machine and versions."""
    where = "; ".join(
        f"commit {commit}, {machine}, {versions}" for commit, machine, versions in sorted(sources)
    )
    return f"Made by `{command}`: {problems}; solvers' seeds from {FIRST_SEED}; {where}."


def command_line(scale: Scale) -> str:
    """Return the command that runs a scale."""
    words = ["python -m app reproduce"]
    start = min((Scale(), QUICK), key=lambda each: _differences(scale, each))
    if start == QUICK:
        words.append("--quick")
    for name in _OPTIONS:
        if getattr(scale, name) != getattr(start, name):
            words.append(f"--{name.replace('_', '-')} {getattr(scale, name)}")
    if scale.cells != start.cells:
        words.append(f"--cells '{' '.join(map(str, scale.cells))}'")
    if scale.race_places != start.race_places:
        words.append(f"--race-places '{' '.join(scale.race_places)}'")
    known = {*_OPTIONS, "cells", "race_places"}
    words += [
        f"[{each.name} {getattr(scale, each.name)}]"
        for each in fields(Scale)
        if each.name not in known and getattr(scale, each.name) != getattr(start, each.name)
    ]
    return " ".join(words)


def _differences(scale: Scale, start: Scale) -> int:
    return sum(getattr(scale, each.name) != getattr(start, each.name) for each in fields(Scale))
