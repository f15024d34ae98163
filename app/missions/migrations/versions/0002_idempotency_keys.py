"""The idempotency keys that missions were begun with."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the table."""
    op.create_table(
        "mission_idempotency_keys",
        sa.Column("client", sa.String(255), primary_key=True),
        sa.Column("key", sa.String(255), primary_key=True),
        sa.Column("body_hash", sa.String(128), nullable=False),
        sa.Column(
            "mission_id", sa.String(32), sa.ForeignKey("missions.id", ondelete="CASCADE"), nullable=False
        ),
    )
    op.create_index("ix_mission_idempotency_keys_mission_id", "mission_idempotency_keys", ["mission_id"])


def downgrade() -> None:
    """Drop the table."""
    op.drop_table("mission_idempotency_keys")
