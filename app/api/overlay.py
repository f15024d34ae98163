"""The operator's own layer of the dashboard's map: a file of GeoJSON, checked when the service starts."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

MOST_BYTES = 16 * 1024**2
"""Of an overlay; a page draws all of it."""

_DEGREES = re.compile(r"(CRS84h?|EPSG:[\d.]*:?(4326|4979))$", re.IGNORECASE)
"""Names of longitude and latitude on WGS 84."""


def read_overlay(path: Path) -> bytes:
    """Read an overlay.

    Parameters
    ----------
    path
        Of a FeatureCollection of GeoJSON (RFC 7946), in degrees of longitude and latitude.

    Returns
    -------
    bytes
        The same as compact JSON.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        It is too large, no JSON, no FeatureCollection, or in other coordinates.
    """
    name = f"ALLOCATOR_OVERLAY_FILE ({path})"
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{name} has {size} bytes, at most {MOST_BYTES} are taken")
    try:
        given: Any = json.loads(path.read_bytes())
        compact = json.dumps(given, allow_nan=False, separators=(",", ":")).encode()
    except ValueError as error:
        raise ValueError(f"{name} is no JSON: {error}") from error
    if not isinstance(given, dict) or given.get("type") != "FeatureCollection" or "features" not in given:
        raise ValueError(f"{name} is no GeoJSON with the type FeatureCollection and a list `features`")
    if given.get("crs") is not None and not _DEGREES.search(str(_name_of(given["crs"]))):
        raise ValueError(f"{name} has the crs {given['crs']}: save it with longitude and latitude on WGS 84")
    return compact


def _name_of(crs: Any) -> Any:
    properties = crs.get("properties") if isinstance(crs, dict) else None
    return properties.get("name", "") if isinstance(properties, dict) else ""
