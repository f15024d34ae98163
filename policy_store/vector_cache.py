"""Feature vectors in memory: one matrix a space, kept as long as the library does not change."""

from __future__ import annotations

import threading
from collections import Counter, OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection, Row, func, select

from policy_store.policy import Vector
from policy_store.tables import feature_vectors, library_revision, policies

_VectorRow = Row[*tuple[Any, ...]]  # id, architecture, vector

_MAX_SPACES = 128
_BYTES = 4
"""Of a number of a vector."""


@dataclass(frozen=True, slots=True, eq=False)
class VectorSpace:
    """The vectors of a space at one revision of the library, in the order of insertion.

    Attributes
    ----------
    revision
        The revision it was read at.
    ids, architectures
        Of the policies, P of each.
    matrix
        Shape (P, D).
    """

    revision: int
    ids: tuple[str, ...]
    architectures: npt.NDArray[np.str_]
    matrix: npt.NDArray[np.float32]


class VectorCache:
    """Reads a space when it is asked for the first time, and what was added since on later calls.

    Other processes may change the library: what is kept is used only at the revision it was read at.
    Threads may share a cache.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._spaces: OrderedDict[str, VectorSpace] = OrderedDict()

    def get(self, connection: Connection, space: str) -> VectorSpace | None:
        """Return the space as the connection's transaction sees it, or None if it has no vectors."""
        revision: int = connection.execute(select(library_revision.c.revision)).scalar_one()
        with self._lock:
            kept = self._spaces.get(space)
            if kept is not None:
                self._spaces.move_to_end(space)
        if kept is not None and kept.revision == revision:
            return kept
        read = None
        if kept is not None and kept.revision < revision:
            read = _extend(connection, space, kept, revision)
        if read is None:
            read = _read(connection, space, revision)
        self._keep(space, read, revision)
        return read

    def _keep(self, space: str, read: VectorSpace | None, revision: int) -> None:
        with self._lock:
            kept = self._spaces.get(space)
            if kept is not None and kept.revision > revision:
                return  # another thread has read a newer state in the meantime
            if read is None:
                self._spaces.pop(space, None)
                return
            self._spaces[space] = read
            self._spaces.move_to_end(space)
            if len(self._spaces) > _MAX_SPACES:
                self._spaces.popitem(last=False)


def _read(connection: Connection, space: str, revision: int) -> VectorSpace | None:
    rows = _rows_after(connection, space, 0)
    return _space(rows, revision) if rows else None


def _extend(connection: Connection, space: str, kept: VectorSpace, revision: int) -> VectorSpace | None:
    """Add the vectors that are new since ``kept`` was read; None if some of its own are gone.

    A place in the order of insertion is never given twice, so the vectors there are now are a part of the
    kept ones and the new ones, and all of them exactly if their number is right.
    """
    rows = _rows_after(connection, space, kept.revision)
    query = select(func.count()).select_from(feature_vectors).where(feature_vectors.c.space == space)
    if connection.execute(query).scalar_one() != len(kept.ids) + len(rows):
        return None
    if not rows:
        return VectorSpace(revision, kept.ids, kept.architectures, kept.matrix)
    new = _space(rows, revision)
    return VectorSpace(
        revision,
        kept.ids + new.ids,
        np.concatenate([kept.architectures, new.architectures]),
        np.concatenate([kept.matrix, new.matrix]),
    )


def _rows_after(connection: Connection, space: str, sequence: int) -> Sequence[_VectorRow]:
    query = (
        select(policies.c.id, policies.c.architecture, feature_vectors.c.vector)
        .join(feature_vectors, feature_vectors.c.policy_id == policies.c.id)
        .where(feature_vectors.c.space == space, policies.c.sequence > sequence)
        .order_by(policies.c.sequence)
    )
    return connection.execute(query).all()


def _space(rows: Sequence[_VectorRow], revision: int) -> VectorSpace:
    """Put vectors together; those of another length than most, or with numbers not finite, are left out."""
    length, _ = Counter(len(row.vector) for row in rows).most_common(1)[0]
    rows = [
        row for row in rows if len(row.vector) == length and np.isfinite(vector_from_bytes(row.vector)).all()
    ]
    matrix = vector_from_bytes(b"".join(row.vector for row in rows)).reshape(len(rows), length // _BYTES)
    return VectorSpace(
        revision, tuple(row.id for row in rows), np.array([row.architecture for row in rows]), matrix
    )


def vector_to_bytes(vector: Vector) -> bytes:
    """Turn a vector, shape (D,), into 4 · D bytes, little-endian whatever the machine."""
    return vector.astype("<f4").tobytes()


def vector_from_bytes(data: bytes) -> Vector:
    """Turn 4 · D little-endian bytes into a read-only vector, shape (D,)."""
    return np.frombuffer(data, dtype="<f4").astype(np.float32, copy=False)
