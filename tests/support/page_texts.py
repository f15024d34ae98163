"""The texts of the dashboard that are translated, as they stand in its modules and its markup."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

import app

DASHBOARD = Path(app.__file__).parent / "dashboard"
LANGUAGES = sorted((DASHBOARD / "languages").glob("*.json"))

_CALL = re.compile(r"(?<![\w.#$])(t|tn|tNodes)\(")
_LITERAL = re.compile(r'\s*("(?:[^"\\\n]|\\.)*")\s*(?=[,)])')
_PLACES = re.compile(r"\{(\w+)\}")
_DEFINED_IN = "texts.js"


@dataclass
class SourceTexts:
    """English texts as they stand in calls of ``t``, ``tn`` and ``tNodes``, and in the markup.

    Attributes
    ----------
    plain
        Texts without a count, each with the module that has it last.
    counted
        The text for many things, with the one for one thing.
    computed
        Modules with calls whose text is no literal, one entry a call.
    """

    plain: dict[str, str] = field(default_factory=dict)
    counted: dict[str, str] = field(default_factory=dict)
    computed: list[str] = field(default_factory=list)


def places(text: str) -> set[str]:
    """Return the names of the values that a text has places for."""
    return set(_PLACES.findall(text))


def translations(code: str) -> dict[str, str | dict[str, str]]:
    """Return the texts of a language by the English ones; those with a count by their plural form."""
    found: dict[str, str | dict[str, str]] = json.loads(
        (DASHBOARD / "languages" / f"{code}.json").read_text()
    )
    return found


def source_texts() -> SourceTexts:
    """Read all modules and the markup."""
    found = SourceTexts()
    for path in sorted((DASHBOARD / "js").rglob("*.js")):
        if path.name != _DEFINED_IN:
            _read_module(found, path.relative_to(DASHBOARD / "js").as_posix(), path.read_text())
    for text in _markup_texts():
        found.plain[text] = "index.html"
    return found


def _read_module(found: SourceTexts, name: str, code: str) -> None:
    for call in _CALL.finditer(code):
        first = call.end()
        if call[1] == "tn":
            first = _end_of_argument(code, first) + 1
        text = _LITERAL.match(code, first)
        other = _LITERAL.match(code, text.end() + 1) if text and call[1] == "tn" else text
        if text is None or other is None:
            found.computed.append(name)
        elif call[1] == "tn":
            found.counted[json.loads(other[1])] = json.loads(text[1])
        else:
            found.plain[json.loads(text[1])] = name


def _end_of_argument(code: str, at: int) -> int:
    """Return where the comma after an argument is; strings with brackets in them do not stand there."""
    depth = 0
    while depth or code[at] != ",":
        depth += (code[at] in "([{") - (code[at] in ")]}")
        at += 1
    return at


class _Markup(HTMLParser):
    """Collects what `language.js` translates: texts and two attributes, but for `translate="no"`."""

    VOID = frozenset({"meta", "link", "input", "use"})

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []
        self._kept: list[bool] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        kept = given.get("translate") != "no" and (not self._kept or self._kept[-1])
        if kept and "body" in (tag, *self._tags):
            self.texts += [text for name in ("aria-label", "title") if (text := given.get(name))]
        if tag not in self.VOID:
            self._tags.append(tag)
            self._kept.append(kept)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            self._tags.pop()
            self._kept.pop()

    def handle_data(self, data: str) -> None:
        if data.strip() and "body" in self._tags and self._kept[-1]:
            self.texts.append(data.strip())

    def reset(self) -> None:
        super().reset()
        self._tags: list[str] = []


def _markup_texts() -> list[str]:
    markup = _Markup()
    markup.feed((DASHBOARD / "index.html").read_text())
    return markup.texts
