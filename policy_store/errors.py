"""Every error that the policy store raises on purpose.

PolicyStoreError
 ├─ UnsupportedDatabase     the URL names a database that the store cannot use
 ├─ DatabaseUnusable        the file or its folder cannot be written
 ├─ DatabaseOccupied        another service works on the file
 ├─ MigrationFailed         the tables cannot be brought to this version
 ├─ BackupFailed            the database cannot be copied
 ├─ NestedWrite             a thread that is inside a write transaction asked for a second one
 ├─ PolicyNotFound          no policy has that id
 ├─ DuplicatePolicy         another policy already has that id
 ├─ InvalidPolicy           a field of a policy cannot be stored
 ├─ InvalidVector           a feature vector cannot be compared with those of its space
 ├─ InvalidCursor           a page was asked for with a cursor that no page gave out
 ├─ InvalidContainer        bytes are not an acceptable safetensors file
 └─ CorruptCheckpoint       stored bytes no longer have the SHA-256 they were stored under

Errors of the database itself (disk full, locked for longer than the busy timeout) stay SQLAlchemy's.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


class PolicyStoreError(Exception):
    """Root of the tree."""


class UnsupportedDatabase(PolicyStoreError):
    """The URL names a database that the store cannot use."""

    def __init__(self, url: str, reason: str) -> None:
        super().__init__(f"database {url!r} cannot be used: {reason}")
        self.url = url
        self.reason = reason


class DatabaseUnusable(PolicyStoreError):
    """The database file or its folder cannot be written."""

    def __init__(self, database: str, reason: str) -> None:
        super().__init__(f"database {database} cannot be written: {reason}")
        self.database = database
        self.reason = reason


class DatabaseOccupied(PolicyStoreError):
    """Another service works on the file; ``holder`` says which, if that is known."""

    def __init__(self, database: str, holder: str) -> None:
        super().__init__(
            f"another service{f' ({holder})' if holder else ''} works on database {database}, and only one "
            "can at a time: stop it, or let several share a PostgreSQL database"
        )
        self.database = database
        self.holder = holder


class MigrationFailed(PolicyStoreError):
    """The tables cannot be brought to this version; they are as they were before."""

    def __init__(self, folder: str, reason: str) -> None:
        super().__init__(f"migrations of {folder} failed: {reason}")
        self.folder = folder
        self.reason = reason


class BackupFailed(PolicyStoreError):
    """The database cannot be copied; the target is not there."""

    def __init__(self, source: Path, reason: str) -> None:
        super().__init__(f"no backup of {source}: {reason}")
        self.source = source
        self.reason = reason


class NestedWrite(PolicyStoreError):
    """A thread inside a write transaction asked for a second one, which would wait for itself."""

    def __init__(self, database: str) -> None:
        super().__init__(
            f"this thread already writes to {database}: pass its connection on instead of opening another"
        )
        self.database = database


class PolicyNotFound(PolicyStoreError):
    """No policy has that id."""

    def __init__(self, policy_id: str) -> None:
        super().__init__(f"there is no policy {policy_id!r}")
        self.policy_id = policy_id


class DuplicatePolicy(PolicyStoreError):
    """Another policy already has that id; ``fields`` names what differs."""

    def __init__(self, policy_id: str, fields: Sequence[str]) -> None:
        super().__init__(f"policy {policy_id!r} exists already with another {', '.join(fields)}")
        self.policy_id = policy_id
        self.fields = tuple(fields)


class InvalidPolicy(PolicyStoreError):
    """A field of a policy cannot be stored."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"policy field {field}: {reason}")
        self.field = field
        self.reason = reason


class InvalidVector(PolicyStoreError):
    """A feature vector cannot be compared with those of its space."""

    def __init__(self, space: str, reason: str) -> None:
        super().__init__(f"vector of space {space!r}: {reason}")
        self.space = space
        self.reason = reason


class InvalidCursor(PolicyStoreError):
    """A page was asked for with a cursor that no page gave out."""

    def __init__(self, cursor: str) -> None:
        super().__init__(f"{cursor!r} is not a cursor of a page of policies")
        self.cursor = cursor


class InvalidContainer(PolicyStoreError):
    """Bytes are not an acceptable safetensors file, or not the one that was expected."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"not an acceptable checkpoint: {reason}")
        self.reason = reason


class CorruptCheckpoint(PolicyStoreError):
    """Stored bytes no longer have the SHA-256 they were stored under."""

    def __init__(self, policy_id: str, expected: str, actual: str) -> None:
        super().__init__(f"checkpoint of policy {policy_id!r} has SHA-256 {actual}, stored as {expected}")
        self.policy_id = policy_id
        self.expected = expected
        self.actual = actual
