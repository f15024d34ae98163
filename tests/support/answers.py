"""Answers, compared."""

from collections.abc import Mapping
from typing import Any

LATER = ("unmet", "reasons")
"""What a time limit may leave to be completed after the answer."""


def but_for_reasons(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of an answer never changes once it is given."""
    return {name: value for name, value in answer.items() if name not in LATER}
