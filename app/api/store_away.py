"""The answer while the database does not answer."""

from __future__ import annotations

import logging

from starlette.responses import Response

from app.api.problem_details import problem_response
from app.domain.said import said
from app.store_faults import first_line

_log = logging.getLogger(__name__)


def store_unavailable(error: Exception, instance: str) -> Response:
    """Answer 503 to a request for a path, and write the error into the log in one line."""
    _log.error("the database does not answer: %s", first_line(error))
    return problem_response(
        "store-unavailable",
        said(
            "the database does not answer now; whether a request that changes something was carried out is "
            "not known, unless it comes again with the same Idempotency-Key"
        ),
        instance,
        headers={"Retry-After": "1"},
    )
