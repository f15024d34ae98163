"""Parameters that several routes read, and headers that they document."""

from __future__ import annotations

import re
from typing import Annotated, Any

from fastapi import Header, Path, Query
from pydantic import AfterValidator

from app.api.library_models import JOB_ID_PATTERN
from app.api.mission_models import MISSION_ID_PATTERN
from app.jobs.errors import JobNotFound
from app.missions.errors import MissionNotFound
from policy_store.errors import PolicyNotFound
from policy_store.policy import ID_PATTERN as POLICY_ID_PATTERN

IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=255,
        pattern=r"^[\x20-\x7e]+$",
        description="Makes a retry safe: the same key and request give what the first one began",
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


def _job_id(given: str) -> str:
    if not re.fullmatch(JOB_ID_PATTERN, given):
        raise JobNotFound(given)
    return given


def _mission_id(given: str) -> str:
    if not re.fullmatch(MISSION_ID_PATTERN, given):
        raise MissionNotFound(given)
    return given


def _policy_id(given: str) -> str:
    if not re.fullmatch(POLICY_ID_PATTERN, given):
        raise PolicyNotFound(given)
    return given


# What has not the form of an id is the id of nothing, which is said without asking the database.
JobId = Annotated[
    str,
    Path(description="The job", json_schema_extra={"pattern": JOB_ID_PATTERN}, examples=["0" * 32]),
    AfterValidator(_job_id),
]
MissionId = Annotated[
    str,
    Path(description="The mission", json_schema_extra={"pattern": MISSION_ID_PATTERN}, examples=["0" * 32]),
    AfterValidator(_mission_id),
]
PolicyId = Annotated[
    str,
    Path(
        description="The policy",
        json_schema_extra={"pattern": f"^{POLICY_ID_PATTERN}$"},
        examples=["uniform-5x10x3"],
    ),
    AfterValidator(_policy_id),
]

LOCATION: dict[str, Any] = {"Location": {"description": "Where it is", "schema": {"type": "string"}}}
