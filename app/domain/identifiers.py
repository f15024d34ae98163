"""What an identifier of a UAV or a target may be: text in any script that stays in its place in a line.

Names are written in every script, so joiners (U+200C, U+200D), no-break spaces, soft hyphens, direction marks
and emoji sequences are characters like any other. Refused is what cannot stand in a line of text: control
characters, halves of surrogate pairs, and what makes the text after it read in another order. The two
overrides do that to every text, and no spelling needs them. Embeddings and isolates are taken where the
identifier closes them itself, as text that was copied from another program does.
"""

from __future__ import annotations

import re
import unicodedata

from app.domain.said import said

MAX_ID_LENGTH = 100
"""Longest identifier, in characters."""

ID_PATTERN = r"^[^\u0000-\u001f\u007f-\u009f\u202d\u202e]+$"
"""The rule as far as a pattern of JSON Schema can say it."""

_NEVER = re.compile(r"[\u0000-\u001f\u007f-\u009f\ud800-\udfff\u202d\u202e]")
_EMBEDDINGS, _ISOLATES = "\u202a\u202b", "\u2066\u2067\u2068"
_END_OF_EMBEDDING, _END_OF_ISOLATE = "\u202c", "\u2069"


def fault_of(identifier: str) -> str | None:
    """Say what is wrong with an identifier; None where nothing is.

    Returns
    -------
    str or None
        One clause, with the character that is at fault and its place, counted from 1.
    """
    if not 1 <= len(identifier) <= MAX_ID_LENGTH:
        return said("{count} characters, not in 1..{most}", count=len(identifier), most=MAX_ID_LENGTH)
    if identifier.isprintable():
        return None
    found = _NEVER.search(identifier)
    place = found.start() if found else _left_open(identifier)
    if place is None:
        return None
    character = identifier[place]
    category = unicodedata.category(character)
    if category == "Cc":
        why = said("a control character")
    elif category == "Cs":
        why = said("half of a surrogate pair")
    elif found:
        why = said("which makes the text after it read in another order")
    else:
        why = said("which is not closed, so the text after it reads in another order")
    name = unicodedata.name(character, "")
    return said(
        "{id!r} has {character} as character {place}, {why}",
        id=identifier,
        character=f"U+{ord(character):04X}{' ' if name else ''}{name}",
        place=place + 1,
        why=why,
    )


def _left_open(identifier: str) -> int | None:
    """Return the place of the first embedding or isolate that the identifier does not close."""
    open_at: list[int] = []
    for place, character in enumerate(identifier):
        if character in _EMBEDDINGS or character in _ISOLATES:
            open_at.append(place)
        elif character == _END_OF_EMBEDDING:
            if open_at and identifier[open_at[-1]] in _EMBEDDINGS:
                open_at.pop()
        elif character == _END_OF_ISOLATE:
            # It also ends the embeddings that were begun within the isolate.
            isolates = [at for at, each in enumerate(open_at) if identifier[each] in _ISOLATES]
            if isolates:
                del open_at[isolates[-1] :]
    return open_at[0] if open_at else None
