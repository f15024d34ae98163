"""Request headers that several routes read, and response headers that they document."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Header

IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=255,
        pattern=r"^[\x20-\x7e]+$",
        description="Makes a retry safe: the same key and request give the first one's job and answer",
    ),
]
Prefer = Annotated[
    str | None,
    Header(
        description="RFC 7240: `respond-async` answers 202 at once, `wait=N` after N seconds at most",
        examples=["respond-async"],
    ),
]

LOCATION: dict[str, Any] = {"Location": {"description": "Where it is", "schema": {"type": "string"}}}
