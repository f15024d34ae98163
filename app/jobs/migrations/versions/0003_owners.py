"""Owners with the time of their last sign of life, and job numbers that do not run out on a server.

Revision ID: 0003
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Make the table; SQLite's integers have eight bytes already."""
    op.create_table(
        "job_owners",
        sa.Column("owner", sa.String(255), primary_key=True),
        sa.Column("seen_at", sa.Double, nullable=False),
    )
    if op.get_bind().dialect.name == "postgresql":
        op.execute("ALTER SEQUENCE jobs_number_seq AS BIGINT")
        op.alter_column("jobs", "number", type_=sa.BigInteger)
