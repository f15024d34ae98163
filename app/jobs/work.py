"""What jobs do: allocate, train, register. Only workers import this; the service knows it by name."""

from __future__ import annotations

import base64
import binascii
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

from app.domain.errors import InvalidCheckpoint
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.domain.records import problem_from_record, to_record
from app.domain.warnings import problem_warnings
from app.jobs import bounding
from app.jobs.answer_time import AnswerTime
from app.jobs.model import Progress, WorkResult
from app.jobs.time_limit import TimeLimit
from app.jobs.work_context import WorkContext
from app.jobs.worker import resolve
from app.simulation.explain import explain
from app.solvers import protocol
from app.solvers.registry import create_solver, parse_parameters

_VERIFY = "app.learning.checkpoint:verify"
"""Named, as the algorithms are, so that this room does not depend on the learners."""

answer_time = AnswerTime()


def allocate(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Solve a problem.

    Parameters
    ----------
    payload
        ``problem`` (a record), ``algorithm``, ``parameters``, ``seed``, ``library_url``, the database
        with the source policies, ``threads``, how many cores to keep busy, and ``bound_time_limit_s``, how
        long to look for a bound, where one is asked for; ``run_time_limit_s`` where time counts from here;
        ``keep_checkpoint``, whether to keep what is learned.
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
    problem = problem_from_record(payload["problem"])
    algorithm, seed = payload["algorithm"], payload["seed"]
    limit = TimeLimit(context, answer_time, problem, payload.get("bound_time_limit_s"))
    if limit.leaves_none_for(algorithm):
        return _at_once(problem, payload, limit, context)
    solver = create_solver(
        algorithm, parse_parameters(algorithm, payload["parameters"], stored=True), _means(payload, context)
    )
    solution = solver.solve(problem, seed, limit.searching, _report(context))
    limit.searched(algorithm)
    return _result(problem, solution, payload, limit)


def allocate_at_once(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Answer a request whose time is up before a worker was free for it: by the plan of the greedy rule.

    Needs no torch, so a process that does nothing else is light and soon ready.

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
    problem = problem_from_record(payload["problem"])
    limit = TimeLimit(context, answer_time, problem, payload.get("bound_time_limit_s"))
    return _at_once(problem, payload, limit, context)


def _at_once(problem: Problem, payload: dict[str, Any], limit: TimeLimit, context: WorkContext) -> WorkResult:
    """The greedy rule's plan, as far as it comes, in the name of the algorithm that was asked for."""
    greedy = create_solver("greedy", parse_parameters("greedy", {}), _means(payload, context))
    solution = greedy.solve(problem, payload["seed"], limit.bounding, _report(context))
    asked = parse_parameters(payload["algorithm"], payload["parameters"], stored=True)
    return _result(problem, replace(solution, parameters=asked), payload, limit)


def _means(payload: dict[str, Any], context: WorkContext) -> protocol.SolverContext:
    # A job that was stored by an earlier version says nothing of threads.
    threads = payload.get("threads", 1)
    return protocol.SolverContext(payload["library_url"], threads, lambda: threads * (context.share() - 1))


def _result(
    problem: Problem, solution: protocol.Solution, payload: dict[str, Any], limit: TimeLimit
) -> WorkResult:
    answer = _explained(problem, solution.plan, limit)
    source = solution.source_policy
    bound_limit_s = payload.get("bound_time_limit_s")
    result = {
        "algorithm": payload["algorithm"],
        "parameters": solution.parameters.model_dump(mode="json"),
        "seed": payload["seed"],
        **answer,
        "warnings": to_record(problem_warnings(problem)),
        "proof": bounding.proof_answer(problem, solution.proof),
        **bounding.bound_answer(problem, answer["reward"], bound_limit_s, limit.bounding),
        "source_policy": None if source is None else asdict(source),
        "history": {"epoch": solution.history.epoch, "reward": solution.history.reward},
    }
    return WorkResult(result, solution.checkpoint if payload.get("keep_checkpoint") else None)


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
        As in :func:`allocate`.
    """
    return allocate({**payload, "keep_checkpoint": True}, context)


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
        raise InvalidCheckpoint(f"the checkpoint is not base64: {error}") from None
    verify(checkpoint, problem_from_record(payload["problem"]))
    return WorkResult({}, checkpoint)


def _explained(problem: Problem, plan: Plan, limit: TimeLimit) -> dict[str, Any]:
    """Return an allocation by the field names of ``POST /allocate``, and note how long that took."""
    hurried, begun = limit.hurries(), time.perf_counter()
    explained = explain(problem, plan, limit.hurries)
    found = time.perf_counter()
    answer: dict[str, Any] = to_record(explained)
    answer["assignment"] = answer.pop("plan")["assignment"]
    answer_time.wrote(problem, time.perf_counter() - found)
    if hurried:
        answer_time.traced(problem, found - begun)
    elif not limit.hurries():
        answer_time.explained(problem, found - begun)
    return answer


def _report(context: WorkContext) -> Callable[[protocol.Progress], None]:
    """Pass progress on; the plan is written out only when it is another one."""
    written: tuple[Plan, list[list[int]]] | None = None

    def report(progress: protocol.Progress) -> None:
        nonlocal written
        if written is None or written[0] is not progress.incumbent:
            written = progress.incumbent, [list(row) for row in progress.incumbent.assignment]
        context.report(Progress(progress.fraction, progress.epoch, progress.best_reward, written[1]))

    return report


def verify(checkpoint: bytes, task: Problem) -> None:
    """Refuse a checkpoint that is not exactly what its architecture needs for a task.

    Raises
    ------
    InvalidCheckpoint
        With the reason.
    """
    resolve(_VERIFY)(checkpoint, task)
