"""The policy library: policies, checkpoints, feature vectors and the revision.

Revision ID: 0001
"""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the tables."""
    revisions = op.create_table(
        "library_revision",
        sa.Column("id", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("revision", sa.BigInteger, nullable=False),
        sa.CheckConstraint("id = 1", name="library_revision_one_row"),
    )
    op.bulk_insert(revisions, [{"id": 1, "revision": 0}])

    op.create_table(
        "checkpoints",
        sa.Column("sha256", sa.String(64), primary_key=True),
        sa.Column("size", sa.BigInteger, nullable=False),
        sa.Column("data", sa.LargeBinary, nullable=False),
    )

    op.create_table(
        "policies",
        sa.Column("id", sa.String(128), primary_key=True),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("name", sa.String(256), nullable=False),
        sa.Column("n_uavs", sa.Integer, nullable=False),
        sa.Column("n_targets", sa.Integer, nullable=False),
        sa.Column("n_materials", sa.Integer, nullable=False),
        sa.Column("task", sa.JSON, nullable=False),
        sa.Column("architecture", sa.String(128), nullable=False),
        sa.Column("algorithm", sa.String(128), nullable=False),
        sa.Column("seed", sa.BigInteger),
        sa.Column("metrics", sa.JSON, nullable=False),
        sa.Column("metadata", sa.JSON, nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("checkpoint_sha256", sa.String(64), sa.ForeignKey("checkpoints.sha256"), nullable=False),
        sa.CheckConstraint("n_uavs >= 1 AND n_targets >= 1 AND n_materials >= 1", name="policies_sizes"),
    )
    op.create_index("ix_policies_sequence", "policies", ["sequence"], unique=True)
    op.create_index("ix_policies_checkpoint", "policies", ["checkpoint_sha256"])
    op.create_index("ix_policies_sizes", "policies", ["n_uavs", "n_targets", "n_materials"])

    op.create_table(
        "feature_vectors",
        sa.Column(
            "policy_id", sa.String(128), sa.ForeignKey("policies.id", ondelete="CASCADE"), primary_key=True
        ),
        sa.Column("space", sa.String(256), primary_key=True),
        sa.Column("dimension", sa.Integer, nullable=False),
        sa.Column("vector", sa.LargeBinary, nullable=False),
        sa.CheckConstraint(
            "dimension >= 1 AND length(vector) = 4 * dimension", name="feature_vectors_length"
        ),
    )
    op.create_index("ix_feature_vectors_space", "feature_vectors", ["space"])


def downgrade() -> None:
    """Drop the tables, and with them the library."""
    op.drop_table("feature_vectors")
    op.drop_table("policies")
    op.drop_table("checkpoints")
    op.drop_table("library_revision")
