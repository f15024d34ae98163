"""The tables of the policy library, as SQLAlchemy sees them; ``migrations/`` makes them."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    CheckConstraint,
    Column,
    DateTime,
    Dialect,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
)
from sqlalchemy.types import TypeDecorator

from policy_store.soundness import fault_of

metadata = MetaData()


class UtcDateTime(TypeDecorator[datetime]):
    """A moment in UTC; SQLite keeps no time zone, so it is put back when a row is read."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:  # noqa: ARG002 - as SQLAlchemy has it
        """Convert to UTC."""
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:  # noqa: ARG002 - as SQLAlchemy has it
        """Attach UTC where the database dropped it."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class SoundJSON(TypeDecorator[dict[str, Any]]):
    """A JSON object. One that is damaged, or that an earlier version let in, is read as an empty one.

    A row that cannot be read would otherwise break every list that it is in.
    """

    impl = JSON
    cache_ok = True

    def result_processor(self, dialect: Dialect, coltype: object) -> Callable[[Any], Any]:
        """Return what reads a value."""
        read = super().result_processor(dialect, coltype)

        def read_or_leave(value: Any) -> Any:
            try:
                found = value if read is None else read(value)
            except (ValueError, RecursionError):
                return {}
            return found if isinstance(found, dict) and fault_of(found) is None else {}

        return read_or_leave


# One row. Every write adds one to it first: caches in other processes see that something changed, policies
# take their place in the order of insertion from it, and on a server its row lock makes writers take turns.
library_revision = Table(
    "library_revision",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("revision", BigInteger, nullable=False),
    CheckConstraint("id = 1", name="library_revision_one_row"),
)

# Addressed by content: policies with the same weights share a row, which goes with the last of them.
checkpoints = Table(
    "checkpoints",
    metadata,
    Column("sha256", String(64), primary_key=True),
    Column("size", BigInteger, nullable=False),
    Column("data", LargeBinary, nullable=False),
)

policies = Table(
    "policies",
    metadata,
    Column("id", String(128), primary_key=True),
    Column("sequence", BigInteger, nullable=False),
    Column("name", String(256), nullable=False),
    Column("n_uavs", Integer, nullable=False),
    Column("n_targets", Integer, nullable=False),
    Column("n_materials", Integer, nullable=False),
    Column("task", SoundJSON, nullable=False),
    Column("architecture", String(128), nullable=False),
    Column("algorithm", String(128), nullable=False),
    Column("seed", BigInteger),
    Column("metrics", SoundJSON, nullable=False),
    Column("metadata", SoundJSON, nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("checkpoint_sha256", String(64), ForeignKey("checkpoints.sha256"), nullable=False),
    CheckConstraint("n_uavs >= 1 AND n_targets >= 1 AND n_materials >= 1", name="policies_sizes"),
    Index("ix_policies_sequence", "sequence", unique=True),
    Index("ix_policies_checkpoint", "checkpoint_sha256"),
    Index("ix_policies_sizes", "n_uavs", "n_targets", "n_materials"),
)

# Ids of all policies that were ever seeded, those that were deleted since included; ``*`` stands for what
# versions without this table had seeded.
seeded_policies = Table("seeded_policies", metadata, Column("id", String(128), primary_key=True))

# ``vector`` holds ``dimension`` little-endian float32 numbers.
feature_vectors = Table(
    "feature_vectors",
    metadata,
    Column("policy_id", String(128), ForeignKey("policies.id", ondelete="CASCADE"), primary_key=True),
    Column("space", String(256), primary_key=True),
    Column("dimension", Integer, nullable=False),
    Column("vector", LargeBinary, nullable=False),
    CheckConstraint("dimension >= 1 AND length(vector) = 4 * dimension", name="feature_vectors_length"),
    Index("ix_feature_vectors_space", "space"),
)
