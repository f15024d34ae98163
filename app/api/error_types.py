"""The page that the ``type`` of every error leads to: what each means, and what to do about it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from html import escape

from fastapi import FastAPI
from starlette.requests import Request
from starlette.responses import HTMLResponse

from app.api.problem_types import ERROR_PAGE, PROBLEM_TYPES, ProblemType, status_of

_CODE = re.compile("`([^`]+)`")
_STYLE = """
body { font: 11pt/1.4 system-ui, sans-serif; color: #111; background: #fff; max-width: 60rem }
td, th { text-align: left; vertical-align: top; padding: .3rem .6rem; border-bottom: 1px solid #bbb }
:target td { background: #ffd }
"""


def install_error_types(application: FastAPI) -> None:
    """Serve the page."""
    page = error_page(PROBLEM_TYPES)

    async def show_errors(request: Request) -> HTMLResponse:  # noqa: ARG001 - a route's signature
        return HTMLResponse(page)

    application.add_route(ERROR_PAGE, show_errors, include_in_schema=False)


def error_page(types: Mapping[str, ProblemType]) -> str:
    """Write the page."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Error types</title>'
        f"<style>{_STYLE}</style></head><body><h1>Error types</h1>"
        "<p>An error is a problem of RFC 9457; its <code>type</code> leads to one of these rows. What was "
        "wrong with the request is in <code>detail</code>, and field by field in <code>errors</code>.</p>"
        f"<table><tr><th>Type</th><th>Status</th><th>What it means</th>"
        f"<th>What to do</th></tr>{''.join(_rows(types))}</table>"
        "</body></html>\n"
    )


def _rows(types: Mapping[str, ProblemType]) -> Iterator[str]:
    for code, kind in types.items():
        status = status_of(code)
        yield (
            f'<tr id="{code}"><td><code>{code}</code></td><td>{status.value} {escape(status.phrase)}</td>'
            f"<td>{_words(kind.meaning)}</td><td>{_words(kind.remedy)}</td></tr>"
        )


def _words(text: str) -> str:
    """Write a text with code between backticks as HTML."""
    return _CODE.sub(r"<code>\1</code>", escape(text))
