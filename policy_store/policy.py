"""What the library holds: policies, as they are given to it and as it returns them."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np
import numpy.typing as npt

from policy_store.errors import InvalidPolicy, InvalidVector
from policy_store.soundness import fault_of, is_storable

Vector = npt.NDArray[np.float32]

ID_PATTERN = r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}"
"""A policy's id: letters, digits, ``.``, ``_``, ``-``, at most 128."""
_TEXT_LENGTHS = {"name": 256, "architecture": 128, "algorithm": 128}
_MAX_SPACE_LENGTH = 256
_MAX_COUNT = 2**31 - 1
_MAX_SEED = 2**63 - 1


def as_vector(space: str, values: npt.ArrayLike) -> Vector:
    """Make a feature vector: an own read-only copy, shape (D,), float32.

    Raises
    ------
    InvalidVector
        If it is not one row of at least one number, or a number is not finite in single precision.
    """
    with np.errstate(over="ignore"):
        vector = np.array(values, dtype=np.float32)
    if vector.ndim != 1 or vector.size == 0:
        raise InvalidVector(space, f"it has shape {vector.shape}, not (D,) with D at least 1")
    if not np.isfinite(vector).all():
        raise InvalidVector(space, "it has numbers that are not finite")
    vector.flags.writeable = False
    return vector


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NewPolicy:
    """A trained source task on its way into the library; validated and copied at construction.

    Attributes
    ----------
    name
        For people; need not be unique.
    n_uavs, n_targets, n_materials
        The size of the source task: M, N, K.
    task
        The source task itself, JSON-ready.
    architecture, algorithm
        What network the checkpoint is for, and what trained it.
    checkpoint
        A safetensors file.
    vectors
        Feature vectors of the task by their space. Only vectors of one space are compared, so its name
        holds everything that must agree: the kind of features, their version and, where the dimension
        depends on it, the size.
    seed
        The seed of the training, or None.
    metrics, metadata
        What was measured and what else is known, JSON-ready.
    id
        Letters, digits, ``.``, ``_``, ``-``, at most 128; None has one made.

    Raises
    ------
    InvalidPolicy
        If a field cannot be stored.
    InvalidVector
        If a vector is not a row of finite numbers.
    """

    name: str
    n_uavs: int
    n_targets: int
    n_materials: int
    task: Mapping[str, Any]
    architecture: str
    algorithm: str
    checkpoint: bytes
    vectors: Mapping[str, Vector]
    seed: int | None = None
    metrics: Mapping[str, Any] = field(default_factory=dict)
    metadata: Mapping[str, Any] = field(default_factory=dict)
    id: str | None = None

    def __post_init__(self) -> None:
        if self.id is not None and not re.fullmatch(ID_PATTERN, self.id):
            raise InvalidPolicy("id", f"{self.id!r} is not 1 to 128 letters, digits, '.', '_' or '-'")
        for name, length in _TEXT_LENGTHS.items():
            _require_text(name, getattr(self, name), length)
        for name in ("n_uavs", "n_targets", "n_materials"):
            _require_integer(name, getattr(self, name), 1, _MAX_COUNT)
        if self.seed is not None:
            _require_integer("seed", self.seed, -_MAX_SEED - 1, _MAX_SEED)
        for name in ("task", "metrics", "metadata"):
            object.__setattr__(self, name, _as_json(name, getattr(self, name)))
        for space in self.vectors:
            _require_text("vectors", space, _MAX_SPACE_LENGTH)
        vectors = {space: as_vector(space, values) for space, values in self.vectors.items()}
        object.__setattr__(self, "vectors", vectors)


@dataclass(frozen=True, slots=True)
class Policy:
    """A stored policy; its weights are read apart, by ``PolicyLibrary.checkpoint``.

    Attributes
    ----------
    created_at
        When it was added, in UTC.
    checkpoint_sha256, checkpoint_size
        Of its safetensors file; lower-case hexadecimal, and bytes.

    The other attributes are those of :class:`NewPolicy`.
    """

    id: str
    name: str
    n_uavs: int
    n_targets: int
    n_materials: int
    task: Mapping[str, Any]
    architecture: str
    algorithm: str
    seed: int | None
    metrics: Mapping[str, Any]
    metadata: Mapping[str, Any]
    created_at: datetime
    checkpoint_sha256: str
    checkpoint_size: int


@dataclass(frozen=True, slots=True)
class PolicyPage:
    """Some policies, newest first; ``next_cursor`` asks for those that follow, None if there are none."""

    policies: tuple[Policy, ...]
    next_cursor: str | None


@dataclass(frozen=True, slots=True)
class Neighbour:
    """A policy and the sum of squared differences between its source task and the task asked about."""

    policy: Policy
    distance: float


def _require_text(name: str, value: object, max_length: int) -> None:
    if not isinstance(value, str) or not 1 <= len(value) <= max_length:
        raise InvalidPolicy(name, f"not a text of 1 to {max_length} characters")
    _require_storable(name, value)


def _require_storable(name: str, text: str) -> None:
    """Refuse what no database stores: half of a surrogate pair, and the null character."""
    if not is_storable(text):
        raise InvalidPolicy(name, "it has text that is not Unicode or a null character")


def _require_integer(name: str, value: object, low: int, high: int) -> None:
    if type(value) is not int or not low <= value <= high:
        raise InvalidPolicy(name, f"{value!r} is not an integer from {low} to {high}")


def _as_json(name: str, value: object) -> dict[str, Any]:
    """Copy a JSON object, as it will be when it is read back."""
    if not isinstance(value, Mapping):
        raise InvalidPolicy(name, "not an object")
    fault = fault_of(dict(value))
    if fault is not None:
        raise InvalidPolicy(name, fault)
    copy: dict[str, Any] = json.loads(json.dumps(dict(value)))
    return copy
