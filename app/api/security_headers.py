"""What every response tells a browser not to do, and where it does not send it."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import urlsplit, urlunsplit

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send


def content_policy(script_hashes: Sequence[str] = ()) -> str:
    """Return a Content-Security-Policy: nothing from elsewhere, no script in a page but those named.

    Parameters
    ----------
    script_hashes
        Of the scripts inside a page, base64 of their SHA-256.
    """
    scripts = " ".join(["script-src 'self'", *(f"'sha256-{digest}'" for digest in script_hashes)])
    return (
        f"default-src 'self'; {scripts}; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
        "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    )


def page_policy(pictures_from: str | None = None) -> str:
    """Return the Content-Security-Policy of the dashboard: its own files only, nothing inline.

    Parameters
    ----------
    pictures_from
        The origin of a tile server; None: no picture from elsewhere either.
    """
    pictures = " ".join(["img-src 'self' data: blob:", *([pictures_from] if pictures_from else [])])
    return (
        f"default-src 'self'; script-src 'self'; style-src 'self'; {pictures}; object-src 'none'; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    )


SECURITY_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": content_policy(),
}


class SecurityHeaders:
    """Middleware that adds the headers that a response does not bring itself."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and its response back with the headers."""

        async def add(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in SECURITY_HEADERS.items():
                    headers.setdefault(name, value)
                if "location" in headers:
                    # The framework builds it of the header Host, which is the client's to choose.
                    headers["location"] = _path_of(headers["location"])
            await send(message)

        await self._app(scope, receive, add)


def _path_of(location: str) -> str:
    """Return a place as a path, which is one of this service wherever it is called."""
    parts = urlsplit(location)
    return urlunsplit(("", "", parts.path, parts.query, parts.fragment))
