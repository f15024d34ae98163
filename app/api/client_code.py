"""The client that waits, from the asynchronous one: the same code without ``async`` and ``await``."""

from __future__ import annotations

import re
from collections.abc import Mapping

MODULES: Mapping[str, str] = {
    "asynchronous_connection.py": "connection.py",
    "asynchronous.py": "synchronous.py",
}
"""Modules of the client that are written by hand, and those that are made of them."""

_NOTE = "\nWritten by ``python -m app.api.published`` from ``{source}``.\n"
_REPLACED: Mapping[str, str] = {
    r"async (def|with|for)\b": r"\1",
    r"\bawait ": "",
    r"``async with``": "``with``",
    r"\bAsyncClient\b": "Client",
    r"\bAsyncConnection\b": "Connection",
    r"\basynchronous_connection\b": "connection",
    r"\bAsyncGenerator\b": "Generator",
    r"\baclosing\b": "closing",
    r"\ba(read|iter_lines|close)\(": r"\1(",
    r"__a(enter|exit)__": r"__\1__",
    r"\bimport asyncio\n": "",
    r"\basyncio\.sleep\b": "time.sleep",
}


def synchronous(source: str, name: str) -> str:
    """Turn a module of the asynchronous client into one that waits.

    Parameters
    ----------
    source
        The module.
    name
        Its file's.
    """
    for pattern, replacement in _REPLACED.items():
        source = re.sub(pattern, replacement, source)
    first, rest = source.split('"""\n', 1)
    return f'{first}\n{_NOTE.format(source=name)}"""\n{rest}'
