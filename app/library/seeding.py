"""The shipped source policies: each comes into a library once, with the version that brings it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from importlib import resources
from importlib.resources.abc import Traversable

from app.domain.errors import InvalidCheckpoint
from app.domain.records import problem_from_record
from app.library.entries import checkpoint_metadata, new_policy
from policy_store.database import Database
from policy_store.library import PolicyLibrary
from policy_store.policy import NewPolicy
from policy_store.seeding import SEEDED_BEFORE, seed, seeded_ids

_SUFFIX = ".safetensors"


_SIZES_BEFORE = (
    *(f"{m}x{n}x3" for m in (5, 10, 20) for n in (5, 10, 20, 30)),
    "11x19x1",
)
_FAMILIES_BEFORE = (
    "clustered",
    "corridor",
    "deadline",
    "mid-mission",
    "mixed-loads",
    "scarce",
    "single-base",
    "uniform",
)
SHIPPED_BEFORE = frozenset(
    [
        *(f"{family}-{size}" for family in ("clustered", "uniform") for size in _SIZES_BEFORE),
        *(f"universal-3-{family}" for family in _FAMILIES_BEFORE),
        "universal-3",
    ]
)
"""Ids of what versions shipped that kept no records of it."""


def shipped_policies(known: Collection[str] = ()) -> list[NewPolicy]:
    """Read the policies in the folder ``seed`` beside this module; see :func:`read_policies`."""
    return read_policies(resources.files("app.library") / "seed", known)


def read_policies(folder: Traversable, known: Collection[str] = ()) -> list[NewPolicy]:
    """Read the policies in a folder, in the order of their file names; none where there is no folder.

    A file's name is the policy's id, its metadata has the source task and, under ``name``, a name for
    people.

    Parameters
    ----------
    folder
        Where they are.
    known
        Ids of those that are not read.

    Raises
    ------
    InvalidCheckpoint
        If a file is damaged.
    """
    if not folder.is_dir():
        return []
    found = []
    for file in sorted(folder.iterdir(), key=lambda item: item.name):
        identifier = file.name.removesuffix(_SUFFIX)
        if not file.name.endswith(_SUFFIX) or identifier in known:
            continue
        data = file.read_bytes()
        metadata = checkpoint_metadata(data)
        try:
            task = problem_from_record(metadata["task"])
        except (KeyError, TypeError) as error:
            raise InvalidCheckpoint(f"{file.name}: its metadata has no source task") from error
        found.append(new_policy(str(metadata.get("name", identifier)), task, data, policy_id=identifier))
    return found


def seed_library(library: PolicyLibrary, database: Database) -> int:
    """Put the shipped policies into a library that were never put into it before.

    So a new version's come with it, and those that somebody has deleted stay deleted. Two processes may do so
    at the same time.

    Parameters
    ----------
    library
        The library.
    database
        The database it is in.

    Returns
    -------
    int
        How many were put in.
    """
    known = seeded_ids(database)
    if SEEDED_BEFORE in known:
        known |= SHIPPED_BEFORE
    new = shipped_policies(known)
    return seed(library, database, new) if new else 0


def add_policies(library: PolicyLibrary, database: Database, policies: Sequence[NewPolicy]) -> int:
    """Put policies with fixed ids into a library, all of them or none.

    Two processes may do so at the same time: the second finds them there.

    Returns
    -------
    int
        How many were not there before.
    """
    before = library.count()
    with database.write() as connection:
        for policy in policies:
            library.add(policy, connection)
    return library.count() - before
