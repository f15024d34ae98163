"""Why a job failed, as the JSON object that is stored with it."""

from __future__ import annotations

from typing import Any

from app.domain.errors import AllocatorError

INTERNAL_ERROR = "internal-error"
"""Code of a failure that is a defect, or the machine's trouble."""


def failure(code: str, detail: str) -> dict[str, Any]:
    """Return the error object of a failure that has no violations and no further facts."""
    return {"code": code, "detail": detail, "violations": [], "details": {}}


def describe(error: BaseException) -> dict[str, Any]:
    """Return the error object of an exception that ended a job.

    An :class:`AllocatorError` says for itself what is wrong. Anything else is a defect or the machine's
    trouble: the object names the type and the message, the traceback belongs into the log.
    """
    if isinstance(error, AllocatorError):
        return {
            "code": error.code,
            "detail": error.detail,
            "violations": [{"pointer": v.pointer, "detail": v.detail} for v in error.violations],
            "details": error.details,
        }
    return failure(INTERNAL_ERROR, f"the work ended with {type(error).__name__}: {error}")
