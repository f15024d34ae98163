"""What is said of an error: an English text that still knows its sentence and the values in it.

A client that shows the error in another language has a translation of the sentence, and puts the values in.
"""

from __future__ import annotations

import math
import re
import string
from collections.abc import Mapping
from typing import Any, Self

_PLACE = re.compile(r"\{(\w+)[^{}]*\}")


class Said(str):
    """A text in English.

    Parameters
    ----------
    text
        The text itself.
    sentence
        The same for every error of its kind, with places for the values, ``{low}``.
    values
        By their places: numbers, texts, lists of texts, and what is said within.
    """

    __slots__ = ("sentence", "values")

    def __new__(cls, text: str, sentence: str, values: Mapping[str, Any]) -> Self:
        """Make the text."""
        made = super().__new__(cls, text)
        made.sentence = sentence
        made.values = values
        return made

    sentence: str
    values: Mapping[str, Any]

    def __getnewargs__(self) -> tuple[str, str, Mapping[str, Any]]:  # type: ignore[override]  # those of __new__
        """Return what a copy is made of."""
        return str(self), self.sentence, self.values


def said(sentence: str, /, **values: Any) -> Said:
    """Say a sentence.

    Parameters
    ----------
    sentence
        In English, as a literal where it is said, so that translations can be held against it. Places are
        those of ``str.format``; a number without a format is written by :func:`written`, a list with commas.
    values
        By their places.
    """
    return Said(_ENGLISH.vformat(sentence, (), values), _PLACE.sub(r"{\1}", sentence), values)


def noun(text: str) -> Said:
    """Say a word that stands in sentences, which has a translation of its own."""
    return Said(text, text, {})


def written(value: float) -> str:
    """Write a number briefly, but never as another one: 180.0000001 is not 180."""
    brief = f"{value:g}"
    return brief if float(brief) == value else repr(float(value))


def to_record(text: str) -> dict[str, Any]:
    """Turn what is said into what JSON can hold: ``detail``, and of :class:`Said` its sentence and values."""
    if not isinstance(text, Said):
        return {"detail": text}
    values = {name: _recorded(value) for name, value in text.values.items()}
    return {"detail": str(text), "sentence": text.sentence, "values": values}


def from_record(record: Mapping[str, Any]) -> str:
    """Turn a record of :func:`to_record` back, with whatever else it has."""
    if record.get("sentence") is None:
        return str(record["detail"])
    return Said(record["detail"], record["sentence"], record["values"])


def _recorded(value: Any) -> Any:
    if isinstance(value, Said):
        return to_record(value)
    # JSON has no number for what is infinite, or none.
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


class _English(string.Formatter):
    """Puts values into a sentence."""

    def format_field(self, value: Any, format_spec: str) -> str:
        """Write a value."""
        if not format_spec and isinstance(value, float):
            return written(value) if math.isfinite(value) else str(value)
        return ", ".join(value) if isinstance(value, list) else str(format(value, format_spec))


_ENGLISH = _English()
