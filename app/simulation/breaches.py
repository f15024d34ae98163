"""Every action of a plan that breaks a rule, with the figures: what it needs, and what there is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation import replay, simulator, visit
from app.simulation.amounts import Amounts
from app.simulation.arrays import Floats, ProblemArrays, compile_problem
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.evaluation import replay_at_best

NAMES = {
    visit.RETURNING: "returning",
    visit.BARRED: "barred",
    visit.OUT_OF_RANGE: "range",
    visit.TOO_LATE: "deadline",
    visit.COMMITTED_ELSEWHERE: "committed",
    visit.TOO_LONG_ALOFT: "endurance",
    visit.HOME_TOO_LATE: "available_until",
    visit.RELOADED: "reloaded",
    visit.UNLOADS_NOTHING: "unloads_nothing",
    visit.NO_SUCH_ACTION: "no_such_action",
    visit.TOO_MANY_STEPS: "max_steps",
    visit.TOO_MUCH: "too_much",
    visit.NOT_IN_STOCK: "stock",
    visit.TOO_HEAVY: "capacity",
}
"""Rules for programs."""


@dataclass(frozen=True, slots=True)
class Breach:
    """An action that is not allowed.

    Attributes
    ----------
    step
        From 1.
    uav_id, target_id, base_id
        The UAV, and the target or base that it is sent to; None where there is none.
    rule, says
        The rule for programs, and for people.
    needed, had
        What the action needs of what the rule limits, and what there is; None where the rule has no figures.
    """

    step: int
    uav_id: str | None
    target_id: str | None
    rule: str
    says: str
    needed: float | None = None
    had: float | None = None
    base_id: str | None = None


def breaches_of(problem: Problem, plan: Plan, amounts: Amounts | None = None) -> list[Breach]:
    """List the actions of a plan that break a rule, in the plan's order.

    An action that is not allowed is left out, and the plan goes on without it. Where unloading is planned
    these are the actions that no amounts allow; if there are none, the first that these amounts forbid.

    Parameters
    ----------
    problem, plan
        The problem, and the plan of it.
    amounts
        What its stops unload and load, where that is planned; the best amounts by default.
    """
    if not problem.plans_unloading:
        return _walked(problem, plan)
    forbidden = _forbidden(problem, plan, amounts)
    return [] if forbidden == [] else _walked(problem, plan) or forbidden or []


def _forbidden(problem: Problem, plan: Plan, amounts: Amounts | None) -> list[Breach] | None:
    """Return the first action that a replay with amounts refuses; None where there cannot be any amounts."""
    last = problem.n_targets + problem.n_bases
    sound = all(0 <= action <= last for row in plan.assignment for action in row)
    if not sound or len(plan.assignment) > problem.max_steps:
        return None
    arrays, actions = compile_problem(problem), plan.as_array()
    if amounts is None:
        result, _ = replay_at_best(arrays, actions, planned=True)
    else:
        result = replay.replay_with(arrays, actions, amounts)
    rule, s, i = (int(each[0]) for each in (result.rule, result.step, result.uav))
    return [] if rule == visit.ALLOWED else [_breach(problem, s, i, int(actions[s, i]), rule)]


def _walked(problem: Problem, plan: Plan) -> list[Breach]:
    """List the actions that are not allowed; where unloading is planned, whatever they unload."""
    arrays, n = compile_problem(problem), problem.n_targets
    last = n + problem.n_bases
    episodes, figures, found = simulator.new_episodes(arrays, 1), np.zeros(2), []
    for s, row in enumerate(plan.assignment):
        if s >= problem.max_steps:
            needed, had = float(len(plan.assignment)), float(problem.max_steps)
            found.append(_breach(problem, s, None, None, visit.TOO_MANY_STEPS, needed, had))
            break
        for i, action in enumerate(row):
            if not 0 <= action <= last:
                found.append(_breach(problem, s, i, None, visit.NO_SUCH_ACTION))
                continue
            if problem.plans_unloading and action < n:
                episodes.load[0, i] = episodes.need[0, action] = 1.0
            rule = visit.ALLOWED if action == n else int(simulator.verdict(arrays, episodes, 0, i, action))
            if rule == visit.ALLOWED:
                simulator.act(arrays, episodes, 0, i, action)
                continue
            figures[:] = np.nan
            _measure(arrays, episodes, i, action, rule, figures)
            known = [None if np.isnan(figure) else float(figure) for figure in figures]
            found.append(_breach(problem, s, i, action, rule, *known))
    return found


def _breach(
    problem: Problem,
    s: int,
    i: int | None,
    j: int | None,
    rule: int,
    needed: float | None = None,
    had: float | None = None,
) -> Breach:
    uav = None if i is None else problem.uavs[i]
    n = problem.n_targets
    target = None if j is None or j > n else problem.targets[j]
    base = None if j is None or j < n else problem.bases[j - n - 1]
    says = visit.RULES[rule]
    if rule == visit.BARRED and uav is not None and target is not None:
        lacked = sorted(set(target.skills) - set(uav.skills))
        if target.id in uav.excluded:
            says = f"{target.id} is excluded for {uav.id}"
        elif lacked:
            says = f"{uav.id} lacks {', '.join(lacked)}"
        else:
            says = "no way leads there, or home from there"
    if rule == visit.BARRED and uav is not None and base is not None:
        allowed = uav.bases is None or base.id in uav.bases
        says = "no way leads there" if allowed else f"{uav.id} may not use {base.id}"
    uav_id, target_id, base_id = (None if each is None else each.id for each in (uav, target, base))
    return Breach(s + 1, uav_id, target_id, NAMES[rule], says, needed, had, base_id)


@compiled
def _measure(arrays: ProblemArrays, episodes: Episodes, i: int, j: int, rule: int, figures: Floats) -> None:
    """Write down what a visit needs that a rule forbids, and what there is."""
    length = visit.leg(arrays, 0, i, episodes.at[0, i], j)
    time = visit.leg_time(arrays, 0, i, episodes.at[0, i], j, length)
    clock = episodes.clock[0, i]
    end = visit.departure_after(arrays, 0, j, clock + time)
    if rule == visit.OUT_OF_RANGE:
        flown = episodes.flown[0, i] + visit.air_length(arrays, 0, i, length, time)
        figures[0] = visit.flown_with_return(arrays, 0, i, j, flown)
        figures[1] = arrays.uavs[0, i].voyage
    elif rule == visit.TOO_LATE:
        figures[0], figures[1] = clock + time, arrays.areas[0, j].deadline
    elif rule == visit.TOO_LONG_ALOFT:
        aloft = visit.aloft_after(
            arrays, 0, i, episodes.at[0, i], episodes.aloft[0, i], clock, clock + time, end, j
        )
        figures[0] = aloft + visit.time_home(arrays, 0, i, j)
        figures[1] = arrays.uavs[0, i].endurance
    elif rule == visit.HOME_TOO_LATE:
        figures[0], figures[1] = end + visit.time_home(arrays, 0, i, j), arrays.uavs[0, i].until
