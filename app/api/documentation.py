"""The OpenAPI description, and the page that shows it, which loads nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import re
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.routing import APIRoute
from starlette.requests import Request
from starlette.responses import HTMLResponse
from starlette.staticfiles import StaticFiles

from app.api.access.guard import SCHEME, document, needed_role
from app.api.answer_examples import show_answers
from app.api.batch_models import BatchLine
from app.api.problem_details import ProblemDetails, responses
from app.api.problem_models import largest, most_elements
from app.api.security_headers import content_policy
from app.api.wire_fields import wire_model
from app.domain.fields import DeclaredField, Items, Named, declared_fields
from app.domain.problem import Problem
from app.settings import Settings

DESCRIPTION = """\
Who flies where, with what: plans for swarms of UAVs that carry relief materials, after Yin, Guo, Su and Wang,
"Task Allocation of Multiple Unmanned Aerial Vehicles Based on Deep Transfer Reinforcement Learning",
Drones 2022, 6(8), 215.

Errors are problem details (RFC 9457), of [these types](docs/errors). Every response has an `X-Request-ID`,
which is the request's if it has one. A service that keys were made for needs one with every request:
`Authorization: Bearer …`.
"""

TAGS: list[dict[str, Any]] = [
    {"name": "allocation", "description": "Plans, and the algorithms that find them"},
    {"name": "jobs", "description": "What runs, ran, and waits"},
    {"name": "missions", "description": "A day that is flown, event by event, and the plan that follows it"},
    {"name": "library", "description": "Trained source tasks that can be transferred"},
    {"name": "operations", "description": "Is it alive, is it ready"},
]

_ASSETS = "/docs/assets"
_INLINE_SCRIPT = re.compile(rb"<script>(.*?)</script>", re.DOTALL)


def _name_limits(components: dict[str, Any], settings: Settings) -> None:
    """Say in the schemas how large a problem and a batch may be here, which is the operator's to set."""
    components["BatchRequest"]["properties"]["problems"]["maxItems"] = settings.batch_limit
    for each in declared_fields(Problem):
        for name in ("ProblemModel", "AllocationRequest"):
            _limit(components[name]["properties"][each.name], each, settings)
        if isinstance(each.kind, Items | Named):
            properties = components[wire_model(each.kind.of).__name__]["properties"]
            for inner in declared_fields(each.kind.of):
                _limit(properties[inner.name], inner, settings)


def _limit(schema: dict[str, Any], field: DeclaredField, settings: Settings) -> None:
    limit = (
        largest(field.name, settings)
        if isinstance(field.kind, Items)
        else most_elements(field.kind, settings)
    )
    if limit is not None:
        # One that may be left open is a list, or an object, or null.
        kind = schema.get("anyOf", [schema])[0]
        kind["maxProperties" if isinstance(field.kind, Named) else "maxItems"] = limit


def operation_id(route: APIRoute) -> str:
    """Name an operation by its function, so that generated clients keep their names."""
    return route.name


def install_documentation(application: FastAPI, settings: Settings) -> None:
    """Give an application its ``/docs``, and errors, keys and limits in its description."""
    generate = application.openapi

    def openapi() -> dict[str, Any]:
        new = application.openapi_schema is None
        schema = generate()
        if new:
            problem = ProblemDetails.model_json_schema(ref_template="#/components/schemas/{model}")
            components = schema["components"]["schemas"]
            components |= problem.pop("$defs")
            components["ProblemDetails"] = problem
            _name_limits(components, settings)
            # A line of a stream, which the framework does not see.
            line = BatchLine.model_json_schema(
                mode="serialization", ref_template="#/components/schemas/{model}"
            )
            components |= line.pop("$defs")
            components["BatchLine"] = line
            schema["components"]["securitySchemes"] = {"ApiKey": SCHEME}
            for path, operations in schema["paths"].items():
                for method, operation in operations.items():
                    document(
                        operation, needed_role(method.upper(), path), required=settings.always_needs_keys
                    )
                    if "requestBody" in operation:
                        timeout = {str(k): v for k, v in responses("request-timeout").items()}
                        operation["responses"] = timeout | operation["responses"]
                    show_answers(path, operation)
        return schema

    async def show_documentation(request: Request) -> HTMLResponse:
        root = request.scope.get("root_path", "").rstrip("/")
        page = get_swagger_ui_html(
            openapi_url=f"{root}{application.openapi_url}",
            title=application.title,
            swagger_js_url=f"{root}{_ASSETS}/swagger-ui-bundle.js",
            swagger_css_url=f"{root}{_ASSETS}/swagger-ui.css",
            swagger_favicon_url=f"{root}{_ASSETS}/favicon-32x32.png",
        )
        scripts = _INLINE_SCRIPT.findall(bytes(page.body))
        hashes = [base64.b64encode(hashlib.sha256(script).digest()).decode() for script in scripts]
        page.headers["Content-Security-Policy"] = content_policy(hashes)
        return page

    application.openapi = openapi  # type: ignore[method-assign]  # the documented way to change it
    application.add_route("/docs", show_documentation, include_in_schema=False)
    application.mount(_ASSETS, StaticFiles(packages=[("fastapi_swagger", "resources")]))
