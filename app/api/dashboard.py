"""The dispatch dashboard: its page at ``/``, its files, its icon, and what of the settings it has to know."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import urlsplit

from fastapi import FastAPI
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

import app
from app.api.overlay import install_overlay
from app.api.security_headers import page_policy
from app.settings import Settings

FOLDER = "/dashboard"
_ICON = "/favicon.ico"
"""What a browser asks for where a page names no icon, such as the page to print."""
_FILES = Path(app.__file__).parent / "dashboard"
# A browser asks each time whether a file has changed: after an update no old module meets a new one.
_FRESH = {"Cache-Control": "no-cache"}
# A folder with a version in its name never changes.
_VERSIONED = re.compile(r"-\d+\.\d+\.\d+/")
_LASTING = {"Cache-Control": "public, max-age=31536000, immutable"}


class _Files(StaticFiles):
    """Static files that a browser checks before it uses them again, but for those of a version.

    What is kept compressed is sent as it is; its type is that of what is in it.
    """

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file's response."""
        response = await super().get_response(path, scope)
        response.headers.update(_LASTING if _VERSIONED.search(path) else _FRESH)
        if path.endswith(".gz") and isinstance(response, FileResponse):
            response.headers["Content-Encoding"] = "gzip"
        return response


def install_dashboard(application: FastAPI, settings: Settings) -> None:
    """Serve the dashboard.

    Parameters
    ----------
    application
        Gets ``/``, ``/dashboard/settings.json`` and the files beside it, and the overlay where the settings
        name one; that needs a key where others do.
    settings
        A tile server named there is the one place outside that the page may load pictures from.

    Raises
    ------
    ValueError
        As :func:`app.api.overlay.install_overlay`.
    """
    tiles = urlsplit(settings.tile_url or "")
    policy = page_policy(f"{tiles.scheme}://{tiles.netloc.replace('{s}', '*')}" if tiles.netloc else None)
    known = {
        "version": app.__version__,
        "tile_url": settings.tile_url,
        "tile_attribution": settings.tile_attribution,
        "overlay": install_overlay(application, settings.overlay_file) if settings.overlay_file else None,
    }

    async def show_dashboard(request: Request) -> Response:  # noqa: ARG001 - a route's signature
        return FileResponse(_FILES / "index.html", headers={"Content-Security-Policy": policy, **_FRESH})

    async def show_icon(request: Request) -> Response:  # noqa: ARG001 - a route's signature
        return FileResponse(_FILES / "icon.svg", headers=_FRESH)

    async def tell_settings(request: Request) -> Response:  # noqa: ARG001 - a route's signature
        return JSONResponse(known, headers=_FRESH)

    application.add_route("/", show_dashboard, include_in_schema=False)
    application.add_route(_ICON, show_icon, include_in_schema=False)
    application.add_route(f"{FOLDER}/settings.json", tell_settings, include_in_schema=False)
    application.mount(FOLDER, _Files(directory=_FILES))
