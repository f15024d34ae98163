"""API keys: made once, shown once, kept as a digest.

A key is ``ID.SECRET``. The id is public: lists and logs may name it. The secret has 32 random bytes, so its
SHA-256 needs neither salt nor stretching: there is nothing to guess.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

import sqlalchemy as sa

from policy_store.database import Database

MIGRATIONS = Path(__file__).parent / "migrations"
VERSION_TABLE = "alembic_version_access"

_ID_BYTES, _SECRET_BYTES = 6, 32
_LONGEST_NAME = 256

_NOT_IN_A_LINE = frozenset({"Cc", "Cs", "Zl", "Zp"})

metadata = sa.MetaData()

api_keys = sa.Table(
    "api_keys",
    metadata,
    sa.Column("id", sa.String(12), primary_key=True),
    sa.Column("name", sa.String(_LONGEST_NAME), nullable=False),
    sa.Column("role", sa.String(16), nullable=False),
    sa.Column("digest", sa.LargeBinary(32), nullable=False),
    sa.Column("created_at", sa.Double, nullable=False),
    # Revoked keys stay: a service whose last key was revoked must not become one that needs none.
    sa.Column("revoked_at", sa.Double),
)


class Role(StrEnum):
    """What a key allows.

    Attributes
    ----------
    ALLOCATE
        Allocations, jobs, and everything that only reads.
    LIBRARY
        Registering and deleting policies too.
    """

    ALLOCATE = "allocate"
    LIBRARY = "library"

    def allows(self, needed: Role) -> bool:
        """Say whether a key of this role may do what needs the other one."""
        return self is Role.LIBRARY or needed is Role.ALLOCATE


@dataclass(frozen=True, slots=True)
class ApiKey:
    """A key without its secret.

    Attributes
    ----------
    id
        Public part.
    name
        Who or what it was made for.
    role
        What it allows.
    digest
        SHA-256 of the secret, 32 bytes.
    created_at, revoked_at
        UTC; a key that is not revoked has None.
    """

    id: str
    name: str
    role: Role
    digest: bytes
    created_at: datetime
    revoked_at: datetime | None


class KeyStore:
    """The table of keys.

    Parameters
    ----------
    database
        Where the table is, or will be.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def migrate(self) -> None:
        """Make the table, or bring it to this version."""
        self._database.migrate(MIGRATIONS, VERSION_TABLE)

    def create(self, name: str, role: Role) -> tuple[ApiKey, str]:
        """Make a key.

        Raises
        ------
        ValueError
            If the name is empty, longer than a name, or has tabs, line breaks or other control characters.

        Returns
        -------
        key
            As it is stored.
        token
            What a client sends; it is nowhere else and cannot be had again.
        """
        if not 1 <= len(name) <= _LONGEST_NAME:
            raise ValueError(f"a name of {len(name)} characters, not of 1 to {_LONGEST_NAME}")
        if in_a_line(name) != name:
            raise ValueError(f"the name {name!r} has tabs, line breaks or other control characters")
        secret = secrets.token_urlsafe(_SECRET_BYTES)
        key = ApiKey(
            secrets.token_hex(_ID_BYTES), name, role, _digest(secret), datetime.now(UTC), revoked_at=None
        )
        with self._database.write() as connection:
            connection.execute(
                sa.insert(api_keys).values(
                    id=key.id,
                    name=name,
                    role=role,
                    digest=key.digest,
                    created_at=key.created_at.timestamp(),
                )
            )
        return key, f"{key.id}.{secret}"

    def revoke(self, key_id: str) -> bool:
        """Revoke a key; False if there is none of that id that was not revoked."""
        with self._database.write() as connection:
            changed = connection.execute(
                sa.update(api_keys)
                .where(api_keys.c.id == key_id, api_keys.c.revoked_at.is_(None))
                .values(revoked_at=time.time())
            )
            return bool(changed.rowcount)

    def all(self) -> list[ApiKey]:
        """List the keys, revoked ones too, oldest first."""
        with self._database.read() as connection:
            rows = connection.execute(sa.select(api_keys).order_by(api_keys.c.created_at)).all()
        return [
            ApiKey(
                row.id,
                row.name,
                Role(row.role),
                row.digest,
                datetime.fromtimestamp(row.created_at, UTC),
                None if row.revoked_at is None else datetime.fromtimestamp(row.revoked_at, UTC),
            )
            for row in rows
        ]


def in_a_line(name: str) -> str:
    """Write a name without what would break a line of a list or a terminal."""
    return "".join("\ufffd" if unicodedata.category(each) in _NOT_IN_A_LINE else each for each in name)


def recognise(token: str, keys: Mapping[str, ApiKey]) -> ApiKey | None:
    """Return the key that a token is of; None if there is none, or it was revoked.

    Parameters
    ----------
    token
        What a client sent.
    keys
        The keys by id.
    """
    key_id, _, secret = token.partition(".")
    key = keys.get(key_id)
    if key is None or key.revoked_at is not None or not hmac.compare_digest(_digest(secret), key.digest):
        return None
    return key


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.encode()).digest()
