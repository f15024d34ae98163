"""Checkpoints from strangers: a safetensors file is read with suspicion, and nothing is unpickled.

A safetensors file is 8 bytes with the length of its header (unsigned, little-endian), the header as a JSON
object, and the numbers. The format's own reader accepts NaN, duplicate names, shapes of 2**62 elements and
hundreds of thousands of empty tensors; here everything is bounded before anything is built from it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from policy_store.errors import InvalidContainer

_HEADER_LENGTH_BYTES = 8

# Bytes an element, by the format's name of the type.
ITEM_SIZES: Mapping[str, int] = {
    "F64": 8,
    "F32": 4,
    "F16": 2,
    "BF16": 2,
    "I64": 8,
    "I32": 4,
    "I16": 2,
    "I8": 1,
    "U8": 1,
}
_FLOATS = {"F64": "<f8", "F32": "<f4", "F16": "<f2"}
_BFLOAT16_EXPONENT = 0x7F80


@dataclass(frozen=True, slots=True)
class ContainerLimits:
    """What a file may have at most."""

    bytes: int = 32 * 1024 * 1024
    header_bytes: int = 64 * 1024
    tensors: int = 512
    rank: int = 8


@dataclass(frozen=True, slots=True)
class TensorInfo:
    """A tensor's shape, its type by the format's name (``"F32"``), and where in the data its bytes are."""

    shape: tuple[int, ...]
    dtype: str
    begin: int
    end: int


@dataclass(frozen=True, slots=True)
class Container:
    """What a file says it holds; ``data_start`` is where the numbers begin in it."""

    tensors: Mapping[str, TensorInfo]
    metadata: Mapping[str, str]
    data_start: int


_DEFAULT_LIMITS = ContainerLimits()


def read_container(data: bytes, limits: ContainerLimits = _DEFAULT_LIMITS) -> Container:
    """Read the header of a safetensors file.

    Parameters
    ----------
    data
        The whole file.
    limits
        What it may have at most.

    Raises
    ------
    InvalidContainer
        If a limit is passed, the header is not of the format, a name appears twice, a type is unknown, or
        the tensors do not cover the data exactly, without gaps or overlaps. Nothing else is raised,
        whatever the bytes are.
    """
    if len(data) > limits.bytes:
        raise InvalidContainer(f"{len(data)} bytes, at most {limits.bytes} are taken")
    if len(data) < _HEADER_LENGTH_BYTES:
        raise InvalidContainer(f"{len(data)} bytes are too few for a safetensors file")
    length = int.from_bytes(data[:_HEADER_LENGTH_BYTES], "little")
    if length > limits.header_bytes:
        raise InvalidContainer(f"a header of {length} bytes, at most {limits.header_bytes} are taken")
    data_start = _HEADER_LENGTH_BYTES + length
    if data_start > len(data):
        raise InvalidContainer(f"a header of {length} bytes does not fit into a file of {len(data)}")

    header = _parse_header(data[_HEADER_LENGTH_BYTES:data_start])
    metadata = _metadata(header.pop("__metadata__", {}))
    if len(header) > limits.tensors:
        raise InvalidContainer(f"{len(header)} tensors, at most {limits.tensors} are taken")
    tensors = {name: _tensor_info(name, entry, limits) for name, entry in header.items()}
    _require_exact_cover(tensors, len(data) - data_start)
    return Container(tensors, metadata, data_start)


def require_tensors(container: Container, expected: Mapping[str, tuple[Sequence[int], str]]) -> None:
    """Require exactly the tensors of a known architecture.

    Parameters
    ----------
    container
        What a file holds.
    expected
        Shape and type (``"F32"``) of every tensor by its name.

    Raises
    ------
    InvalidContainer
        If a tensor is missing, is one too many, or has another shape or type; the reason lists up to five.
    """
    reasons = [f"tensor {name!r} is missing" for name in expected if name not in container.tensors]
    for name, info in container.tensors.items():
        if name not in expected:
            reasons.append(f"tensor {name!r} is not part of the architecture")
            continue
        shape, dtype = expected[name]
        if (info.shape, info.dtype) != (tuple(shape), dtype):
            reasons.append(
                f"tensor {name!r} is {info.dtype} {list(info.shape)}, not {dtype} {list(shape)} as expected"
            )
    if reasons:
        more = f" (and {len(reasons) - 5} more)" if len(reasons) > 5 else ""
        raise InvalidContainer("; ".join(reasons[:5]) + more)


def require_finite(data: bytes, container: Container) -> None:
    """Require that no number is infinite or NaN.

    Parameters
    ----------
    data
        The file of which ``container`` was read.

    Raises
    ------
    InvalidContainer
        If a tensor has such a number; the reason names the tensor.
    """
    for name, info in container.tensors.items():
        place = memoryview(data)[container.data_start + info.begin : container.data_start + info.end]
        if info.dtype in _FLOATS:
            finite = np.isfinite(np.frombuffer(place, _FLOATS[info.dtype]))
        elif info.dtype == "BF16":
            bits = np.frombuffer(place, "<u2")
            finite = (bits & _BFLOAT16_EXPONENT) != _BFLOAT16_EXPONENT
        else:
            continue
        if not finite.all():
            raise InvalidContainer(f"tensor {name!r} has {np.count_nonzero(~finite)} numbers not finite")


def _parse_header(raw: bytes) -> dict[str, Any]:
    if not raw.startswith(b"{"):
        raise InvalidContainer("its header does not begin with an opening brace")
    try:
        text = raw.decode("utf-8")
        header = json.loads(text, object_pairs_hook=_unique_keys, parse_constant=_no_constant)
    except InvalidContainer:
        raise
    # RecursionError: brackets nested by the thousand. ValueError: broken JSON or UTF-8, or huge integers.
    except (ValueError, RecursionError) as error:
        raise InvalidContainer("its header is not a JSON object in UTF-8") from error
    if not isinstance(header, dict):  # pragma: no cover - a text that begins with a brace is an object
        raise InvalidContainer("its header is not a JSON object")
    return header


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = dict(pairs)
    if len(keys) != len(pairs):
        raise InvalidContainer("its header has a name twice")
    for key in keys:
        _require_text(key)
    return keys


def _no_constant(name: str) -> None:
    raise InvalidContainer(f"its header has the number {name}")


def _require_text(text: str) -> None:
    """Refuse half of a surrogate pair, which JSON can write but nothing can store or print."""
    if not text.isascii() and any("\ud800" <= character <= "\udfff" for character in text):
        raise InvalidContainer("its header has text that is not Unicode")


def _metadata(entry: object) -> dict[str, str]:
    if not isinstance(entry, dict):
        raise InvalidContainer("its __metadata__ is not an object")
    for key, value in entry.items():
        if not isinstance(value, str):
            raise InvalidContainer(f"its __metadata__ {key!r} is not a string")
        _require_text(value)
    return entry


def _tensor_info(name: str, entry: object, limits: ContainerLimits) -> TensorInfo:
    if not isinstance(entry, dict) or entry.keys() != {"dtype", "shape", "data_offsets"}:
        raise InvalidContainer(f"tensor {name!r} is not described by dtype, shape and data_offsets")
    dtype, shape, offsets = entry["dtype"], entry["shape"], entry["data_offsets"]
    if not isinstance(dtype, str) or dtype not in ITEM_SIZES:
        raise InvalidContainer(f"tensor {name!r} is of no known type ({', '.join(ITEM_SIZES)})")
    if not _are_counts(shape) or len(shape) > limits.rank:
        raise InvalidContainer(f"tensor {name!r} has no shape of at most {limits.rank} dimensions")
    if not _are_counts(offsets) or len(offsets) != 2:
        raise InvalidContainer(f"tensor {name!r} has no two data_offsets")
    begin, end = offsets
    # Python's integers do not wrap round, so [2**62, 4] is not mistaken for an empty tensor.
    size = math.prod(shape) * ITEM_SIZES[dtype]
    if end - begin != size:
        raise InvalidContainer(f"tensor {name!r} does not have the {end - begin} bytes of its data_offsets")
    return TensorInfo(tuple(shape), dtype, begin, end)


def _are_counts(value: object) -> bool:
    return isinstance(value, list) and all(type(item) is int and item >= 0 for item in value)


def _require_exact_cover(tensors: Mapping[str, TensorInfo], size: int) -> None:
    position = 0
    for name, info in sorted(tensors.items(), key=lambda item: (item[1].begin, item[1].end)):
        if info.begin != position:
            raise InvalidContainer(f"tensor {name!r} leaves a gap in the data or overlaps another")
        position = info.end
    if position != size:
        raise InvalidContainer(f"its tensors have {position} bytes, its data {size}")
