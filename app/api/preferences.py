"""The request's ``Prefer`` header (RFC 7240): whether to wait for a job, and for how long."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

_MOST_DIGITS = 9


@dataclass(frozen=True, slots=True)
class Preferences:
    """What a client prefers.

    Attributes
    ----------
    respond_async
        Answer 202 at once, or once ``wait_s`` has passed.
    wait_s
        Wait for the answer that long; None without such a wish.
    """

    respond_async: bool = False
    wait_s: int | None = None

    @classmethod
    def of(cls, headers: Sequence[str]) -> Preferences:
        """Read the headers; what is unknown or malformed is ignored, as RFC 7240 wants it."""
        respond_async, wait_s = False, None
        for preference in ",".join(headers).split(","):
            name, _, value = (part.strip() for part in preference.split(";")[0].partition("="))
            value = value.strip('"')
            if name.lower() == "respond-async":
                respond_async = True
            elif name.lower() == "wait" and wait_s is None and value.isascii() and value.isdigit():
                wait_s = int(value[:_MOST_DIGITS])
        return cls(respond_async, wait_s)

    @property
    def patience_s(self) -> float | None:
        """Seconds to wait for a job before the answer is 202; None waits until it ends."""
        if self.wait_s is not None:
            return float(self.wait_s)
        return 0.0 if self.respond_async else None

    @property
    def applied(self) -> str:
        """Value of ``Preference-Applied``; empty where there was no preference."""
        wait = [] if self.wait_s is None else [f"wait={self.wait_s}"]
        return ", ".join((["respond-async"] if self.respond_async else []) + wait)
