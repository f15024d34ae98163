"""Parameters that several routes read, and headers that they document."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Header, Query

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
Cursor = Annotated[
    str | None,
    Query(
        description="`next_cursor` of the page before",
        json_schema_extra={"pattern": "^[0-9]{1,18}$"},
    ),
]

LOCATION: dict[str, Any] = {"Location": {"description": "Where it is", "schema": {"type": "string"}}}
