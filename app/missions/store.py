"""Writing to the tables of missions: an event and the state that it makes are one transaction.

A write names the newest event that is known to it, and nothing is written if there is a
newer one: so events take effect one after the other, from whatever process. The methods block on the disk.
"""

from __future__ import annotations

import time
import uuid
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection, RowMapping

from app.jobs.model import Idempotency
from app.jobs.stored_json import write
from app.jobs.tables import claim_key, keep
from app.missions import events as kinds
from app.missions.errors import EventReused
from app.missions.model import Entry, Judged, Mission, Planning, ProposalStatus, Sent
from app.missions.queries import MissionQueries, entry_of, find, known_in, mission_of, select_missions
from app.missions.tables import events, idempotency_keys, missions, positions, proposals, states

MIGRATIONS = Path(__file__).parent / "migrations"
VERSION_TABLE = "alembic_version_missions"

_GAIN = 1e-9
"""Share of a reward that a plan has to earn more, to be proposed."""


class Moved(Exception):
    """Another event came first: what was worked out is of a state that is no more."""


class MissionStore(MissionQueries):
    """Reads and writes missions."""

    def migrate(self) -> None:
        """Make the tables, or bring them to this version."""
        self.database.migrate(MIGRATIONS, VERSION_TABLE)

    def create(
        self,
        name: str | None,
        problem: Mapping[str, Any],
        planning: Planning,
        state: Mapping[str, Any],
        plan: Mapping[str, Any],
        idempotency: Idempotency | None = None,
    ) -> tuple[Mission, bool]:
        """Begin a mission, or find the one that was begun with the same idempotency key.

        Parameters
        ----------
        name
            For people.
        problem
            Its record.
        planning
            How it is planned.
        state, plan
            Records of the first state, and of the plan in force.
        idempotency
            The key that the request came with.

        Returns
        -------
        tuple
            The mission, and whether it is new.

        Raises
        ------
        IdempotencyMismatch
            If the key came with another body before.
        """
        now, mission_id = time.time(), uuid.uuid4().hex
        row = {
            "id": mission_id,
            "name": name,
            "clock": state["clock"],
            "last_number": 1,
            "state_number": 1,
            "wanted": 1,
            "planned": 0,
            "planning": planning.to_record(),
            "trouble": None,
            "created_at": now,
            "problem": {field: value for field, value in problem.items() if field != "matrices"},
            "matrices": problem.get("matrices"),
        }
        with self.database.write() as connection:
            if idempotency is not None:
                known = claim_key(self.database, connection, idempotency_keys, idempotency)
                if known is not None:
                    return mission_of(find(connection, known)), False
            connection.execute(sa.insert(missions).values(row))
            if idempotency is not None:
                keep(connection, idempotency_keys, idempotency, mission_id)
            connection.execute(sa.insert(states).values(mission_id=mission_id, state=state, plan=plan))
            begun = Sent(None, None, kinds.BEGUN, state["clock"], {"type": kinds.BEGUN})
            self._insert(connection, mission_id, 1, begun, {}, state)
            return mission_of(find(connection, mission_id)), True

    def delete(self, mission_id: str) -> None:
        """Delete a mission with all that is kept of it.

        Raises
        ------
        MissionNotFound
            If there is none of that id.
        """
        with self.database.write() as connection:
            find(connection, mission_id)
            connection.execute(sa.delete(missions).where(missions.c.id == mission_id))

    def expire(self, before: float, limit: int) -> list[str]:
        """Delete missions in which nothing has happened for long.

        Parameters
        ----------
        before
            Seconds since 1970: only missions whose newest event was written before then.
        limit
            How many at most: other writers wait that long.

        Returns
        -------
        list of str
            Their ids.
        """
        newest = sa.and_(events.c.mission_id == missions.c.id, events.c.number == missions.c.last_number)
        old = sa.select(missions.c.id).join(events, newest).where(events.c.recorded_at < before)
        with self.database.write() as connection:
            gone = list(connection.scalars(old.order_by(missions.c.number).limit(limit)))
            connection.execute(sa.delete(missions).where(missions.c.id.in_(gone)))
        return gone

    def commit(self, mission_id: str, seen: int, sent: Sent, judged: Judged) -> tuple[Entry, bool]:
        """Keep an event and the state that it makes.

        Parameters
        ----------
        mission_id
            The mission.
        seen
            Number of the event that was the newest when it was judged.
        sent, judged
            The event, and what was worked out of it.

        Returns
        -------
        tuple
            The event, and whether it is new: one whose id is known is not kept again.

        Raises
        ------
        MissionNotFound, EventReused
            If there is no such mission, or the event's id came with another one.
        Moved
            If another event came first.
        """
        with self.database.write() as connection:
            row = self._locked(connection, mission_id)
            if (known := _known(connection, mission_id, sent)) is not None:
                return known, False
            if row["last_number"] != seen:
                raise Moved
            number = seen + 1
            entry = self._insert(
                connection, mission_id, number, sent, {"effect": judged.effect}, judged.state
            )
            changes = {"last_number": number, "state_number": number, "clock": sent.at}
            if judged.wants_plan:
                changes["wanted"] = number
                self._close(connection, mission_id, None, ProposalStatus.OUTDATED)
            if judged.closes is not None:
                self._close(connection, mission_id, *judged.closes)
            of = states.c.mission_id == mission_id
            connection.execute(sa.update(states).where(of).values(state=judged.state, plan=judged.plan))
            connection.execute(sa.update(missions).where(missions.c.id == mission_id).values(changes))
            return entry, True

    def commit_positions(
        self, mission_id: str, state_number: int, sent: Sent, newest: Mapping[str, Mapping[str, Any]]
    ) -> tuple[Entry, bool]:
        """Keep a batch of positions, of which those count that are newer than what is known of their UAV.

        Parameters
        ----------
        mission_id
            The mission.
        state_number
            Of the state by which they were checked.
        sent
            The event.
        newest
            The newest position of each UAV in it, by its id.

        Returns
        -------
        tuple
            The event, and whether it is new.

        Raises
        ------
        MissionNotFound, EventReused
            As :meth:`commit` does.
        Moved
            If there is another state.
        """
        with self.database.write() as connection:
            row = self._locked(connection, mission_id)
            if (known := _known(connection, mission_id, sent)) is not None:
                return known, False
            if row["state_number"] != state_number:
                raise Moved
            of = positions.c.mission_id == mission_id, positions.c.uav_id.in_(list(newest))
            times = dict(connection.execute(sa.select(positions.c.uav_id, positions.c.time).where(*of)).all())
            kept = {uav_id: each for uav_id, each in newest.items() if each["time"] > times.get(uav_id, -1.0)}
            number = row["last_number"] + 1
            passed_over = len(sent.body["positions"]) - len(kept)
            entry = self._insert(connection, mission_id, number, sent, {"passed_over": passed_over}, None)
            if kept:
                stale = positions.c.mission_id == mission_id, positions.c.uav_id.in_(list(kept))
                connection.execute(sa.delete(positions).where(*stale))
                nothing = dict.fromkeys(("dis", "airborne", "location"))
                about = {"mission_id": mission_id, "number": number}
                rows = [{**nothing, **each, **about, "uav_id": uav_id} for uav_id, each in kept.items()]
                connection.execute(sa.insert(positions), rows)
            changes = sa.update(missions).where(missions.c.id == mission_id).values(last_number=number)
            connection.execute(changes)
            return entry, True

    def propose(
        self, connection: Connection, mission_id: str, of_number: int, job_id: str, content: Mapping[str, Any]
    ) -> int | None:
        """Take note that plans were looked for, within a transaction, and propose the one that was found.

        Parameters
        ----------
        connection
            Of the transaction.
        mission_id
            The mission; nothing happens if it is no more.
        of_number
            The event after which it was looked for. If another plan is wanted since, nothing is proposed.
        job_id
            The job that found it.
        content
            As of :class:`~app.missions.model.Proposal`.

        Returns
        -------
        int or None
            Number of the proposal; None where there is none.
        """
        row = (
            connection.execute(select_missions.where(missions.c.id == mission_id).with_for_update())
            .mappings()
            .first()
        )
        if row is None:
            return None
        changes: dict[str, Any] = {"planned": max(row["planned"], of_number), "trouble": None}
        number = None
        better = content["gained"] > _GAIN * max(1.0, abs(content["reward"]))
        if better and row["wanted"] <= of_number:
            number = changes["last_number"] = row["last_number"] + 1
            told = {name: content[name] for name in ("reward", "gained", "differences")}
            body = {"type": kinds.PROPOSED, "proposal": number, "of_number": of_number, **told}
            sent = Sent(None, None, kinds.PROPOSED, row["clock"], body)
            self._insert(connection, mission_id, number, sent, {}, None)
            self._close(connection, mission_id, None, ProposalStatus.OUTDATED)
            connection.execute(
                sa.insert(proposals).values(
                    mission_id=mission_id,
                    number=number,
                    status=ProposalStatus.OPEN,
                    of_number=of_number,
                    job_id=job_id,
                    content=content,
                )
            )
        connection.execute(sa.update(missions).where(missions.c.id == mission_id).values(changes))
        return number

    def planned_in_vain(self, mission_id: str, of_number: int, trouble: Mapping[str, Any] | None) -> None:
        """Take note that no plan was found for the state after an event, and why."""
        changes = {"planned": of_number, "trouble": trouble}
        of = missions.c.id == mission_id, missions.c.planned < of_number
        with self.database.write() as connection:
            connection.execute(sa.update(missions).where(*of).values(changes))

    def outdate(self, mission_id: str, proposal: int) -> None:
        """Take note that a proposal fits no more, and that another plan is wanted."""
        of = missions.c.id == mission_id
        with self.database.write() as connection:
            self._close(connection, mission_id, proposal, ProposalStatus.OUTDATED)
            wanted = sa.update(missions).where(of).values(wanted=missions.c.state_number)
            connection.execute(wanted)

    def _locked(self, connection: Connection, mission_id: str) -> RowMapping:
        return find(connection, mission_id, select_missions.with_for_update())

    def _close(
        self, connection: Connection, mission_id: str, number: int | None, status: ProposalStatus
    ) -> None:
        """Close an open proposal; all where none is named."""
        which = [proposals.c.mission_id == mission_id, proposals.c.status == ProposalStatus.OPEN]
        if number is not None:
            which.append(proposals.c.number == number)
        connection.execute(sa.update(proposals).where(*which).values(status=status))

    def _insert(
        self,
        connection: Connection,
        mission_id: str,
        number: int,
        sent: Sent,
        outcome: Mapping[str, Any],
        state: Mapping[str, Any] | None,
    ) -> Entry:
        row = {
            "mission_id": mission_id,
            "number": number,
            "client_id": sent.id,
            "digest": sent.digest,
            "type": sent.type,
            "at": sent.at,
            "recorded_at": time.time(),
            "outcome": outcome,
            "body": sent.body,
            "state": None if state is None else zlib.compress(write(state).encode(), 1),
        }
        connection.execute(sa.insert(events).values(row))
        return entry_of(row)


def newest_of(batch: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Return the newest position of each UAV of a batch, by its id; of equal ones the first."""
    newest: dict[str, Mapping[str, Any]] = {}
    for each in batch:
        known = newest.get(each["uav_id"])
        if known is None or each["time"] > known["time"]:
            newest[each["uav_id"]] = each
    return newest


def _known(connection: Connection, mission_id: str, sent: Sent) -> Entry | None:
    """Return the event that came with the same id.

    Raises
    ------
    EventReused
        If that was another one.
    """
    known = None if sent.id is None else known_in(connection, mission_id, sent.id)
    if known is None:
        return None
    if known[1] != sent.digest:
        assert sent.id is not None
        raise EventReused(sent.id, known[0].number)
    return known[0]
