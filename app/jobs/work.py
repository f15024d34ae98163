"""What jobs do: allocate, train, register. Only workers import this; the service knows it by name."""

from __future__ import annotations

import base64
import binascii
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from importlib import import_module
from typing import Any

import numpy as np

from app.domain.errors import InvalidCheckpoint
from app.domain.plan import Plan
from app.domain.problem import UAV, Problem, Target
from app.domain.records import problem_from_record, problem_to_record, to_record
from app.jobs import bounding
from app.jobs.answer_time import AnswerTime
from app.jobs.model import Progress, WorkResult
from app.jobs.time_limit import TimeLimit
from app.jobs.work_context import WorkContext
from app.simulation.arrays import compile_problem
from app.simulation.explain import explain
from app.simulation.generator import generate
from app.solvers import protocol
from app.solvers.registry import create_solver, parse_parameters

_VERIFY = "app.learning.checkpoint:verify"
_WARM_UP_TRANSFER = "app.learning.universal.warm_up:warm_up"
_PRELOAD = "app.learning.source_policies:preload"

_answer_time = AnswerTime()
_LARGEST_TRIED = (1000, 2000)
"""UAVs and areas of the problem on which the warm-up tries how long answers take, at most."""

_OVERRUNS_TIMED = {
    **dict.fromkeys(("ga", "local_search", "auto", "exact"), _LARGEST_TRIED),
    "qmix": (100, 300),
}
"""Algorithms whose preparations are timed by the warm-up, and at what size at most."""

_ALONE = protocol.SolverContext()

_WARM_UP_PARAMETERS: dict[str, dict[str, Any]] = {
    "greedy": {},
    "ga": {"num_total": 4, "iteration": 2},
    "local_search": {"moves": 200},
    "auto": {"moves": 200, "policy": False},
    "exact": {"nodes": 10},
    "dqn": {"n_epochs": 4, "evaluate_per_epoch": 2, "buffer_size": 2, "batch_size": 2, "learning_starts": 1},
    # In service mode nothing that the transfer's warm-up leaves out.
    "qmix": {
        "mode": "paper",
        "n_epochs": 4,
        "evaluate_per_epoch": 2,
        "buffer_size": 2,
        "batch_size": 2,
        "learning_starts": 1,
    },
}


def allocate(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Solve a problem.

    Parameters
    ----------
    payload
        ``problem`` (a record), ``algorithm``, ``parameters``, ``seed``, ``library_url``, the database
        with the source policies, ``threads``, how many cores to keep busy, and ``bound_time_limit_s``, how
        long to look for a bound, where one is asked for; ``run_time_limit_s`` where time counts from here.
    context
        Where progress goes. When it says stop, the best plan so far is the result.

    Returns
    -------
    WorkResult
        The answer of ``POST /allocate`` but for ``job_id`` and ``elapsed_s``; the artifact is the checkpoint
        of what was learned.

    Raises
    ------
    AllocatorError
        If the algorithm refuses the problem or its parameters.
    """
    if "run_time_limit_s" in payload:
        context.end_within(payload["run_time_limit_s"])
    problem = problem_from_record(payload["problem"])
    algorithm, seed = payload["algorithm"], payload["seed"]
    limit = TimeLimit(context, _answer_time, problem, payload.get("bound_time_limit_s"))
    if limit.leaves_none_for(algorithm):
        return _at_once(problem, payload, limit, context)
    solver = create_solver(
        algorithm, parse_parameters(algorithm, payload["parameters"]), _means(payload, context)
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
    limit = TimeLimit(context, _answer_time, problem, payload.get("bound_time_limit_s"))
    return _at_once(problem, payload, limit, context)


def _at_once(problem: Problem, payload: dict[str, Any], limit: TimeLimit, context: WorkContext) -> WorkResult:
    """The greedy rule's plan, as far as it comes, in the name of the algorithm that was asked for."""
    greedy = create_solver("greedy", parse_parameters("greedy", {}), _means(payload, context))
    solution = greedy.solve(problem, payload["seed"], limit.bounding, _report(context))
    asked = parse_parameters(payload["algorithm"], payload["parameters"])
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
        "proof": bounding.proof_answer(problem, solution.proof),
        **bounding.bound_answer(problem, answer["reward"], bound_limit_s, limit.bounding),
        "source_policy": None if source is None else asdict(source),
        "history": {"epoch": solution.history.epoch, "reward": solution.history.reward},
    }
    return WorkResult(result, solution.checkpoint)


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
    return allocate(payload, context)


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
    _verify(checkpoint, problem_from_record(payload["problem"]))
    return WorkResult({}, checkpoint)


def warm_up(most_uavs: int = 50, most_targets: int = 100, library_url: str | None = None) -> None:
    """Load and compile what every kind of job needs, so that nobody waits for it later.

    Parameters
    ----------
    most_uavs, most_targets
        Size of the largest problem that is to be expected; how long answers take is tried on it.
    library_url
        Database with the source policies that jobs will ask for.
    """
    problem = _small_problem()
    for algorithm, parameters in _WARM_UP_PARAMETERS.items():
        work = allocate(_request(problem, algorithm, parameters), _unlimited())
        if work.artifact is not None:
            _verify(work.artifact, problem)
    _named(_WARM_UP_TRANSFER)(problem)
    if library_url is not None:
        _named(_PRELOAD)(library_url, problem)
    bounding.warm_up(problem)
    compile_problem(replace(problem, crs="wgs84"))
    _time_answers(most_uavs, most_targets)
    for algorithm, most in _OVERRUNS_TIMED.items():
        large = _large_problem(min(most_uavs, most[0]), min(most_targets, most[1]))
        solver = create_solver(algorithm, parse_parameters(algorithm, {}), _ALONE)
        for _ in range(2):
            begun = time.perf_counter()
            solver.solve(large, 0, lambda: True, lambda _progress: None)
            overrun = time.perf_counter() - begun
        _answer_time.overran(algorithm, large, overrun)


def warm_up_at_once(most_uavs: int = 50, most_targets: int = 100) -> None:
    """Load and compile what :func:`allocate_at_once` needs; see :func:`warm_up`."""
    problem = _small_problem()
    allocate_at_once({**_request(problem, "greedy", {}), "bound_time_limit_s": 1.0}, _unlimited())
    compile_problem(replace(problem, crs="wgs84"))
    _time_answers(most_uavs, most_targets)


def _time_answers(most_uavs: int, most_targets: int) -> None:
    """Know how long answers take here before the first one is asked for in a short time.

    The problem is a large one, so that the memory is there too that such a one takes: the system may need
    longer to find it than all the work takes that is done in it.
    """
    problem = _small_problem()
    planned = replace(problem, objective=replace(problem.objective, unloading="planned"))
    largest = _large_problem(min(most_uavs, _LARGEST_TRIED[0]), min(most_targets, _LARGEST_TRIED[1]))
    for each in (planned, largest):
        allocate_at_once(_request(each, "greedy", {}), _unlimited())
    _answer_time.forget()
    for _ in range(3):
        allocate_at_once(_request(largest, "greedy", {}), _unlimited())
        allocate_at_once(_request(largest, "greedy", {}), WorkContext.in_process(_untold, time_limit_s=0.0))


def _small_problem() -> Problem:
    # Floats throughout, as requests have them: an array of integers would be compiled for apart.
    at, home = (1.0, 2.0), (0.0, 0.0)
    return Problem(
        uavs=tuple(UAV(f"uav-{i}", *home, *home, 1.0, 10.0, (2.0, 1.0)) for i in (1, 2)),
        targets=tuple(Target(f"area-{j}", *at, 9.0, (1.0, 2.0), deadline=9.0) for j in (1, 2, 3)),
        max_steps=2,
    )


def _large_problem(n_uavs: int, n_targets: int) -> Problem:
    return generate("uniform", n_uavs, n_targets, 3, np.random.default_rng(0))


def _request(problem: Problem, algorithm: str, parameters: dict[str, Any]) -> dict[str, Any]:
    record = problem_to_record(problem)
    return {
        "problem": record, "algorithm": algorithm, "parameters": parameters, "seed": 0, "library_url": None
    }  # fmt: skip


def _unlimited() -> WorkContext:
    return WorkContext.in_process(_untold, time_limit_s=None)


def _untold(_progress: Progress) -> None:
    """Nobody waits for a warm-up's progress."""


def _explained(problem: Problem, plan: Plan, limit: TimeLimit) -> dict[str, Any]:
    """Return an allocation by the field names of ``POST /allocate``, and note how long that took."""
    hurried, begun = limit.hurries(), time.perf_counter()
    explained = explain(problem, plan, limit.hurries)
    found = time.perf_counter()
    answer: dict[str, Any] = to_record(explained)
    answer["assignment"] = answer.pop("plan")["assignment"]
    _answer_time.wrote(problem, time.perf_counter() - found)
    if hurried:
        _answer_time.traced(problem, found - begun)
    elif not limit.hurries():
        _answer_time.explained(problem, found - begun)
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


def _verify(checkpoint: bytes, task: Problem) -> None:
    _named(_VERIFY)(checkpoint, task)


def _named(dotted: str) -> Callable[..., Any]:
    """Find a function by name, like the algorithms, so that this room does not depend on the learners."""
    module, _, name = dotted.partition(":")
    found: Callable[..., Any] = getattr(import_module(module), name)
    return found
