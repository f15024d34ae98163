"""An archive of PMTiles in which every tile down to a zoom is the same picture."""

from __future__ import annotations

import gzip
import json
import struct
import zlib

_HEADER = struct.Struct("<7sB11Q6B4iB2i")
_GZIP, _NONE, PNG = 2, 1, 2
_DEGREE = 10_000_000


def picture(red: int, green: int, blue: int) -> bytes:
    """Make a PNG of one pixel."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    size = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0)
    line = zlib.compress(bytes((0, red, green, blue)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", size) + chunk(b"IDAT", line) + chunk(b"IEND", b"")


def archive(tile: bytes, max_zoom: int, *, tile_type: int = PNG, attribution: str = "") -> bytes:
    """Make the archive, of the whole world.

    Parameters
    ----------
    tile
        The picture.
    max_zoom
        The last zoom that has tiles.
    tile_type
        Its number in the header.
    attribution
        In the metadata.
    """
    count = sum(4**zoom for zoom in range(max_zoom + 1))
    # One entry: it begins with tile 0, goes on for all of them, and is at the beginning of the tiles.
    directory = gzip.compress(b"".join(map(_varint, (1, 0, count, len(tile), 1))))
    metadata = gzip.compress(json.dumps({"attribution": attribution}).encode())
    root, about = _HEADER.size, _HEADER.size + len(directory)
    tiles = about + len(metadata)
    places = (root, len(directory), about, len(metadata), tiles, 0, tiles, len(tile), count, 1, 1)
    world = (-180 * _DEGREE, -85 * _DEGREE, 180 * _DEGREE, 85 * _DEGREE)
    kinds = (1, _GZIP, _NONE, tile_type, 0, max_zoom)
    return _HEADER.pack(b"PMTiles", 3, *places, *kinds, *world, 0, 0, 0) + directory + metadata + tile


def _varint(number: int) -> bytes:
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes((*found, number))
