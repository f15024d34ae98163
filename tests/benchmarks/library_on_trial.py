"""A library of policies for every size alone, in a database that goes away: for benchmarks of transfer."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.learning.paper.architecture import QMIX_PAPER_1
from app.library.seeding import add_policies, read_policies, shipped_policies
from policy_store.database import Database
from policy_store.library import PolicyLibrary
from policy_store.policy import NewPolicy


def policies_for_every_size(folder: Path | None) -> list[NewPolicy]:
    """Read them from a folder of checkpoints; the shipped ones where it is None."""
    found = shipped_policies() if folder is None else read_policies(folder)
    chosen = [policy for policy in found if policy.architecture != QMIX_PAPER_1]
    if not chosen:
        raise SystemExit(f"no policy for every size in {folder or 'the shipped library'}")
    return chosen


@contextmanager
def library_of(policies: list[NewPolicy]) -> Iterator[str]:
    """Make a library of some policies; yield its address."""
    with tempfile.TemporaryDirectory() as folder:
        database = Database(f"sqlite:///{Path(folder) / 'library.sqlite3'}")
        library = PolicyLibrary(database)
        library.migrate()
        add_policies(library, database, policies)
        try:
            yield database.url
        finally:
            database.dispose()
