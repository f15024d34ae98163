"""The engines of one database, and what tells its kinds apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sqlalchemy import Engine

from policy_store.occupation import Occupation


@dataclass(frozen=True, slots=True)
class Engines:
    """How one database is opened.

    Attributes
    ----------
    write, read, migrate
        One engine for each purpose.
    lock_name
        Under which name the writers of this process take turns.
    shared
        Whether several processes, on several machines, may work on it at the same time; its writers then
        take no turns.
    environment
        Variables that hold what was taken out of the URL because nobody should read it.
    occupation
        What keeps other services off; None where several may work on it.
    """

    write: Engine
    read: Engine
    migrate: Engine
    lock_name: str
    shared: bool = False
    environment: Mapping[str, str] = field(default_factory=dict)
    occupation: Occupation | None = None
