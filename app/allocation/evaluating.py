"""A plan of somebody's own, evaluated without any search."""

from __future__ import annotations

from typing import Any

import numpy as np

from app.allocation import bounding
from app.allocation.answer_time import AnswerTime
from app.allocation.explaining import account_of
from app.allocation.legality import require_legal
from app.domain.plan import Plan
from app.domain.records import problem_from_record, problem_to_record, to_record
from app.domain.warnings import problem_warnings
from app.jobs.model import WorkResult
from app.jobs.worker import WorkContext
from app.simulation.amounts import Amounts
from app.simulation.mid_mission import remaining_at
from app.solvers.stop import Deadline

_TIMES = AnswerTime()
"""How long accounts take; nobody asks."""


def evaluate(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Say what a plan earns, when what happens in it, and which of its actions break a rule.

    Parameters
    ----------
    payload
        ``problem`` (a record), ``assignment``, ``delivered`` and ``loaded`` where planned amounts are given,
        ``bound_time_limit_s`` where a bound is asked for, and ``at``, a clock, where the problem that remains
        then is. ``warnings``: of how the plan was read, which the answer has before its own.
    context
        Once it is cancelled, reasons are looked for no further.

    Returns
    -------
    WorkResult
        The answer of ``POST /evaluate`` but for ``job_id`` and ``elapsed_s``.

    Raises
    ------
    IllegalPlan
        As :func:`~app.allocation.legality.require_legal` raises it.
    """
    problem = problem_from_record(payload["problem"])
    plan = Plan(tuple(map(tuple, payload["assignment"])))
    amounts = _amounts(payload)
    require_legal(problem, plan, "/assignment", amounts)
    fields = account_of(problem, plan, context.cancelled, _TIMES, amounts).fields
    limit = payload.get("bound_time_limit_s")
    at = payload.get("at")
    result = {
        **fields,
        "warnings": [*payload.get("warnings", ()), *to_record(problem_warnings(problem))],
        **bounding.bound_answer(problem, fields["reward"], limit, Deadline(limit or 0.0)),
        "remaining": None if at is None else problem_to_record(remaining_at(problem, plan, at, amounts)),
    }
    return WorkResult(result)


def _amounts(payload: dict[str, Any]) -> Amounts | None:
    """Return the amounts that are given with a plan; reloads take nothing where theirs are not."""
    if "delivered" not in payload:
        return None
    delivered = np.array(payload["delivered"], np.float64)
    return Amounts(delivered, np.array(payload.get("loaded", np.zeros_like(delivered)), np.float64))
