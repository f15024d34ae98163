"""What the tools take, as the service describes it: its fields, limits and defaults, in one piece."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_REFERENCE = "#/components/schemas/"
_LEFT_OUT = frozenset({"title", "idsOf", "examples"})


def body_of(description: Mapping[str, Any], path: str) -> dict[str, Any]:
    """Return the JSON schema of the body of a POST, without references.

    Parameters
    ----------
    description
        The service's, as ``/openapi.json`` has it.
    path
        The template of the path.
    """
    body = description["paths"][path]["post"]["requestBody"]["content"]["application/json"]["schema"]
    whole: dict[str, Any] = _without_references(body, description["components"]["schemas"])
    return whole


def _without_references(schema: Any, schemas: Mapping[str, Any]) -> Any:
    if isinstance(schema, list):
        return [_without_references(each, schemas) for each in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        beside = {name: value for name, value in schema.items() if name != "$ref"}
        schema = {**schemas[schema["$ref"].removeprefix(_REFERENCE)], **beside}
    # A field may be called as a keyword is.
    return {
        name: {key: _without_references(each, schemas) for key, each in value.items()}
        if name == "properties"
        else _without_references(value, schemas)
        for name, value in schema.items()
        if name not in _LEFT_OUT
    }
