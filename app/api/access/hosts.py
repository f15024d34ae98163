"""Names by which a service may be called.

A web page may let its own name lead to the address of a service on the visitor's machine (DNS rebinding); the
browser then takes both for one origin, and the page reads all that needs no key. What gives it away is the
name in the header ``Host``. An address there is no name that somebody else could point elsewhere.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Sequence

_ANY = "*"


class Hosts:
    """The names that are taken.

    Parameters
    ----------
    listening
        The address or name that the server listens on.
    named
        Further names that an operator allows; ``*``: any.

    Attributes
    ----------
    were_named
        Whether an operator has named any.
    """

    def __init__(self, listening: str, named: Sequence[str]) -> None:
        self.were_named = bool(named)
        self._any = _ANY in named
        names = (*named, listening, "localhost", socket.gethostname())
        self._names = {name.lower().rstrip(".") for name in names}

    def may_be(self, header: str | None) -> bool:
        """Say whether a request with this ``Host`` is taken; one without any comes from no browser."""
        if header is None or self._any:
            return True
        name = _without_port(header)
        return name.lower().rstrip(".") in self._names or _is_address(name)


def _without_port(header: str) -> str:
    if header.startswith("["):
        return header[1:].partition("]")[0]
    return header.partition(":")[0]


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
