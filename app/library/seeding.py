"""The shipped source policies, with which an empty library begins."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from importlib.resources.abc import Traversable

from app.domain.errors import InvalidCheckpoint
from app.domain.records import problem_from_record
from app.library.entries import checkpoint_metadata, new_policy
from policy_store.database import Database
from policy_store.library import PolicyLibrary
from policy_store.policy import NewPolicy

_SUFFIX = ".safetensors"


def shipped_policies() -> list[NewPolicy]:
    """Read the policies in the folder ``seed`` beside this module; see :func:`read_policies`."""
    return read_policies(resources.files("app.library") / "seed")


def read_policies(folder: Traversable) -> list[NewPolicy]:
    """Read the policies in a folder, in the order of their file names; none where there is no folder.

    A file's name is the policy's id, its metadata has the source task and, under ``name``, a name for
    people.

    Raises
    ------
    InvalidCheckpoint
        If a file is damaged.
    """
    if not folder.is_dir():
        return []
    found = []
    for file in sorted(folder.iterdir(), key=lambda item: item.name):
        if not file.name.endswith(_SUFFIX):
            continue
        identifier = file.name.removesuffix(_SUFFIX)
        data = file.read_bytes()
        metadata = checkpoint_metadata(data)
        try:
            task = problem_from_record(metadata["task"])
        except (KeyError, TypeError) as error:
            raise InvalidCheckpoint(f"{file.name}: its metadata has no source task") from error
        found.append(new_policy(str(metadata.get("name", identifier)), task, data, policy_id=identifier))
    return found


def seed_library(library: PolicyLibrary, database: Database) -> int:
    """Put the shipped policies into an empty library; see :func:`add_policies`.

    Parameters
    ----------
    library
        The library; nothing happens if it has any policy.
    database
        The database it is in.

    Returns
    -------
    int
        How many policies were put in.
    """
    if library.count():
        return 0
    return add_policies(library, database, shipped_policies())


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
