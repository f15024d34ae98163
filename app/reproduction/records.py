"""What is on disk: one file a finished run, and beside it how long it took and where.

A record holds nothing that depends on time or place, so a second run writes the same bytes. Records of runs
with a time limit do, and lie in a folder of their own.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Protocol

Record = dict[str, Any]

UNTIMED, TIMED = "runs", "timed"
"""Folders of records: of what only depends on seeds, and of what a time limit ends."""


class Recorded(Protocol):
    """A run that a record can be of."""

    @property
    def id(self) -> str:
        """A path without suffix."""
        ...

    @property
    def folder(self) -> str:
        """Where its record is: ``UNTIMED`` or ``TIMED``."""
        ...

    def as_record(self) -> Record:
        """Return what tells it from other runs, as JSON has it."""
        ...


class RecordStore:
    """The records in a folder.

    Parameters
    ----------
    folder
        Made where it is missing: ``runs/`` and ``timed/`` have the records, ``timings/`` what they took.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def finished(self, run: Recorded) -> bool:
        """Whether a run's record is there, with the same parameters."""
        return self.read(run) is not None

    def read(self, run: Recorded) -> Record | None:
        """Return a run's record, or None where there is none or it is of other parameters or damaged."""
        record = _read(self._record(run))
        wanted = json.loads(json.dumps(run.as_record()))
        return record if record is not None and record.get("run") == wanted else None

    def timing(self, run: Recorded) -> Record | None:
        """Return what a run took: ``seconds``, ``commit``, ``machine``, ``versions``; None where unknown."""
        return _read(self._timing(run))

    def write(self, run: Recorded, record: Record, timing: Record) -> None:
        """Write a finished run: complete or not at all."""
        _write(self._timing(run), timing)
        _write(self._record(run), {"run": run.as_record(), **record})

    def _record(self, run: Recorded) -> Path:
        return self._folder / run.folder / f"{run.id}.json"

    def _timing(self, run: Recorded) -> Path:
        return self._folder / "timings" / f"{run.id}.json"


def _read(file: Path) -> Record | None:
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    return record if isinstance(record, dict) else None


def _write(file: Path, record: Record) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(".partial")
    partial.write_text(json.dumps(record, sort_keys=True) + "\n", encoding="utf-8")
    os.replace(partial, file)
