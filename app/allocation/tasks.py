"""What jobs do: allocate, train, register. Only workers import this; the service knows it by name."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import wraps
from typing import Any

from app.allocation import bounding
from app.allocation.answer_time import AnswerTime
from app.allocation.explaining import PENDING, REASONS, account_of
from app.allocation.found import BestKnown, Found, best_known
from app.allocation.legality import require_legal
from app.allocation.time_limit import TimeLimit
from app.domain.errors import InvalidCheckpoint
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.domain.records import problem_from_record, to_record
from app.domain.said import said
from app.domain.warnings import problem_warnings
from app.jobs.model import Progress, WorkResult
from app.jobs.worker import WorkContext, resolve
from app.simulation.compilation import told_of_compiling
from app.solvers import protocol
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import Deadline

_GREEDY = "greedy"

_VERIFY = "app.learning.checkpoints.checkpoint:verify"
"""Named, as the algorithms are, so that this room does not depend on the learners."""

answer_time = AnswerTime()

_Task = Callable[[dict[str, Any], WorkContext], WorkResult]


def _held_while_compiling(task: _Task) -> _Task:
    """Have a task say when it needs code that is not compiled: killed, it would need it again."""

    @wraps(task)
    def run(payload: dict[str, Any], context: WorkContext) -> WorkResult:
        with told_of_compiling(context.hold):
            return task(payload, context)

    return run


@_held_while_compiling
def allocate(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Solve a problem.

    Parameters
    ----------
    payload
        ``problem`` (a record), ``algorithm``, ``parameters``, ``seed``, ``library_url``, the database
        with the source policies, ``threads``, how many cores to keep busy, and ``bound_time_limit_s``, how
        long to look for a bound, where one is asked for; ``run_time_limit_s`` where time counts from here;
        ``keep_checkpoint``, whether to keep what is learned; and of a job that was begun before
        :data:`~app.jobs.model.BEST_KNOWN`, which the answer is not below.
    context
        Where progress goes. When it says stop, the best plan so far is the result.

    Returns
    -------
    WorkResult
        The answer of ``POST /allocate`` but for ``job_id`` and ``elapsed_s``; the artifact is the checkpoint
        of what was learned, where that is to be kept.

    Raises
    ------
    AllocatorError
        If the algorithm refuses the problem or its parameters.
    """
    if "run_time_limit_s" in payload:
        context.end_within(payload["run_time_limit_s"])
    problem = _problem_of(payload)
    algorithm, known = payload["algorithm"], best_known(problem, payload)
    limit = TimeLimit(context, answer_time, problem, payload.get("bound_time_limit_s"))
    if limit.leaves_none_for(algorithm):
        return _result(problem, _stand_in(problem, payload, limit, context), payload, limit)
    parameters = parse_parameters(algorithm, payload["parameters"], stored=True)
    keeps = bool(payload.get("keep_checkpoint"))
    solver = create_solver(algorithm, parameters, _means(payload, context), keeps_checkpoint=keeps)
    report = _report(context, algorithm, known)
    solution = solver.solve(problem, payload["seed"], limit.searching, report)
    limit.searched(algorithm)
    found = Found(solution, solution.answered_by or algorithm).or_better(problem, known)
    return _result(problem, found, payload, limit)


@_held_while_compiling
def allocate_at_once(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Answer a request whose time is up before a worker was free for it.

    The plan is the greedy rule's, or the best one of an earlier attempt. It needs no torch, so a process that
    does nothing else is light and soon ready. Others may wait for it: what can be left out is not looked for.

    Parameters
    ----------
    payload, context
        As :func:`allocate` takes them.

    Returns
    -------
    WorkResult
        As :func:`allocate` returns it where its algorithm has no time to begin; the algorithm's refusals,
        which need the algorithm, are left out.
    """
    problem = _problem_of(payload)
    limit = TimeLimit(context, answer_time, problem, payload.get("bound_time_limit_s"))
    limit.leave_out_what_can_be()
    return _result(problem, _stand_in(problem, payload, limit, context), payload, limit)


def complete_reasons(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Find the reasons for unmet needs that an answer had no time for.

    Parameters
    ----------
    payload
        As :func:`allocate` takes it, and ``result``, what it has returned.
    context
        Cancelled, it ends without them.

    Returns
    -------
    WorkResult
        The fields of the answer that change; unfinished where it was cancelled.
    """
    problem = problem_from_record(payload["problem"])
    plan = Plan(tuple(map(tuple, payload["result"]["assignment"])))
    found = account_of(problem, plan, context.cancelled, answer_time).fields
    changed = {name: found[name] for name in ("unmet", REASONS)}
    return WorkResult(changed, unfinished=found[REASONS] == PENDING)


def _problem_of(payload: dict[str, Any]) -> Problem:
    """Read the problem of an allocation; a plan to begin from that breaks a rule is refused."""
    problem = problem_from_record(payload["problem"])
    if problem.start_plan:
        require_legal(problem, Plan(problem.start_plan), "/start_plan")
    return problem


def _stand_in(problem: Problem, payload: dict[str, Any], limit: TimeLimit, context: WorkContext) -> Found:
    """Return the greedy rule's plan, as far as it comes, or a better one that is known."""
    known = best_known(problem, payload)
    tell = _report(context, _GREEDY, known)

    def report(progress: protocol.Progress) -> None:
        limit.had_a_plan()
        tell(progress)

    greedy = create_solver(_GREEDY, parse_parameters(_GREEDY, {}), _means(payload, context))
    limit.stand_in(_GREEDY)
    solution = greedy.solve(problem, payload["seed"], limit.standing_in, report)
    limit.stood_in(_GREEDY)
    asked = parse_parameters(payload["algorithm"], payload["parameters"], stored=True)
    return Found(replace(solution, parameters=asked), _GREEDY).or_better(problem, known)


def _means(payload: dict[str, Any], context: WorkContext) -> protocol.SolverContext:
    # A job that was stored by an earlier version says nothing of threads.
    threads = payload.get("threads", 1)
    return protocol.SolverContext(payload["library_url"], threads, lambda: threads * (context.share() - 1))


def _result(problem: Problem, found: Found, payload: dict[str, Any], limit: TimeLimit) -> WorkResult:
    solution = found.solution
    account = account_of(problem, solution.plan, limit.hurries, answer_time)
    limit.traced(account.size)
    source = solution.source_policy
    result = {
        "algorithm": payload["algorithm"],
        "answered_by": found.answered_by,
        "parameters": solution.parameters.model_dump(mode="json"),
        "seed": payload["seed"],
        **account.fields,
        "warnings": to_record(problem_warnings(problem)),
        "proof": bounding.proof_answer(solution.proof),
        **_bound(problem, account.fields["reward"], payload.get("bound_time_limit_s"), limit),
        "source_policy": None if source is None else asdict(source),
        "history": {"epoch": solution.history.epoch, "reward": solution.history.reward},
    }
    checkpoint = solution.checkpoint if payload.get("keep_checkpoint") else None
    return WorkResult(result, checkpoint, unfinished=account.fields[REASONS] == PENDING)


def _bound(problem: Problem, reward: float, bound_limit_s: float | None, limit: TimeLimit) -> dict[str, Any]:
    if bound_limit_s is None or limit.leaves_no_bound():
        return bounding.bound_answer(problem, reward, bound_limit_s, Deadline(0.0))
    answer = bounding.bound_answer(problem, reward, bound_limit_s, limit.bounding)
    limit.bounded()
    return answer


def train(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Train a source policy on a task, which is what solving it by an algorithm that learns does.

    Parameters
    ----------
    payload
        As :func:`allocate` takes it, and ``name``, which is for the registration.
    context
        As in :func:`allocate`.

    Raises
    ------
    AllocatorError
        As in :func:`allocate`; or if what was learned cannot be used, because the training has diverged.
    """
    done = allocate({**payload, "keep_checkpoint": True}, context)
    if done.artifact is not None:
        verify(done.artifact, problem_from_record(payload["problem"]))
    return done


def register(payload: dict[str, Any], context: WorkContext) -> WorkResult:  # noqa: ARG001 - nothing to report
    """Check a checkpoint against its source task; to store it is the service's.

    Parameters
    ----------
    payload
        ``problem`` (a record), ``checkpoint_base64``, and ``name``, which is for the registration.
    context
        Not used: the check takes milliseconds.

    Returns
    -------
    WorkResult
        An empty result; the artifact is the checkpoint.

    Raises
    ------
    InvalidCheckpoint
        If it is not exactly what its architecture needs, or does not fit the task.
    """
    try:
        checkpoint = base64.b64decode(payload["checkpoint_base64"], validate=True)
    except binascii.Error as error:
        raise InvalidCheckpoint(said("the checkpoint is not base64: {why}", why=str(error))) from None
    verify(checkpoint, problem_from_record(payload["problem"]))
    return WorkResult({}, checkpoint)


def _report(
    context: WorkContext, algorithm: str, known: BestKnown | None
) -> Callable[[protocol.Progress], None]:
    """Pass progress on, never below what an earlier attempt found; a plan is written out only when it is
    another one."""
    written: tuple[Plan, list[list[int]]] | None = None

    def report(progress: protocol.Progress) -> None:
        nonlocal written
        plan, reward, answered_by = progress.incumbent, progress.best_reward, algorithm
        if known is not None and known.reward > reward:
            plan, reward, answered_by = known.plan, known.reward, known.answered_by
        if written is None or written[0] is not plan:
            written = plan, [list(row) for row in plan.assignment]
        context.report(Progress(progress.fraction, progress.epoch, reward, written[1], answered_by))

    return report


def verify(checkpoint: bytes, task: Problem) -> None:
    """Refuse a checkpoint that is not exactly what its architecture needs for a task.

    Raises
    ------
    InvalidCheckpoint
        With the reason.
    """
    resolve(_VERIFY)(checkpoint, task)
