"""Kinds of fields that hold texts: words, ids of other items, names for people, and what a client keeps."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from app.domain.errors import Violation
from app.domain.fields import Context, Conversion, Kind
from app.domain.identifiers import fault_of
from app.domain.said import said


@dataclass(frozen=True)
class Words(Kind):
    """A list of words, or of ids.

    Attributes
    ----------
    ids_of
        Name of the problem's list whose items have these ids; that they are there is a rule between fields.
        None where they are words.
    """

    ids_of: str | None = None

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:  # noqa: ARG002 - of all kinds
        """Yield the words that could not be an identifier."""
        for index, word in enumerate(value):
            fault = fault_of(word)
            if fault is not None:
                yield Violation(f"{pointer}/{index}", fault)

    @property
    def conversions(self) -> tuple[Conversion, Conversion] | None:
        """Return what makes a list of the words, and words of the list."""
        return list, tuple


@dataclass(frozen=True)
class Name(Kind):
    """A name for people, which need not be unique; of the characters and the length of an identifier."""

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:  # noqa: ARG002 - of all kinds
        """Yield the character that is at fault."""
        fault = fault_of(value)
        if fault is not None:
            yield Violation(pointer, fault)


@dataclass(frozen=True)
class Properties(Kind):
    """An object that is kept and given back unread, so that a client's own keys survive.

    Attributes
    ----------
    most_bytes
        Its size as JSON in UTF-8, at most.
    """

    most_bytes: int = 4096

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:  # noqa: ARG002 - of all kinds
        """Yield that it is too large."""
        size = len(
            json.dumps(value, ensure_ascii=False, separators=(",", ":")).encode(errors="surrogatepass")
        )
        if size > self.most_bytes:
            yield Violation(
                pointer, said("{size} bytes as JSON, at most {most}", size=size, most=self.most_bytes)
            )
