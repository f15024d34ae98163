"""Results that are completed after their job's end, in the job table.

The methods block on the disk, as those of :mod:`app.jobs.store` do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection, RowMapping

from app.jobs.model import FINISHED, Job
from app.jobs.reading import JobReader
from app.jobs.stored_json import read_later
from app.jobs.tables import DATABASE_NOW, jobs
from app.jobs.transitions import job_of, select_jobs, select_jobs_to_change

_MOST = 1000
"""Results that wait to be completed, at most; one more stays as it is."""

_LEFT_ALONE_S = 60.0
"""Of another service that shares the database: its results are completed by this one after so long."""


def has_place(connection: Connection) -> bool:
    """Say whether one more result can wait to be completed."""
    waiting = connection.scalar(sa.select(sa.func.count()).where(jobs.c.unfinished.is_not(None)))
    return (waiting or 0) < _MOST


class UnfinishedResults:
    """Reads and completes them on behalf of one owner.

    Parameters
    ----------
    store
        The job table.
    owner
        Whose jobs come first.
    max_attempts
        How often it is tried; then a result stays as it is.
    """

    def __init__(self, store: JobReader, owner: str, max_attempts: int) -> None:
        self._database, self._clock = store.database, store.clock
        self._owner, self._max_attempts = owner, max_attempts

    def next(self) -> Job | None:
        """Return the job whose result is to be completed next; None if there is none."""
        statement = select_jobs.where(jobs.c.unfinished.is_not(None))
        if self._database.shared:
            left_alone = jobs.c.finished_at < DATABASE_NOW - _LEFT_ALONE_S
            statement = statement.where(sa.or_(jobs.c.owner == self._owner, left_alone))
        statement = statement.order_by(jobs.c.unfinished, jobs.c.number).limit(1)
        with self._database.read() as connection:
            row = connection.execute(statement).mappings().first()
        return None if row is None else job_of(row)

    def complete(self, job_id: str, attempt: int, fields: Mapping[str, Any]) -> bool:
        """Store the fields of a result that complete it.

        Returns
        -------
        bool
            False if the result was completed by another, or the job is no more.
        """
        with self._database.write() as connection:
            row = _find(connection, job_id, attempt)
            if row is not None:
                _finish(connection, row, fields)
        return row is not None

    def failed(self, job_id: str, attempt: int, given_up: Mapping[str, Any]) -> None:
        """Count a try in vain; after the last one the result gets the fields of one that is given up."""
        with self._database.write() as connection:
            row = _find(connection, job_id, attempt)
            if row is None:
                return
            tries = row["unfinished"] + 1
            if tries >= self._max_attempts:
                _finish(connection, row, given_up)
            else:
                connection.execute(
                    sa.update(jobs).where(jobs.c.number == row["number"]).values(unfinished=tries)
                )


def _find(connection: Connection, job_id: str, attempt: int) -> RowMapping | None:
    """Return the row of an ended job whose result is not complete."""
    unfinished = jobs.c.status.in_(FINISHED), jobs.c.unfinished.is_not(None)
    found = select_jobs_to_change.where(jobs.c.id == job_id, jobs.c.attempt == attempt, *unfinished)
    return connection.execute(found).mappings().first()


def _finish(connection: Connection, row: RowMapping, fields: Mapping[str, Any]) -> None:
    values = {"result": {**read_later(row["result"]), **fields}, "unfinished": None}
    connection.execute(sa.update(jobs).where(jobs.c.number == row["number"]).values(values))
