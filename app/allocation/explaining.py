"""The answer's account of a plan, with as many reasons for unmet needs as there is time for."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from app.allocation.answer_time import AnswerSize, AnswerTime
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.domain.records import to_record
from app.simulation.amounts import Amounts
from app.simulation.explain import explain

REASONS, COMPLETE, PENDING = "reasons", "complete", "pending"
"""The answer's field that says whether the reasons are all there, or are still to be completed."""


@dataclass(frozen=True, slots=True)
class Account:
    """What follows from a plan.

    Attributes
    ----------
    fields
        An allocation by the field names of ``POST /allocate``, and whether its reasons are complete.
    size
        How much there was to write down.
    """

    fields: dict[str, Any]
    size: AnswerSize


def account_of(
    problem: Problem,
    plan: Plan,
    hurry: Callable[[], bool],
    times: AnswerTime,
    amounts: Amounts | None = None,
) -> Account:
    """Replay a plan and write down what follows from it.

    Parameters
    ----------
    problem, plan
        The problem and a legal plan of it.
    hurry
        Once it is true, reasons are looked for no further.
    times
        Told how long all that took.
    amounts
        What its stops unload and load, where that is planned; the best amounts by default.
    """
    watch = _Watch(hurry)
    begun = time.perf_counter()
    allocation = explain(problem, plan, watch, amounts)
    explained = time.perf_counter()
    fields: dict[str, Any] = to_record(allocation)
    written = time.perf_counter()
    fields["assignment"] = fields.pop("plan")["assignment"]
    fields[REASONS] = PENDING if watch.hurried else COMPLETE

    visits = sum(len(route.stops) for route in allocation.routes)
    size = AnswerSize(visits, len(allocation.unmet))
    looking_since = explained if watch.first_asked is None else watch.first_asked
    times.traced(problem, size, looking_since - begun)
    times.looked(problem, size, explained - looking_since, finished=not watch.hurried)
    times.wrote(problem, size, written - explained)
    return Account(fields, size)


class _Watch:
    """Remembers when the look for reasons began, which is when somebody first asks, and how it ended."""

    def __init__(self, hurry: Callable[[], bool]) -> None:
        self._hurry = hurry
        self.first_asked: float | None = None
        self.hurried = False

    def __call__(self) -> bool:
        if self.first_asked is None:
            self.first_asked = time.perf_counter()
        self.hurried = self.hurried or self._hurry()
        return self.hurried
