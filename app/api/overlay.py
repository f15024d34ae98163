"""The operator's own layer of the dashboard's map: GeoJSON or PMTiles, checked when the service starts."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from starlette.requests import Request
from starlette.responses import FileResponse, Response

from app.api.overlay_tiles import is_archive, require_pictures

_FEATURES, _TILES = "overlay.geojson", "overlay.pmtiles"
# As the page's own files: a browser asks each time whether it has changed.
_FRESH = {"Cache-Control": "no-cache"}

MOST_BYTES = 16 * 1024**2
"""Of an overlay; a page draws all of it."""

_DEGREES = re.compile(r"(CRS84h?|EPSG:[\d.]*:?(4326|4979))$", re.IGNORECASE)
"""Names of longitude and latitude on WGS 84."""


def install_overlay(application: FastAPI, path: Path) -> str:
    """Serve an overlay: features whole, and of tiles the parts that are asked for.

    Returns
    -------
    str
        The path where it is, relative to that of the page.

    Raises
    ------
    ValueError
        It cannot be read, or as :func:`read_overlay` and :func:`~app.api.overlay_tiles.require_pictures`.
    """
    try:
        archive = is_archive(path)
    except OSError as error:
        raise ValueError(f"{_called(path)} cannot be read: {error.strerror or error}") from error
    if archive:
        require_pictures(path, _called(path))

        async def show_tiles(request: Request) -> Response:  # noqa: ARG001 - a route's signature
            return FileResponse(path, media_type="application/octet-stream", headers=_FRESH)

        application.add_route(f"/{_TILES}", show_tiles, include_in_schema=False)
        return _TILES
    overlay = read_overlay(path)

    async def show_features(request: Request) -> Response:  # noqa: ARG001 - a route's signature
        return Response(overlay, media_type="application/geo+json", headers=_FRESH)

    application.add_route(f"/{_FEATURES}", show_features, include_in_schema=False)
    return _FEATURES


def _called(path: Path) -> str:
    return f"ALLOCATOR_OVERLAY_FILE ({path})"


def read_overlay(path: Path) -> bytes:
    """Read an overlay of features.

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
    name = _called(path)
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
