"""The sentences that the service can say of an error, as they stand in its modules."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import app
from app import field_errors
from app.api.problem_types import PROBLEM_TYPES

_ROOT = Path(app.__file__).parent
_FORMAT = re.compile(r"\{(\w+)[^{}]*\}")


@dataclass
class Sentences:
    """What stands in calls of ``said`` and ``noun``.

    Attributes
    ----------
    values
        Names of the values by the sentence they are given to, as answers have it, without formats.
    nouns
        Words that stand in sentences.
    computed
        Modules with calls whose sentence is no literal, one entry a call.
    """

    values: dict[str, set[str]] = field(default_factory=dict)
    nouns: set[str] = field(default_factory=set)
    computed: list[str] = field(default_factory=list)

    def texts(self) -> set[str]:
        """Return all that is translated: sentences, words, and what types of errors mean."""
        return set(self.values) | self.nouns | {kind.meaning for kind in PROBLEM_TYPES.values()}


def said_sentences() -> Sentences:
    """Read all modules of the service."""
    found = Sentences()
    for path in sorted(_ROOT.rglob("*.py")):
        for call in _calls(path):
            _read(found, path.relative_to(_ROOT).as_posix(), call)
    for sentence in (*field_errors.NEEDS.values(), *(each for each, _ in field_errors.LIMITS.values())):
        found.values[plain(sentence)] = set(_FORMAT.findall(sentence))
    return found


def plain(sentence: str) -> str:
    """Return a sentence as answers have it."""
    return _FORMAT.sub(r"{\1}", sentence)


def _calls(path: Path) -> Iterator[ast.Call]:
    return (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call))


def _read(found: Sentences, module: str, call: ast.Call) -> None:
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    # What lists of items are called where they are counted.
    found.nouns |= {
        each.value.value for each in call.keywords if each.arg == "called" and _is_text(each.value)
    }
    if name == "too_few" and _is_text(call.args[1]):
        found.nouns.add(call.args[1].value)
    if name not in ("said", "noun"):
        return
    if not _is_text(call.args[0]):
        found.computed.append(module)
    elif name == "noun":
        found.nouns.add(call.args[0].value)
    else:
        given = {each.arg for each in call.keywords if each.arg is not None}
        places = set(_FORMAT.findall(call.args[0].value))
        # `**figures` has those that are not named.
        found.values[plain(call.args[0].value)] = places if None in {k.arg for k in call.keywords} else given


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)
