"""One run of the race."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace

from app.domain.errors import InvalidProblem, ProblemTooLarge
from app.reproduction.execution import GENERAL, Outcome, replayed
from app.reproduction.race.runs import RaceRun
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters, require_supported
from app.solvers.stop import Deadline, never

_WARM_UP_SECONDS = 0.05


def execute(run: RaceRun, library_url: str) -> Outcome:
    """Do a run; a problem that an entrant refuses, as learners of the paper may, is recorded as refused."""
    problem, name = run.place.problem(run.problem), run.how.algorithm
    if name in GENERAL and run.seconds is not None:
        begun = time.perf_counter()
        plan = GENERAL[name](problem, run.seconds, run.seed)
        return Outcome(replayed(problem, plan), time.perf_counter() - begun)
    parameters = parse_parameters(name, run.parameters)
    try:
        require_supported(name, parameters, problem)
        solver = create_solver(name, parameters, SolverContext(library_url))
        begun = time.perf_counter()
        stop = never if run.seconds is None else Deadline(run.seconds)
        solution = solver.solve(problem, run.seed, stop, lambda _progress: None)
    except (InvalidProblem, ProblemTooLarge) as error:
        return Outcome({"refused": str(error)}, 0.0)
    seconds = time.perf_counter() - begun
    history = solution.history
    return Outcome(
        {
            **replayed(problem, solution.plan),
            "history": {"epoch": history.epoch, "reward": history.reward},
            "bound": solution.proof.bound if solution.proof else None,
            "proven": solution.proof.proven if solution.proof else None,
        },
        seconds,
    )


def warm_up(runs: Iterable[RaceRun], library_url: str) -> None:
    """Run every algorithm for a moment, so that loading and compiling is not part of what is timed."""
    seen = set()
    for run in runs:
        if run.how.algorithm not in seen:
            seen.add(run.how.algorithm)
            execute(replace(run, problem=0, seconds=_WARM_UP_SECONDS), library_url)
