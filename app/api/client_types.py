"""The types of the client, from the OpenAPI description: what requests take and what answers have.

Every object of the description becomes a ``TypedDict``, so what is sent and received stays plain JSON, and
every option and field that a client can name is one that the service declares.
"""

from __future__ import annotations

import builtins
import textwrap
from collections.abc import Iterable, Mapping
from typing import Any

_WIDTH = 108
_SUFFIX = "Model"
_REFERENCE = "#/components/schemas/"
_PLAIN = {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None"}

_HEAD = '''\
"""What requests take and answers have, as types: written by ``python -m app.api.published``.

Answers and requests are plain dictionaries and lists. Of a later service they may have more members. Final
types let a type checker tell stops apart by ``"target_id" in stop``.
"""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict, final

'''

_UNIONS = {"Event": ("/missions/{mission_id}/events", "post"), "Registration": ("/library", "post")}
"""Names of bodies that are one of several objects, and have none in the description."""

_ENUMERATIONS = {"AlgorithmName": ("AllocationRequest", "algorithm")}
"""Names of choices that several objects have, and where each is in the description."""

_PLAN_FILE = ("/jobs/{job_id}/plan", "get")


def types_module(description: Mapping[str, Any]) -> str:
    """Write the module of all types.

    Parameters
    ----------
    description
        The service's, as ``/openapi.json`` has it.
    """
    schemas = description["components"]["schemas"]
    names = _names(schemas)
    parts = []
    for name, (schema, member) in _ENUMERATIONS.items():
        choice = _type_of(schemas[schema]["properties"][member], names)
        parts.append(_alias(name, choice))
        names[choice] = name
    parts += [_class_or_alias(names[name], schema, names) for name, schema in schemas.items()]
    for name, (path, method) in _UNIONS.items():
        body = description["paths"][path][method]["requestBody"]["content"]["application/json"]["schema"]
        parts.append(_alias(name, _union(body["oneOf"], names)))
    parts += _options(description, names)
    return _HEAD + "\n\n".join(parts)


def _names(schemas: Iterable[str]) -> dict[str, str]:
    """Return the name of each type: that of its schema, without the suffix of models where it is free."""
    taken = set(schemas) | set(vars(builtins)) | set(_UNIONS)
    short = {name: name.removesuffix(_SUFFIX) for name in schemas}
    return {name: name if short[name] in taken and name != short[name] else short[name] for name in schemas}


def _options(description: Mapping[str, Any], names: Mapping[str, str]) -> list[str]:
    """Write what methods take by name: the fields of a request beside those of its main part."""
    schemas = description["components"]["schemas"]
    problem = set(schemas["ProblemModel"]["properties"])
    told_apart = {
        "AllocationOptions": ("AllocationRequest", "How a problem is solved.", problem),
        "EvaluationOptions": ("EvaluationRequest", "What is asked of a plan.", problem | {"assignment"}),
        "MissionOptions": ("MissionRequest", "How a mission is planned.", {"problem"}),
        "SimilarOptions": ("SimilarRequest", "How tasks are compared.", {"task"}),
    }
    written = [
        _typed_dict(
            name,
            about,
            {key: value for key, value in schemas[request]["properties"].items() if key not in without},
            (),
            names,
        )
        for name, (request, about, without) in told_apart.items()
    ]
    path, method = _PLAN_FILE
    choices = {
        each["name"]: {**each["schema"], "description": each["description"]}
        for each in description["paths"][path][method]["parameters"]
        if each["in"] == "query" and each["name"] != "format"
    }
    return [*written, _typed_dict("PlanChoices", "What a file of a plan is to be like.", choices, (), names)]


def _class_or_alias(name: str, schema: Mapping[str, Any], names: Mapping[str, str]) -> str:
    if "properties" not in schema:
        return _alias(name, _type_of(schema, names), schema.get("description"))
    return _typed_dict(name, schema["description"], schema["properties"], schema.get("required", ()), names)


def _alias(name: str, written: str, about: str | None = None) -> str:
    line = f"{name} = {written}\n"
    if len(line) > _WIDTH:
        opening, closing = ("Literal[", "]") if written.startswith("Literal[") else ("(", ")")
        inner = written.removeprefix("Literal[").removesuffix("]") if opening != "(" else written
        separator = ", " if opening != "(" else " | "
        line = f"{name} = {opening}\n{_listed(inner.split(separator), separator)}{closing}\n"
    return line if about is None else line + _docstring(about, "")


def _listed(items: Iterable[str], separator: str) -> str:
    if separator == ", ":
        return "".join(f"    {item},\n" for item in items)
    return "".join(f"    {'| ' if number else ''}{item}\n" for number, item in enumerate(items))


def _typed_dict(
    name: str,
    about: str,
    properties: Mapping[str, Mapping[str, Any]],
    required: Iterable[str],
    names: Mapping[str, str],
) -> str:
    needed = set(required)
    fields = "\n".join(
        _field(each, schema, names, required=each in needed) for each, schema in properties.items()
    )
    return f"@final\nclass {name}(TypedDict):\n{_docstring(about)}\n{fields}"


def _field(name: str, schema: Mapping[str, Any], names: Mapping[str, str], *, required: bool) -> str:
    written = _type_of(schema, names)
    line = f"    {name}: {written if required else f'NotRequired[{written}]'}\n"
    if len(line) > _WIDTH and written.startswith("Literal["):
        inner = "".join(f"            {item},\n" for item in written[len("Literal[") : -1].split(", "))
        line = f"    {name}: NotRequired[\n        Literal[\n{inner}        ]\n    ]\n"
        if required:
            inner = inner.replace("            ", "        ")
            line = f"    {name}: Literal[\n{inner}    ]\n"
    about = schema.get("description")
    return line + (_docstring(about) if about else "")


def _docstring(text: str, indent: str = "    ") -> str:
    text = text.replace("\\", "\\\\").replace('"""', "'''")
    ended = text if text.endswith((".", "!", "?")) else f"{text}."
    if len(ended) + len(indent) + 6 <= _WIDTH:
        return f'{indent}"""{ended}"""\n'
    lines = textwrap.wrap(ended, _WIDTH - len(indent) - 3, break_long_words=False)
    body = "\n".join(indent + line for line in lines[1:])
    closing = '"""\n' if len(lines[-1]) + len(indent) + 3 <= _WIDTH else f'\n{indent}"""\n'
    return f'{indent}"""{lines[0]}\n{body}{closing}'


def _type_of(schema: Mapping[str, Any], names: Mapping[str, str]) -> str:
    """Return the type of a value that a schema describes."""
    if "$ref" in schema:
        return names[schema["$ref"].removeprefix(_REFERENCE)]
    for several in ("anyOf", "oneOf"):
        if several in schema:
            return _union(schema[several], names)
    if "const" in schema:
        return f"Literal[{_literal(schema['const'])}]"
    if "enum" in schema:
        choice = f"Literal[{', '.join(map(_literal, schema['enum']))}]"
        return names.get(choice, choice)
    match schema.get("type"):
        case "array":
            inner = schema.get("items") or {"anyOf": schema.get("prefixItems", [{}])}
            return f"list[{_type_of(inner, names)}]"
        case "object":
            values = schema.get("additionalProperties")
            return f"dict[str, {_type_of(values, names) if isinstance(values, dict) else 'Any'}]"
        case None:
            return "Any"
        case plain:
            return _PLAIN[plain]


def _literal(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _union(schemas: Iterable[Mapping[str, Any]], names: Mapping[str, str]) -> str:
    return " | ".join(dict.fromkeys(_type_of(each, names) for each in schemas))
