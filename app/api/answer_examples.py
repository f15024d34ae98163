"""Examples of answers in the description: what a running service has answered about a real case.

They are recorded, a file an operation in ``app/examples/answers``; a test records them again and compares. A
problem that was not recorded, since it needs a service in trouble, is shown with its meaning.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

from app.api.problem_details import MEDIA_TYPE

_FOLDER = resources.files("app.examples") / "answers"
_PROBLEMS = "problems"
_PARAMETER = re.compile(r"\{(\w+)\}")
_PLACES: Mapping[str, str] = {"name": "cyclone-idai", "policy_id": "universal-6"}
"""Of parameters of paths that are no id of 32 hexadecimal digits."""
_SOME_ID = "5f0c3a52b8e14d0f9c0d7e6a1b2c3d4e"


def show_answers(path: str, operation: dict[str, Any]) -> None:
    """Add to an operation examples of what it answers.

    Parameters
    ----------
    path
        Its template.
    operation
        Its description, which is changed in place.
    """
    recorded = _recorded(operation["operationId"])
    instance = _PARAMETER.sub(lambda found: _PLACES.get(found[1], _SOME_ID), path)
    for status, response in operation["responses"].items():
        for media, content in response.get("content", {}).items():
            if media == MEDIA_TYPE:
                _show_problems(content["examples"], instance)
            elif examples := recorded.get(status, {}).get(media):
                content["examples"] = {name: {"value": value} for name, value in examples.items()}


def _show_problems(examples: dict[str, Any], instance: str) -> None:
    known = _recorded(_PROBLEMS)
    for code, example in examples.items():
        example["value"] = {**example["value"], **known.get(code, {}), "instance": instance}


@cache
def _recorded(name: str) -> dict[str, Any]:
    file = _FOLDER / f"{name}.json"
    found: dict[str, Any] = json.loads(file.read_text("utf-8")) if file.is_file() else {}
    return found
