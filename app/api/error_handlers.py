"""Every error of the service as problem details; nothing of a request is echoed but its path."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from http import HTTPStatus
from typing import Any

from asgi_correlation_id import correlation_id
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from sqlalchemy.exc import DataError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import compile_path

from app.api.access.guard import route_path
from app.api.errors import InvalidBody, RequestError
from app.api.head_requests import streams
from app.api.problem_details import FieldError, problem_response
from app.api.problem_types import PROBLEM_TYPES
from app.api.security_headers import SECURITY_HEADERS
from app.api.store_away import store_unavailable
from app.domain.errors import AllocatorError, Violation
from app.domain.said import said
from app.field_errors import in_words
from app.jobs import errors as job_errors
from app.store_faults import STORE_IS_AWAY
from policy_store import errors as store_errors

_log = logging.getLogger(__name__)

_CODES: Mapping[type[Exception], str] = {
    job_errors.JobNotFound: "job-not-found",
    job_errors.InvalidCursor: "invalid-cursor",
    job_errors.IdempotencyMismatch: "idempotency-key-reused",
    job_errors.QueueFull: "queue-full",
    job_errors.Draining: "draining",
    store_errors.PolicyNotFound: "policy-not-found",
    store_errors.InvalidCursor: "invalid-cursor",
    store_errors.DuplicatePolicy: "duplicate-policy",
    store_errors.InvalidPolicy: "invalid-policy",
    store_errors.InvalidVector: "invalid-policy",
    store_errors.InvalidContainer: "invalid-checkpoint",
    store_errors.CorruptCheckpoint: "damaged-checkpoint",
}
Handler = Callable[[Request, Exception], Response]

_DRAINING_RETRY_S = 5.0


def install_error_handlers(application: FastAPI) -> None:
    """Make an application answer every error with problem details."""
    application.add_exception_handler(RequestValidationError, _invalid_request)
    application.add_exception_handler(HTTPException, _http_error)
    application.add_exception_handler(RequestError, _request_error)
    application.add_exception_handler(AllocatorError, _allocator_error)
    for error in _CODES:
        application.add_exception_handler(error, _known_error)
    application.add_exception_handler(DataError, _unstorable)
    for error in STORE_IS_AWAY:
        application.add_exception_handler(error, _store_unavailable)
    application.add_exception_handler(Exception, _defect)


def problem_of(request: Request, error: Exception) -> dict[str, Any]:
    """Return the problem details that would answer an error, for an answer that has begun already."""
    known: tuple[tuple[tuple[type[Exception], ...], Handler], ...] = (
        ((RequestError,), _request_error),
        ((AllocatorError,), _allocator_error),
        (tuple(_CODES), _known_error),
        ((DataError,), _unstorable),
        (STORE_IS_AWAY, _store_unavailable),
    )
    handle = next((handler for kinds, handler in known if isinstance(error, kinds)), None)
    if handle is None:
        _log.error("an answer that was begun ends with a defect", exc_info=error)
        handle = _defect
    problem: dict[str, Any] = json.loads(bytes(handle(request, error).body))
    return problem


def field_errors(violations: Sequence[Violation], prefix: str = "") -> list[FieldError]:
    """Put violations of the domain into the body they came in.

    Parameters
    ----------
    violations
        Pointers are relative to the problem.
    prefix
        Pointer of the problem in the body.
    """
    return [FieldError(pointer=prefix + v.pointer, detail=v.detail) for v in violations]


def _instance(request: Request) -> str:
    return request.url.path


def _invalid_request(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    return _request_error(request, InvalidBody([_parameter_error(item) for item in error.errors()]))


def _parameter_error(item: Mapping[str, Any]) -> FieldError:
    """Say what is wrong outside of the body, which is checked by :mod:`app.api.body_validation`."""
    place, *location = item["loc"]
    name = "/".join(map(str, location))
    return FieldError(
        pointer="",
        detail=said("{place} parameter: {detail}", place=place, detail=in_words(item)),
        parameter=name,
    )


def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    status = HTTPStatus(error.status_code)
    codes = {404: "not-found", 405: "method-not-allowed", 400: "bad-request"}
    code = codes.get(status.value, "internal-error")
    detail = {
        404: said("there is nothing at {path}", path=_instance(request)),
        405: said("{method} is not possible at {path}", method=request.method, path=_instance(request)),
    }.get(status.value, str(error.detail))
    headers = dict(error.headers or {})
    if status is HTTPStatus.METHOD_NOT_ALLOWED and (methods := _methods_at(request)):
        headers["Allow"] = ", ".join(methods)
    return problem_response(code, detail, _instance(request), headers=headers)


def _methods_at(request: Request) -> list[str]:
    """List the methods of a place; the router names those of one route only, where several share it."""
    paths = request.app.openapi()["paths"]
    # A path that is spelled out is another place than those whose template it fits too.
    path = route_path(request.scope)
    templates = [path] if path in paths else [each for each in paths if compile_path(each)[0].match(path)]
    methods = {method.upper() for template in templates for method in paths[template]}
    if "GET" in methods and not streams(path):
        methods.add("HEAD")
    return sorted(methods)


def _request_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestError)
    return problem_response(
        error.code,
        error.detail,
        _instance(request),
        errors=error.errors,
        extensions=error.extensions,
        headers=error.headers,
    )


def _allocator_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, AllocatorError)
    if error.code not in PROBLEM_TYPES:
        raise error
    return problem_response(
        error.code,
        error.detail,
        _instance(request),
        errors=field_errors(error.violations),
        extensions=error.details,
    )


def _known_error(request: Request, error: Exception) -> Response:
    code = next(_CODES[kind] for kind in type(error).__mro__ if kind in _CODES)
    headers = {}
    if isinstance(error, job_errors.QueueFull | job_errors.Draining):
        wait_s = getattr(error, "retry_after_s", _DRAINING_RETRY_S)
        headers["Retry-After"] = str(max(1, math.ceil(wait_s)))
    return problem_response(code, _text_of(error), _instance(request), headers=headers)


def _text_of(error: Exception) -> str:
    """Return what an exception says, which ``str`` would make a text without its sentence."""
    return error.args[0] if error.args and isinstance(error.args[0], str) else str(error)


def _unstorable(request: Request, error: Exception) -> Response:
    _log.error("a request has what the database does not hold: %s", error)
    return problem_response(
        "invalid-request",
        said("the request has text or a number that the database cannot hold"),
        _instance(request),
    )


def _store_unavailable(request: Request, error: Exception) -> Response:
    return store_unavailable(error, _instance(request))


def _defect(request: Request, _error: Exception) -> Response:  # the server logs the error
    # This handler runs outside of the middleware that adds these to other responses.
    identifier = correlation_id.get() or ""
    return problem_response(
        "internal-error",
        said(
            "the service has a defect or its machine is in trouble; the log has more under this request's id"
        ),
        _instance(request),
        headers={"X-Request-ID": identifier, **SECURITY_HEADERS},
    )
