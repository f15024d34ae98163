"""Doing the runs that are not done yet, in as many processes as there are cores."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

from app.library.seeding import seed_library
from app.reproduction.grid import Run
from app.reproduction.provenance import commit, machine, versions
from app.reproduction.race.runs import RaceRun
from app.reproduction.records import RecordStore
from policy_store.database import Database
from policy_store.library import PolicyLibrary

Work = Run | RaceRun
"""What is done by a worker."""


@dataclass(frozen=True, slots=True)
class Done:
    """How far the runs are.

    Attributes
    ----------
    finished, total
        Runs.
    last
        What has just been finished; None at the beginning.
    """

    finished: int
    total: int
    last: Work | None = None


def do_runs(
    runs: Sequence[Work], folder: Path, workers: int, begin_until: float | None = None
) -> Iterator[Done]:
    """Do the runs whose records are not in a folder yet.

    A record is written by the process that did the run, so whatever ends this early, only runs in progress
    are lost.

    Parameters
    ----------
    runs
        What there is to do.
    folder
        Of the records.
    workers
        Processes, each with one thread.
    begin_until
        On :func:`time.monotonic`: no run is begun after it. None: all are.

    Yields
    ------
    Done
        At the beginning, and after every run.
    """
    store = RecordStore(folder)
    left = [run for run in runs if not store.finished(run)]
    done = len(runs) - len(left)
    yield Done(done, len(runs))
    if not left:
        return
    # Spawned, not forked: a child forked after torch has run in the parent hangs.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, _initialise, (str(folder), _library(folder), left))
    waiting, pending = list(reversed(left)), set[Future[Work]]()
    try:
        while waiting or pending:
            late = begin_until is not None and time.monotonic() >= begin_until
            while waiting and not late and len(pending) < workers:
                pending.add(pool.submit(_do, waiting.pop()))
            if not pending:
                return
            finished, pending = wait(pending, return_when=FIRST_COMPLETED)
            for future in finished:
                done += 1
                yield Done(done, len(runs), future.result())
    finally:
        pool.shutdown(cancel_futures=True)


def _library(folder: Path) -> str:
    """Make the library of the shipped policies; return its address."""
    folder.mkdir(parents=True, exist_ok=True)
    database = Database(f"sqlite:///{folder / 'library.sqlite3'}")
    try:
        library = PolicyLibrary(database)
        library.migrate()
        seed_library(library, database)
        return database.url
    finally:
        database.dispose()


_shared: dict[str, str] = {}
"""What a worker process was told at its start."""


def _initialise(folder: str, library_url: str, runs: Sequence[Work]) -> None:
    import torch  # noqa: PLC0415 - only workers need it

    from app.reproduction.execution import warm_up  # noqa: PLC0415 - loads torch
    from app.reproduction.race.execution import warm_up as warm_up_race  # noqa: PLC0415 - loads torch

    torch.set_num_threads(1)
    _shared.update(folder=folder, library_url=library_url)
    warm_up(library_url, {run.method for run in runs if isinstance(run, Run)})
    warm_up_race([run for run in runs if isinstance(run, RaceRun)], library_url)


def _do(run: Work) -> Work:
    from app.reproduction.execution import execute  # noqa: PLC0415 - loads torch
    from app.reproduction.race.execution import execute as execute_race  # noqa: PLC0415 - loads torch

    url = _shared["library_url"]
    record, seconds = execute(run, url) if isinstance(run, Run) else execute_race(run, url)
    how = {"seconds": seconds, "commit": commit(), "machine": machine(), "versions": versions()}
    RecordStore(Path(_shared["folder"])).write(run, record, how)
    return run
