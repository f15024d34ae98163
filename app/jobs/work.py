"""What jobs do: allocate, train, register. Only workers import this; the service knows it by name."""

from __future__ import annotations

import base64
import binascii
import math
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
from app.jobs.work_context import WorkContext
from app.simulation.arrays import compile_problem
from app.simulation.explain import explain
from app.simulation.generator import generate
from app.solvers import protocol
from app.solvers.greedy import greedy_plan
from app.solvers.registry import create_solver, parse_parameters

_VERIFY = "app.learning.checkpoint:verify"
_WARM_UP_TRANSFER = "app.learning.universal.warm_up:warm_up"

_answer_time = AnswerTime()
_SIZE_TIMED = (50, 100, 3)
"""UAVs, areas and materials of the problem whose explanation is timed by the warm-up."""

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
        long to look for a bound, where one is asked for.
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
    problem = problem_from_record(payload["problem"])
    algorithm, seed = payload["algorithm"], payload["seed"]
    parameters = parse_parameters(algorithm, payload["parameters"])
    # A job that was stored by an earlier version says nothing of threads.
    solver_context = protocol.SolverContext(payload["library_url"], payload.get("threads", 1))
    solver = create_solver(algorithm, parameters, solver_context)
    bound_limit_s = payload.get("bound_time_limit_s")
    solution = solver.solve(problem, seed, _stop(problem, context, bound_limit_s), _report(context))
    answer = _explained(problem, solution.plan)
    source = solution.source_policy
    result = {
        "algorithm": algorithm,
        "parameters": solution.parameters.model_dump(mode="json"),
        "seed": seed,
        **answer,
        "proof": bounding.proof_answer(problem, solution.proof),
        **bounding.bound_answer(problem, answer["reward"], bound_limit_s, _stop(problem, context)),
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


def warm_up() -> None:
    """Load and compile what every kind of job needs, so that nobody waits for it later."""
    # Floats throughout, as requests have them: an array of integers would be compiled for apart.
    at, home = (1.0, 2.0), (0.0, 0.0)
    problem = Problem(
        uavs=tuple(UAV(f"uav-{i}", *home, *home, 1.0, 10.0, (2.0, 1.0)) for i in (1, 2)),
        targets=tuple(Target(f"area-{j}", *at, 9.0, (1.0, 2.0), deadline=9.0) for j in (1, 2, 3)),
        max_steps=2,
    )
    payload = {"problem": problem_to_record(problem), "seed": 0, "library_url": None}
    for algorithm, parameters in _WARM_UP_PARAMETERS.items():
        context = WorkContext.in_process(lambda _progress: None, time_limit_s=None)
        work = allocate({**payload, "algorithm": algorithm, "parameters": parameters}, context)
        if work.artifact is not None:
            _verify(work.artifact, problem)
    unloading = replace(problem, objective=replace(problem.objective, unloading="planned"))
    planned = {**payload, "problem": problem_to_record(unloading), "algorithm": "greedy", "parameters": {}}
    allocate(planned, WorkContext.in_process(lambda _progress: None, time_limit_s=None))
    _named(_WARM_UP_TRANSFER)(problem)
    bounding.warm_up(problem)
    compile_problem(replace(problem, crs="wgs84"))
    # How long answers take here is known before the first one is asked for in a short time.
    larger = generate("uniform", *_SIZE_TIMED, np.random.default_rng(0))
    for _ in range(2):
        _answer_time.forget()
        _explained(larger, greedy_plan(larger))


def _explained(problem: Problem, plan: Plan) -> dict[str, Any]:
    """Return an allocation by the field names of ``POST /allocate``, and note how long that took."""
    begun = time.perf_counter()
    answer: dict[str, Any] = to_record(explain(problem, plan))
    answer["assignment"] = answer.pop("plan")["assignment"]
    _answer_time.took(problem, time.perf_counter() - begun)
    return answer


def _stop(
    problem: Problem, context: WorkContext, bound_limit_s: float | None = None
) -> protocol.StopCriterion:
    """Stop at a cancellation, or when only the time is left that a bound and the answer's way back take."""
    left = context.time_left()
    if left is None:
        return context.cancelled
    reserve = _answer_time.kept_back(problem, left)
    return _StopInTime(context, reserve + bounding.kept_for_bound(bound_limit_s, left - reserve))


class _StopInTime:
    """A :class:`~app.solvers.protocol.StopCriterion` that tells a search how long it has."""

    def __init__(self, context: WorkContext, reserve: float) -> None:
        self._context, self._reserve = context, reserve

    def __call__(self) -> bool:
        return self._context.cancelled() or self.seconds_left() <= 0.0

    def seconds_left(self) -> float:
        left = self._context.time_left()
        return math.inf if left is None else left - self._reserve


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
