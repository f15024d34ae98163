"""Which policies were ever put in by the program itself, so that deleted ones stay deleted.

Revision ID: 0002
"""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the table; a library that was in use before has a row that says so."""
    op.create_table(
        "seeded_policies",
        sa.Column("id", sa.String(128), primary_key=True),
    )
    op.execute("INSERT INTO seeded_policies (id) SELECT '*' FROM library_revision WHERE revision > 0")


def downgrade() -> None:
    """Drop the table."""
    op.drop_table("seeded_policies")
