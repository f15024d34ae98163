"""The operator's own layer as tiles: an archive of PMTiles, of which a page asks for the parts that it needs.

Its header, of 127 bytes, says where everything is:
https://github.com/protomaps/PMTiles/blob/main/spec/v3/spec.md
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path

MAGIC = b"PMTiles"
_HEADER_BYTES = 127
_VERSION, _VERSION_AT = 3, 7
_TILE_TYPE_AT = 99
_TILES = struct.Struct("<QQ")
"""Where the tiles begin, and how many bytes they are, at :data:`_TILES_AT`."""
_TILES_AT = 56

TYPES: Mapping[int, str] = {2: "PNG", 3: "JPEG", 4: "WebP", 5: "AVIF"}
"""Pictures that browsers show, by their number in the header."""


def is_archive(path: Path) -> bool:
    """Return whether a file begins as an archive does, whatever its name."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def require_pictures(path: Path, name: str) -> None:
    """Refuse an archive that the page could not show.

    Parameters
    ----------
    path
        Of the archive.
    name
        What it is called in messages.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        It is of another version, its tiles are no pictures, or a part of it is missing.
    """
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    if len(header) < _HEADER_BYTES:
        raise ValueError(
            f"{name} has {len(header)} bytes, and the header alone of PMTiles has {_HEADER_BYTES}"
        )
    if header[_VERSION_AT] != _VERSION:
        raise ValueError(f"{name} is PMTiles of version {header[_VERSION_AT]}, only {_VERSION} is read")
    if header[_TILE_TYPE_AT] not in TYPES:
        raise ValueError(
            f"{name} has tiles of type {header[_TILE_TYPE_AT]}, which are no pictures: "
            f"{', '.join(TYPES.values())} are shown"
        )
    begin, length = _TILES.unpack_from(header, _TILES_AT)
    size = path.stat().st_size
    if size < begin + length:
        raise ValueError(
            f"{name} has {size} bytes, and its tiles end at {begin + length}: it is not complete"
        )
