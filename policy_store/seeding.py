"""Policies that a program brings with it: each is put in once, and one that was deleted stays deleted."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from sqlalchemy import Connection, insert, select

from policy_store.database import Database
from policy_store.errors import DuplicatePolicy
from policy_store.library import PolicyLibrary
from policy_store.policy import NewPolicy
from policy_store.tables import seeded_policies

SEEDED_BEFORE = "*"
"""Stands for all policies that were seeded by versions that kept no records of it."""


def seeded_ids(database: Database) -> set[str]:
    """Return the ids of all policies that were ever seeded, those that were deleted since included.

    :data:`SEEDED_BEFORE` is among them where a version without records has been at work.
    """
    with database.read() as connection:
        return _ids(connection)


def seed(library: PolicyLibrary, database: Database, policies: Sequence[NewPolicy]) -> int:
    """Add policies with fixed ids that were never seeded before, all of them or none, and remember it.

    One whose id somebody else's policy has is left out for good.

    Returns
    -------
    int
        How many were added.
    """
    before = library.count()
    with database.write() as connection:
        # Two processes may begin at the same time.
        database.take_turn(connection, seeded_policies.name)
        known = _ids(connection)
        for policy in policies:
            if policy.id in known:
                continue
            with suppress(DuplicatePolicy):
                library.add(policy, connection)
            connection.execute(insert(seeded_policies), {"id": policy.id})
    return library.count() - before


def _ids(connection: Connection) -> set[str]:
    return set(connection.execute(select(seeded_policies.c.id)).scalars())
