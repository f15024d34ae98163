"""Missions, their history, states, positions and proposals.

Revision ID: 0001
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def _of_mission() -> sa.Column[str]:
    return sa.Column(
        "mission_id", sa.String(32), sa.ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True
    )


def upgrade() -> None:
    """Make the tables."""
    op.create_table(
        "missions",
        sa.Column(
            "number",
            sa.BigInteger().with_variant(sa.Integer, "sqlite"),
            primary_key=True,
            autoincrement=True,
        ),
        sa.Column("id", sa.String(32), nullable=False, unique=True),
        sa.Column("name", sa.String(256)),
        sa.Column("clock", sa.Double, nullable=False),
        sa.Column("last_number", sa.Integer, nullable=False),
        sa.Column("state_number", sa.Integer, nullable=False),
        sa.Column("wanted", sa.Integer, nullable=False),
        sa.Column("planned", sa.Integer, nullable=False),
        sa.Column("planning", sa.JSON, nullable=False),
        sa.Column("trouble", sa.JSON),
        sa.Column("created_at", sa.Double, nullable=False),
        sa.Column("problem", sa.JSON, nullable=False),
        sa.Column("matrices", sa.JSON),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_missions_wanted", "missions", ["wanted", "planned"])
    op.create_table(
        "mission_states",
        _of_mission(),
        sa.Column("state", sa.JSON, nullable=False),
        sa.Column("plan", sa.JSON, nullable=False),
    )
    op.create_table(
        "mission_events",
        _of_mission(),
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("client_id", sa.String(100)),
        sa.Column("digest", sa.String(64)),
        sa.Column("type", sa.String(32), nullable=False),
        sa.Column("at", sa.Double, nullable=False),
        sa.Column("recorded_at", sa.Double, nullable=False),
        sa.Column("outcome", sa.JSON, nullable=False),
        sa.Column("body", sa.JSON, nullable=False),
        sa.Column("state", sa.LargeBinary),
        sa.UniqueConstraint("mission_id", "client_id", name="uq_mission_events_client_id"),
    )
    op.create_table(
        "mission_positions",
        _of_mission(),
        sa.Column("uav_id", sa.String(100), primary_key=True),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("time", sa.Double, nullable=False),
        sa.Column("x", sa.Double, nullable=False),
        sa.Column("y", sa.Double, nullable=False),
        sa.Column("dis", sa.Double),
        sa.Column("airborne", sa.Double),
        sa.Column("location", sa.Integer),
    )
    op.create_table(
        "mission_proposals",
        _of_mission(),
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("status", sa.String(16), nullable=False),
        sa.Column("of_number", sa.Integer, nullable=False),
        sa.Column("job_id", sa.String(32), nullable=False),
        sa.Column("content", sa.JSON, nullable=False),
    )


def downgrade() -> None:
    """Drop the tables."""
    for name in ("proposals", "positions", "events", "states"):
        op.drop_table(f"mission_{name}")
    op.drop_table("missions")
