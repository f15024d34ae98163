"""The tables of missions, as the newest migration leaves them.

The history is the truth: ``mission_events`` has every event with the state that it made. ``mission_states``
has the newest state, so that it is read without the history.
"""

from __future__ import annotations

import sqlalchemy as sa

from app.domain.identifiers import MAX_ID_LENGTH
from app.jobs.tables import key_table

metadata = sa.MetaData()

missions = sa.Table(
    "missions",
    metadata,
    sa.Column(
        "number", sa.BigInteger().with_variant(sa.Integer, "sqlite"), primary_key=True, autoincrement=True
    ),
    sa.Column("id", sa.String(32), nullable=False, unique=True),
    sa.Column("name", sa.String(256)),
    # The mission's clock, and the numbers of the newest event, and of the newest one that made a state.
    sa.Column("clock", sa.Double, nullable=False),
    sa.Column("last_number", sa.Integer, nullable=False),
    sa.Column("state_number", sa.Integer, nullable=False),
    # The newest event after which another plan may be better, and the one up to which plans were looked for.
    sa.Column("wanted", sa.Integer, nullable=False),
    sa.Column("planned", sa.Integer, nullable=False),
    # How to plan: algorithm, parameters, seed, time limit, and whether plans take effect by themselves.
    sa.Column("planning", sa.JSON, nullable=False),
    # Why the newest search for a plan has failed.
    sa.Column("trouble", sa.JSON(none_as_null=True)),
    sa.Column("created_at", sa.Double, nullable=False),
    # What may be large comes last: the problem as it was, without its matrices, and those.
    sa.Column("problem", sa.JSON, nullable=False),
    sa.Column("matrices", sa.JSON(none_as_null=True)),
    sa.Index("ix_missions_wanted", "wanted", "planned"),
    sqlite_autoincrement=True,
)


idempotency_keys = key_table(metadata, "mission_idempotency_keys", "mission_id", "missions.id")


def _of_mission() -> sa.Column[str]:
    return sa.Column(
        "mission_id", sa.String(32), sa.ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True
    )


states = sa.Table(
    "mission_states",
    metadata,
    _of_mission(),
    sa.Column("state", sa.JSON, nullable=False),
    sa.Column("plan", sa.JSON, nullable=False),
)

events = sa.Table(
    "mission_events",
    metadata,
    _of_mission(),
    sa.Column("number", sa.Integer, primary_key=True),
    # Of the client; null for what the service writes itself.
    sa.Column("client_id", sa.String(MAX_ID_LENGTH)),
    sa.Column("digest", sa.String(64)),
    sa.Column("type", sa.String(32), nullable=False),
    sa.Column("at", sa.Double, nullable=False),
    sa.Column("recorded_at", sa.Double, nullable=False),
    # What it did to the plan, or how much of it was passed over.
    sa.Column("outcome", sa.JSON, nullable=False),
    sa.Column("body", sa.JSON, nullable=False),
    # The state after it as compressed JSON; null where it made none.
    sa.Column("state", sa.LargeBinary),
    sa.UniqueConstraint("mission_id", "client_id", name="uq_mission_events_client_id"),
)

positions = sa.Table(
    "mission_positions",
    metadata,
    _of_mission(),
    sa.Column("uav_id", sa.String(MAX_ID_LENGTH), primary_key=True),
    # Of the event that it came with.
    sa.Column("number", sa.Integer, nullable=False),
    sa.Column("time", sa.Double, nullable=False),
    sa.Column("x", sa.Double, nullable=False),
    sa.Column("y", sa.Double, nullable=False),
    sa.Column("dis", sa.Double),
    sa.Column("airborne", sa.Double),
    sa.Column("location", sa.Integer),
)

proposals = sa.Table(
    "mission_proposals",
    metadata,
    _of_mission(),
    # Of the event that made it.
    sa.Column("number", sa.Integer, primary_key=True),
    sa.Column("status", sa.String(16), nullable=False),
    # The event after which it was looked for.
    sa.Column("of_number", sa.Integer, nullable=False),
    sa.Column("job_id", sa.String(32), nullable=False),
    sa.Column("content", sa.JSON, nullable=False),
)
