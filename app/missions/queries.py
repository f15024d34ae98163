"""Looking at the tables of missions; nothing here changes them, or waits for what does.

The methods block on the disk: call them from a thread, not from an event loop.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection, RowMapping

from app.jobs.errors import InvalidCursor
from app.jobs.model import Idempotency
from app.jobs.stored_json import read
from app.jobs.tables import Database, known_by
from app.missions.errors import MissionNotFound
from app.missions.model import Entry, Head, Mission, Planning, Proposal, ProposalStatus
from app.missions.tables import events, idempotency_keys, missions, positions, proposals, states

_LARGE = {"number", "problem", "matrices"}
_has_open = sa.exists().where(
    proposals.c.mission_id == missions.c.id, proposals.c.status == ProposalStatus.OPEN
)
select_missions = sa.select(
    *(column for column in missions.c if column.name not in _LARGE), _has_open.label("has_open")
)
select_entries = sa.select(*(column for column in events.c if column.name != "state"))
_MOST_DIGITS = 18


class MissionQueries:
    """Reads the tables of missions.

    Parameters
    ----------
    database
        Where they are.

    Attributes
    ----------
    database
        The same.
    """

    def __init__(self, database: Database) -> None:
        self.database = database

    def get(self, mission_id: str) -> Mission:
        """Return a mission.

        Raises
        ------
        MissionNotFound
            If there is none of that id; so do the other methods.
        """
        with self.database.read() as connection:
            return mission_of(find(connection, mission_id))

    def begun_with(self, idempotency: Idempotency) -> Mission | None:
        """Return the mission that was begun with an idempotency key; None if none was.

        Raises
        ------
        IdempotencyMismatch
            If the key came with another body.
        """
        with self.database.read() as connection:
            known = known_by(connection, idempotency_keys, idempotency)
            return None if known is None else mission_of(find(connection, known))

    def problem(self, mission_id: str) -> dict[str, Any]:
        """Return the record of the problem that a mission began with."""
        statement = sa.select(missions.c.problem, missions.c.matrices)
        with self.database.read() as connection:
            row = find(connection, mission_id, statement)
        return row["problem"] if row["matrices"] is None else {**row["problem"], "matrices": row["matrices"]}

    def page(self, limit: int, cursor: str | None) -> tuple[list[Mission], str | None]:
        """Return missions, newest first, and the cursor of the next page.

        Raises
        ------
        InvalidCursor
            If no page gave out such a cursor.
        """
        statement = select_missions.add_columns(missions.c.number).order_by(missions.c.number.desc())
        if cursor is not None:
            if not (cursor.isascii() and cursor.isdigit() and len(cursor) <= _MOST_DIGITS):
                raise InvalidCursor(cursor)
            statement = statement.where(missions.c.number < int(cursor))
        with self.database.read() as connection:
            rows = connection.execute(statement.limit(limit + 1)).mappings().all()
        more = len(rows) > limit
        return [mission_of(row) for row in rows[:limit]], str(rows[limit - 1]["number"]) if more else None

    def head(self, mission_id: str) -> Head:
        """Return a mission as it stands."""
        with self.database.read() as connection:
            return head_of(connection, mission_id)

    def wanting(self) -> list[str]:
        """Return the ids of the missions for which a plan is to be looked for, or accepted."""
        wants = sa.or_(missions.c.wanted > missions.c.planned, _has_open)
        with self.database.read() as connection:
            return list(connection.scalars(sa.select(missions.c.id).where(wants)))

    def known(self, mission_id: str, client_id: str) -> tuple[Entry, str] | None:
        """Return the event that came with a client's id, and its digest; None if there is none."""
        with self.database.read() as connection:
            return known_in(connection, mission_id, client_id)

    def entries(self, mission_id: str, after: int, limit: int) -> list[Entry]:
        """Return events with larger numbers than ``after``, in their order."""
        statement = select_entries.where(events.c.mission_id == mission_id, events.c.number > after)
        with self.database.read() as connection:
            find(connection, mission_id)
            rows = connection.execute(statement.order_by(events.c.number).limit(limit)).mappings()
            return [entry_of(row) for row in rows]

    def proposals(self, mission_id: str) -> list[Proposal]:
        """Return all proposals, newest first."""
        statement = sa.select(proposals).where(proposals.c.mission_id == mission_id)
        with self.database.read() as connection:
            find(connection, mission_id)
            rows = connection.execute(statement.order_by(proposals.c.number.desc())).mappings()
            return [proposal_of(row) for row in rows]

    def proposal(self, mission_id: str, number: int) -> Proposal | None:
        """Return a proposal; None if there is none of that number."""
        statement = sa.select(proposals).where(
            proposals.c.mission_id == mission_id, proposals.c.number == number
        )
        with self.database.read() as connection:
            row = connection.execute(statement).mappings().first()
        return None if row is None else proposal_of(row)

    def state_at(self, mission_id: str, at: float) -> tuple[int, Mapping[str, Any]]:
        """Return the last state that was made no later than a moment, and the number of its event."""
        return self._state(mission_id, events.c.at <= at)

    def state_after(self, mission_id: str, number: int) -> tuple[int, Mapping[str, Any]]:
        """Return the state after an event; of one that made none, that before it."""
        return self._state(mission_id, events.c.number <= number)

    def _state(self, mission_id: str, which: sa.ColumnElement[bool]) -> tuple[int, Mapping[str, Any]]:
        made = events.c.mission_id == mission_id, events.c.state.is_not(None)
        statement = sa.select(events.c.number, events.c.state).where(*made, which)
        with self.database.read() as connection:
            find(connection, mission_id)
            row = connection.execute(statement.order_by(events.c.number.desc()).limit(1)).one()
        return row.number, unpacked(row.state)

    def states(self, mission_id: str) -> dict[int, Mapping[str, Any]]:
        """Return every state by the number of the event that made it."""
        made = events.c.mission_id == mission_id, events.c.state.is_not(None)
        with self.database.read() as connection:
            rows = connection.execute(
                sa.select(events.c.number, events.c.state).where(*made).order_by(events.c.number)
            )
            return {row.number: unpacked(row.state) for row in rows}


def find(connection: Connection, mission_id: str, select: sa.Select[Any] = select_missions) -> RowMapping:
    """Return what is selected of a mission.

    Raises
    ------
    MissionNotFound
        If there is none of that id.
    """
    row = connection.execute(select.where(missions.c.id == mission_id)).mappings().first()
    if row is None:
        raise MissionNotFound(mission_id)
    return row


def head_of(connection: Connection, mission_id: str) -> Head:
    """Return a mission as it stands.

    Raises
    ------
    MissionNotFound
        If there is none of that id.
    """
    row = find(connection, mission_id, select_missions.add_columns(missions.c.matrices))
    of = connection.execute(sa.select(states).where(states.c.mission_id == mission_id)).one()
    seen = connection.execute(sa.select(positions).where(positions.c.mission_id == mission_id)).mappings()
    by_uav = {each["uav_id"]: {name: each[name] for name in _SEEN if each[name] is not None} for each in seen}
    return Head(mission_of(row), of.state, of.plan, row["matrices"], by_uav)


_SEEN = ("number", "time", "x", "y", "dis", "airborne", "location")


def known_in(connection: Connection, mission_id: str, client_id: str) -> tuple[Entry, str] | None:
    """Return the event that came with a client's id, and its digest; None if there is none."""
    of_client = events.c.mission_id == mission_id, events.c.client_id == client_id
    row = connection.execute(select_entries.where(*of_client)).mappings().first()
    return None if row is None else (entry_of(row), row["digest"])


def mission_of(row: RowMapping) -> Mission:
    """Return the mission of a row."""
    given = {name: row[name] for name in ("id", "name", "clock", "last_number", "state_number", "trouble")}
    return Mission(
        **given,
        wanted=row["wanted"],
        planned=row["planned"],
        has_open=row["has_open"],
        planning=Planning(**row["planning"]),
        created_at=datetime.fromtimestamp(row["created_at"], UTC),
    )


def entry_of(row: RowMapping | Mapping[str, Any]) -> Entry:
    """Return the event of a row."""
    return Entry(
        row["number"],
        row["client_id"],
        row["type"],
        row["at"],
        row["body"],
        row["outcome"],
        datetime.fromtimestamp(row["recorded_at"], UTC),
    )


def proposal_of(row: RowMapping) -> Proposal:
    """Return the proposal of a row."""
    status = ProposalStatus(row["status"])
    return Proposal(row["number"], status, row["of_number"], row["job_id"], row["content"])


def unpacked(packed: bytes) -> Mapping[str, Any]:
    """Return a state as it was before it was compressed."""
    state: Mapping[str, Any] = read(zlib.decompress(packed).decode())
    return state
