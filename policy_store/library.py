"""The policy library (the paper's strategy library): source tasks and their network parameters.

Every method is one transaction of its own, unless a connection is handed to it: then it is a part of the
caller's, and counts only if that is committed.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection, Row, delete, exists, func, insert, select, update

from policy_store import similarity
from policy_store.checkpoint import ContainerLimits, read_container
from policy_store.database import Database
from policy_store.errors import (
    CorruptCheckpoint,
    DuplicatePolicy,
    InvalidCursor,
    InvalidVector,
    PolicyNotFound,
)
from policy_store.policy import Neighbour, NewPolicy, Policy, PolicyPage, Vector, as_vector
from policy_store.policy_cache import PolicyCache
from policy_store.tables import checkpoints, feature_vectors, library_revision, policies
from policy_store.vector_cache import VectorCache, vector_from_bytes, vector_to_bytes

_MIGRATIONS = Path(__file__).parent / "migrations"
_VERSION_TABLE = "alembic_version_library"
_POLICY_COLUMNS = [column for column in policies.c if column.name != "sequence"]
_SELECT_POLICY = select(*_POLICY_COLUMNS, checkpoints.c.size.label("checkpoint_size")).join(
    checkpoints, checkpoints.c.sha256 == policies.c.checkpoint_sha256
)
_DEFAULT_LIMITS = ContainerLimits()
_IDS_PER_QUERY = 500  # databases bound the parameters of one statement
_MAX_SEQUENCE_DIGITS = 18


class PolicyLibrary:
    """Source tasks with their checkpoints and feature vectors, in a database.

    Parameters
    ----------
    database
        Where they are kept; :meth:`migrate` makes the tables.
    limits
        What a checkpoint may have at most to be taken in.
    """

    def __init__(self, database: Database, limits: ContainerLimits = _DEFAULT_LIMITS) -> None:
        self._database = database
        self._limits = limits
        self._vectors, self._nearest = VectorCache(), PolicyCache()

    def migrate(self) -> None:
        """Make the tables, or bring them to this version; nothing happens if they are.

        Raises
        ------
        MigrationFailed
            If the tables are newer than this program.
        """
        self._database.migrate(_MIGRATIONS, _VERSION_TABLE)

    def add(self, new: NewPolicy, connection: Connection | None = None) -> Policy:
        """Add a policy, or return the one there is if it has the same id and the same content.

        Parameters
        ----------
        new
            What to add.
        connection
            A write transaction to be a part of.

        Raises
        ------
        InvalidContainer
            If the checkpoint is not a safetensors file within the limits.
        DuplicatePolicy
            If another policy already has that id.
        InvalidVector
            If the vectors of its space have another dimension.
        """
        read_container(new.checkpoint, self._limits)
        sha256 = hashlib.sha256(new.checkpoint).hexdigest()
        values = {
            "name": new.name,
            "n_uavs": new.n_uavs,
            "n_targets": new.n_targets,
            "n_materials": new.n_materials,
            "task": new.task,
            "architecture": new.architecture,
            "algorithm": new.algorithm,
            "seed": new.seed,
            "metrics": new.metrics,
            "metadata": new.metadata,
            "checkpoint_sha256": sha256,
        }
        with self._writing(connection) as writing:
            sequence = _next_revision(writing)
            if new.id is not None and (present := _find(writing, new.id)) is not None:
                _require_same(present, values, new.vectors, _vectors_of(writing, new.id))
                return present
            policy_id = new.id or f"pol_{secrets.token_hex(10)}"
            for space, vector in new.vectors.items():
                _require_dimension(writing, space, len(vector))
            _store_checkpoint(writing, sha256, new.checkpoint)
            row = {"id": policy_id, "sequence": sequence, "created_at": datetime.now(UTC), **values}
            writing.execute(insert(policies), row)
            if new.vectors:
                vector_rows = [
                    {
                        "policy_id": policy_id,
                        "space": space,
                        "dimension": len(vector),
                        "vector": vector_to_bytes(vector),
                    }
                    for space, vector in new.vectors.items()
                ]
                writing.execute(insert(feature_vectors), vector_rows)
            return _get(writing, policy_id)

    def get(self, policy_id: str) -> Policy:
        """Return a policy.

        Raises
        ------
        PolicyNotFound
            If there is none with that id.
        """
        with self._database.read() as connection:
            return _get(connection, policy_id)

    def vectors(self, policy_id: str) -> dict[str, Vector]:
        """Return the feature vectors of a policy by their space.

        Raises
        ------
        PolicyNotFound
            If there is none with that id.
        """
        with self._database.read() as connection:
            _get(connection, policy_id)
            return _vectors_of(connection, policy_id)

    def page(self, limit: int, cursor: str | None = None) -> PolicyPage:
        """Return some policies, newest first.

        Whoever follows the cursors sees each policy once that was there all along, also while others are
        added or deleted; those added after the first page are not seen.

        Parameters
        ----------
        limit
            How many, at least 1.
        cursor
            ``next_cursor`` of the page before, or None for the first.

        Raises
        ------
        InvalidCursor
            If no page gave the cursor out.
        ValueError
            If the limit is less than 1.
        """
        if limit < 1:
            raise ValueError(f"limit is {limit}, at least 1 policy can be asked for")
        query = _SELECT_POLICY.add_columns(policies.c.sequence).order_by(policies.c.sequence.desc())
        if cursor is not None:
            query = query.where(policies.c.sequence < _sequence_of(cursor))
        with self._database.read() as connection:
            rows = connection.execute(query.limit(limit + 1)).all()
        shown = rows[:limit]
        more = len(rows) > limit
        return PolicyPage(tuple(map(_policy, shown)), str(shown[-1].sequence) if more else None)

    def delete(self, policy_id: str, connection: Connection | None = None) -> None:
        """Delete a policy, and its checkpoint if no other policy has the same.

        Raises
        ------
        PolicyNotFound
            If there is none with that id.
        """
        with self._writing(connection) as writing:
            _next_revision(writing)
            sha256 = _get(writing, policy_id).checkpoint_sha256
            writing.execute(delete(policies).where(policies.c.id == policy_id))
            shared = exists().where(policies.c.checkpoint_sha256 == checkpoints.c.sha256)
            writing.execute(delete(checkpoints).where(checkpoints.c.sha256 == sha256, ~shared))

    def checkpoint(self, policy_id: str) -> bytes:
        """Return the safetensors file of a policy, after comparing its SHA-256.

        Raises
        ------
        PolicyNotFound
            If there is no policy with that id.
        CorruptCheckpoint
            If the bytes are not those that were stored.
        """
        query = (
            select(checkpoints.c.sha256, checkpoints.c.data)
            .join(policies, policies.c.checkpoint_sha256 == checkpoints.c.sha256)
            .where(policies.c.id == policy_id)
        )
        with self._database.read() as connection:
            row = connection.execute(query).one_or_none()
        if row is None:
            raise PolicyNotFound(policy_id)
        data = bytes(row.data)
        actual = hashlib.sha256(data).hexdigest()
        if actual != row.sha256:
            raise CorruptCheckpoint(policy_id, row.sha256, actual)
        return data

    def nearest(
        self,
        space: str,
        vector: npt.ArrayLike,
        k: int,
        architecture: str | None = None,
        *,
        without: str | None = None,
    ) -> list[Neighbour]:
        """Find the policies whose source tasks are most similar (Algorithm 2, lines 1 to 6).

        Parameters
        ----------
        space
            The kind of vector, see :class:`NewPolicy`.
        vector
            Shape (D,), the description of the new task.
        k
            How many at most, at least 1.
        architecture
            Only policies of this architecture.
        without
            No policies of this architecture.

        Returns
        -------
        list
            Nearest first; among equals the one added last, as in Algorithm 2. Empty if the space has no
            policies.

        Raises
        ------
        InvalidVector
            If the vector has another dimension than the space, or numbers that are not finite.
        ValueError
            If k is less than 1.
        """
        if k < 1:
            raise ValueError(f"k is {k}, at least 1 neighbour can be asked for")
        query = as_vector(space, vector)
        with self._database.read() as connection:
            known = self._vectors.get(connection, space)
            if known is None:
                return []
            ids, matrix = known.ids, known.matrix
            if len(query) != matrix.shape[1]:
                raise InvalidVector(space, f"it has {len(query)} numbers, the space has {matrix.shape[1]}")
            if architecture is not None or without is not None:
                wanted = np.ones(len(ids), np.bool_)
                if architecture is not None:
                    wanted &= known.architectures == architecture
                if without is not None:
                    wanted &= known.architectures != without
                chosen = np.flatnonzero(wanted)
                ids, matrix = tuple(ids[index] for index in chosen), matrix[chosen]
            indices, distances = similarity.nearest(matrix, query, k)
            near = [ids[index] for index in indices]
            found = self._nearest.get(known.revision, near, lambda ids: _get_many(connection, ids))
        return [Neighbour(*pair) for pair in zip(found, distances.tolist(), strict=True)]

    def sizes(self, architecture: str | None = None) -> list[tuple[int, int, int]]:
        """List the sizes (M, N, K) of the source tasks there are, each once, in ascending order.

        Parameters
        ----------
        architecture
            Only policies of this architecture.
        """
        columns = (policies.c.n_uavs, policies.c.n_targets, policies.c.n_materials)
        query = select(*columns).distinct().order_by(*columns)
        if architecture is not None:
            query = query.where(policies.c.architecture == architecture)
        with self._database.read() as connection:
            return [(row[0], row[1], row[2]) for row in connection.execute(query)]

    def count(self) -> int:
        """Return how many policies there are."""
        with self._database.read() as connection:
            return connection.execute(select(func.count()).select_from(policies)).scalar_one()

    def _writing(self, connection: Connection | None) -> AbstractContextManager[Connection]:
        return self._database.write() if connection is None else nullcontext(connection)


def _next_revision(connection: Connection) -> int:
    """Announce a change; first in every write, for its row is what writers on a server wait for."""
    query = (
        update(library_revision)
        .values(revision=library_revision.c.revision + 1)
        .returning(library_revision.c.revision)
    )
    revision: int = connection.execute(query).scalar_one()
    return revision


def _policy(row: Row[*tuple[Any, ...]]) -> Policy:
    values = row._asdict()
    values.pop("sequence", None)
    return Policy(**values)


def _find(connection: Connection, policy_id: str) -> Policy | None:
    row = connection.execute(_SELECT_POLICY.where(policies.c.id == policy_id)).one_or_none()
    return None if row is None else _policy(row)


def _get(connection: Connection, policy_id: str) -> Policy:
    policy = _find(connection, policy_id)
    if policy is None:
        raise PolicyNotFound(policy_id)
    return policy


def _get_many(connection: Connection, ids: list[str]) -> dict[str, Policy]:
    found: dict[str, Policy] = {}
    for start in range(0, len(ids), _IDS_PER_QUERY):
        query = _SELECT_POLICY.where(policies.c.id.in_(ids[start : start + _IDS_PER_QUERY]))
        found.update((row.id, _policy(row)) for row in connection.execute(query))
    return found


def _vectors_of(connection: Connection, policy_id: str) -> dict[str, Vector]:
    query = select(feature_vectors.c.space, feature_vectors.c.vector).where(
        feature_vectors.c.policy_id == policy_id
    )
    return {row.space: vector_from_bytes(row.vector) for row in connection.execute(query)}


def _require_same(
    present: Policy,
    values: Mapping[str, object],
    vectors: Mapping[str, Vector],
    present_vectors: Mapping[str, Vector],
) -> None:
    different = [name for name, value in values.items() if getattr(present, name) != value]
    same_vectors = vectors.keys() == present_vectors.keys() and all(
        np.array_equal(vector, present_vectors[space]) for space, vector in vectors.items()
    )
    if not same_vectors:
        different.append("vectors")
    if different:
        raise DuplicatePolicy(present.id, different)


def _require_dimension(connection: Connection, space: str, dimension: int) -> None:
    query = select(feature_vectors.c.dimension).where(feature_vectors.c.space == space).limit(1)
    present = connection.execute(query).scalar_one_or_none()
    if present is not None and present != dimension:
        raise InvalidVector(space, f"it has {dimension} numbers, the space has {present}")


def _store_checkpoint(connection: Connection, sha256: str, data: bytes) -> None:
    present = connection.execute(select(checkpoints.c.size).where(checkpoints.c.sha256 == sha256))
    if present.one_or_none() is None:
        connection.execute(insert(checkpoints), {"sha256": sha256, "size": len(data), "data": data})


def _sequence_of(cursor: str) -> int:
    if not (cursor.isascii() and cursor.isdigit() and len(cursor) <= _MAX_SEQUENCE_DIGITS):
        raise InvalidCursor(cursor)
    return int(cursor)
