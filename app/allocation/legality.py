"""Refusing a plan that a request brings and that breaks a rule, with every action that does."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from app.domain.errors import IllegalPlan, Violation
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.amounts import Amounts
from app.simulation.breaches import Breach, breaches_of


def require_legal(problem: Problem, plan: Plan, pointer: str, amounts: Amounts | None = None) -> None:
    """Refuse a plan that breaks a rule.

    Parameters
    ----------
    problem, plan
        The problem, and the plan of it.
    pointer
        JSON pointer to the plan in the request.
    amounts
        What its stops unload and load, where that is planned; the best amounts by default.

    Raises
    ------
    IllegalPlan
        With a violation for every action that breaks a rule, and the figures in ``details["breaches"]``.
        Where unloading is planned, and no rule but that of amounts is broken, with the first one.
    """
    breaches = breaches_of(problem, plan, amounts)
    if not breaches:
        return
    place = {uav.id: f"/{i}" for i, uav in enumerate(problem.uavs)}
    violations = [
        Violation(f"{pointer}/{breach.step - 1}{place.get(breach.uav_id or '', '')}", _figures(breach))
        for breach in breaches
    ]
    first = breaches[0]
    more = f" (and {len(breaches) - 1} more)" if len(breaches) > 1 else ""
    raise IllegalPlan(
        f"step {first.step}, {_figures(first)}{more}",
        violations,
        details={"breaches": [_recorded(breach) for breach in breaches]},
    )


def _recorded(breach: Breach) -> dict[str, Any]:
    """Return a breach as it is answered: with a base only where it is about one."""
    return {name: each for name, each in asdict(breach).items() if name != "base_id" or each is not None}


def _figures(breach: Breach) -> str:
    """Write a broken rule with its figures."""
    who = "the plan" if breach.uav_id is None else breach.uav_id
    stop = breach.base_id if breach.target_id is None else breach.target_id
    where = "" if stop is None else f" to {stop}"
    says = f"{who}{where}: {breach.says}"
    if breach.needed is None or breach.had is None:
        return says
    return f"{says}: {breach.needed:.6g} needed, {breach.had:.6g} there"
