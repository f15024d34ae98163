"""Every error that the allocator raises on purpose.

AllocatorError
 ├─ InvalidProblem          a problem breaks a rule of the specification's section 1
 ├─ IllegalPlan             a plan breaks a rule of sections 2 and 3
 ├─ UnknownAlgorithm        no algorithm has that name
 ├─ InvalidParameters       an algorithm's parameters are unknown or out of range
 ├─ ProblemTooLarge         an algorithm cannot hold a problem of that size
 ├─ NoCompatibleSource      the library has no source task that could be transferred
 └─ InvalidCheckpoint       a checkpoint is not what its architecture needs

Each class has a ``code``, a stable name for programs; ``violations`` lists what is wrong field by field
where that is known, and ``details`` holds further JSON-ready facts. None of them knows HTTP.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True, slots=True)
class Violation:
    """One broken rule: where (a JSON pointer into the request, RFC 6901) and what, mostly :class:`.Said`."""

    pointer: str
    detail: str


def escaped(step: str | int) -> str:
    """Write a name or an index as a step of a JSON pointer."""
    return str(step).replace("~", "~0").replace("/", "~1")


class AllocatorError(Exception):
    """Root of the tree: a message, and facts that a program can read.

    Parameters
    ----------
    detail
        One sentence for a person, with the offending value and the limit.
    violations
        What is wrong, field by field.
    details
        Further facts, JSON-ready.
    """

    code: ClassVar[str] = "allocator-error"

    def __init__(
        self, detail: str, violations: Sequence[Violation] = (), details: Mapping[str, Any] | None = None
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.violations = tuple(violations)
        self.details = dict(details or {})


class InvalidProblem(AllocatorError):
    """A problem breaks a rule of section 1; ``violations`` lists every one that was found."""

    code = "invalid-problem"

    @classmethod
    def of(cls, violations: Sequence[Violation]) -> InvalidProblem:
        """Make the error out of at least one violation."""
        first = violations[0]
        more = f" (and {len(violations) - 1} more)" if len(violations) > 1 else ""
        return cls(f"{first.pointer or 'problem'}: {first.detail}{more}", violations)


class IllegalPlan(AllocatorError):
    """A plan has an action that is not allowed; ``details`` has step, uav_id and rule."""

    code = "illegal-plan"


class UnknownAlgorithm(AllocatorError):
    """No algorithm has that name; ``details["algorithms"]`` lists those there are."""

    code = "unknown-algorithm"


class InvalidParameters(AllocatorError):
    """An algorithm's parameters are unknown or out of range."""

    code = "invalid-parameters"


class ProblemTooLarge(AllocatorError):
    """An algorithm cannot hold a problem of that size; the message names size and limit."""

    code = "problem-too-large"


class NoCompatibleSource(AllocatorError):
    """No source task in the library fits; ``details["sizes"]`` lists the sizes there are."""

    code = "no-compatible-source"


class InvalidCheckpoint(AllocatorError):
    """A checkpoint is not exactly what its architecture needs."""

    code = "invalid-checkpoint"
