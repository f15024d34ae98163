"""What a worker does before it gets work: everything is loaded, compiled and tried, so that nobody waits."""

from __future__ import annotations

import math
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from multiprocessing.connection import wait
from typing import Any

import numpy as np

from app.allocation import bounding, evaluating, tasks
from app.allocation.answer_time import BOUND
from app.domain.errors import IllegalPlan, NoCompatibleSource
from app.domain.problem import UAV, Problem, Target
from app.domain.records import problem_to_record
from app.domain.surroundings import Base
from app.jobs.model import Progress
from app.jobs.work_context import WorkContext
from app.jobs.worker import resolve
from app.simulation.arrays import compile_problem
from app.simulation.compilation import compile_in_turns, compiled_here, first_at
from app.simulation.generator import generate
from app.solvers import protocol
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import Deadline, never

# The learners are named, not imported, so that this room does not depend on them.
_TRANSFER = "app.learning.universal.request.warm_up:warm_up"
_TRANSFER_REST = "app.learning.universal.request.warm_up:warm_up_the_rest"
_PRELOAD = "app.learning.checkpoints.source_policies:preload"

_LARGEST_TRIED = (1000, 2000)
"""UAVs and areas of the problem on which the warm-up tries how long answers take, at most."""

_LARGEST_LEARNED = (100, 300)
"""The same of those that learn: what they do before they can be stopped takes seconds where UAVs are many."""

_TRIED = {
    "ga": (_LARGEST_TRIED,),
    "local_search": (_LARGEST_TRIED,),
    "auto": (_LARGEST_TRIED,),
    "exact": (_LARGEST_TRIED,),
    "qmix": (_LARGEST_LEARNED, (150, 1), (1, 2000)),
    "transfer_qmix": (_LARGEST_LEARNED, (150, 1), (1, 2000)),
}
"""Algorithms whose preparations are timed by the warm-up, and on how many UAVs and areas at most: on the
largest, and where there is much of the one and little of the other."""

_ANSWERS_TIMED = 3

_COMPILING_LEAVES = 5
"""Niceness of what compiles while jobs may run: as much as the workers have."""

_PARAMETERS: dict[str, dict[str, Any]] = {
    "greedy": {},
    "local_search": {"moves": 200},
    "dqn": {"n_epochs": 4, "evaluate_per_epoch": 2, "buffer_size": 2, "batch_size": 2, "learning_starts": 1},
    "exact": {"nodes": 10},
    "ga": {"num_total": 4, "iteration": 2},
    # In service mode nothing that the transfer's warm-up leaves out.
    "qmix": {
        "mode": "paper",
        "n_epochs": 4,
        "evaluate_per_epoch": 2,
        "buffer_size": 2,
        "batch_size": 2,
        "learning_starts": 1,
    },
    "auto": {"moves": 200, "policy": False},
    **{
        name: {"evaluations": 50}
        for name in (
            "particle_swarm",
            "grey_wolf",
            "beetle_antennae",
            "ant_colony",
            "contract_net",
            "bundles",
            "semi_random_q",
        )
    },
}


def warm_up(most_uavs: int = 50, most_targets: int = 100, library_url: str | None = None) -> None:
    """Load and compile what every kind of job needs, so that nobody waits for it later.

    Parameters
    ----------
    most_uavs, most_targets
        Size of the largest problem that is to be expected; how long answers take is tried on it.
    library_url
        Database with the source policies that jobs will ask for.
    """
    compile_in_turns()
    _prepare_default(most_uavs, most_targets, library_url)
    _prepare_others(most_uavs, most_targets, library_url)


def warm_up_worker(
    most_uavs: int = 50, most_targets: int = 100, library_url: str | None = None
) -> threading.Thread | None:
    """Do the same, but where code has to be compiled, wait only for what the default algorithm needs.

    The others' code is then compiled by another process, and a thread loads it after that: a request that
    needs some of it earlier waits for that, and for nothing else.

    Returns
    -------
    threading.Thread or None
        What still goes on, if anything does.
    """
    compile_in_turns()
    _prepare_default(most_uavs, most_targets, library_url)
    if not compiled_here():
        _prepare_others(most_uavs, most_targets, library_url)
        return None
    arguments = most_uavs, most_targets, library_url
    later = threading.Thread(target=_prepare_others_later, args=arguments, name="warm-up", daemon=True)
    later.start()
    return later


def load_all() -> None:
    """Load all compiled code, and nothing for a size of problem."""
    for part in _PARTS.values():
        part()


def _prepare_default(most_uavs: int, most_targets: int, library_url: str | None) -> None:
    _load(_DEFAULT)
    if library_url is not None:
        resolve(_PRELOAD)(library_url, _small_problem())
    _time_answers(most_uavs, most_targets)
    _time_algorithms(["transfer_qmix"], most_uavs, most_targets, library_url)


def _prepare_others(most_uavs: int, most_targets: int, library_url: str | None) -> None:
    _load(_OTHERS)
    others = [algorithm for algorithm in _TRIED if algorithm != "transfer_qmix"]
    _time_algorithms(others, most_uavs, most_targets, library_url)
    _time_bound(_large_problem(min(most_uavs, _LARGEST_TRIED[0]), min(most_targets, _LARGEST_TRIED[1])))


def _prepare_others_later(most_uavs: int, most_targets: int, library_url: str | None) -> None:
    compiling = multiprocessing.get_context("spawn").Process(target=_compile_others)
    compiling.start()
    compiling.join()
    _prepare_others(most_uavs, most_targets, library_url)


def _compile_others() -> None:
    """Compile in a process of its own, which ends with its worker."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.nice(_COMPILING_LEAVES)
    compile_in_turns()
    _load(_OTHERS)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _load(parts: Sequence[str]) -> None:
    """Load what parts need, those last that another process is at: it may be compiling."""
    put_off = []
    for part in parts:
        with first_at(part) as first:
            if first:
                _PARTS[part]()
            else:
                put_off.append(part)
    for part in put_off:
        _PARTS[part]()


def _time_algorithms(
    algorithms: Sequence[str], most_uavs: int, most_targets: int, library_url: str | None
) -> None:
    means = protocol.SolverContext(library_url)
    for algorithm in algorithms:
        for m, n in _TRIED[algorithm]:
            _time_preparations(algorithm, _large_problem(min(most_uavs, m), min(most_targets, n)), means)


def _time_bound(problem: Problem) -> None:
    """Know how long the bound takes before it can be stopped."""
    took = []
    for _ in range(2):
        asked = _NotAtOnce()
        begun = time.perf_counter()
        bounding.bound_answer(problem, 0.0, 1.0, asked)
        took.append(time.perf_counter() - begun)
    tasks.answer_time.preparations.tried(BOUND, problem, min(took))


class _NotAtOnce:
    """Says stop whenever it is asked but for the first time."""

    def __init__(self) -> None:
        self._asked = False

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        asked, self._asked = self._asked, True
        return asked

    def seconds_left(self) -> float:
        """Return infinity: there is no time limit."""
        return math.inf


def _time_preparations(algorithm: str, problem: Problem, means: protocol.SolverContext) -> None:
    """Know how long an algorithm takes that is told to stop from the beginning."""
    solver = create_solver(algorithm, parse_parameters(algorithm, {}), means)
    took = []
    for _ in range(2):
        begun = time.perf_counter()
        try:
            solver.solve(problem, 0, Deadline(0.0), lambda _progress: None)
        except NoCompatibleSource:
            # A library may be empty, and jobs are then refused as quickly.
            return
        took.append(time.perf_counter() - begun)
    tasks.answer_time.preparations.tried(algorithm, problem, min(took))


def compile_all(processes: int) -> None:
    """Do the same in several processes at a time, for the sake of the compiled code that they keep.

    Parameters
    ----------
    processes
        How many, at least 1.
    """
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context, initializer=compile_in_turns) as pool:
        list(pool.map(_do, (*_DEFAULT, *_OTHERS)))
    warm_up()


def _do(part: str) -> None:
    _PARTS[part]()


def _algorithm(name: str) -> None:
    problem = _small_problem()
    found = tasks.allocate(_request(problem, name, _PARAMETERS[name]), _unlimited())
    if found.artifact is not None:
        tasks.verify(found.artifact, problem)


def _named(warm_up_of: str) -> None:
    resolve(warm_up_of)(_small_problem())


def _bound() -> None:
    bounding.warm_up(_small_problem())


def _unloading() -> None:
    problem = _small_problem()
    planned = replace(problem, objective=replace(problem.objective, unloading="planned"))
    tasks.allocate_at_once(_request(planned, "greedy", {}), _unlimited())


def _planned_reasons() -> None:
    """Find reasons, and the amounts that go with them, where unloading is planned."""
    problem = _small_problem()
    planned = replace(problem, objective=replace(problem.objective, unloading="planned"))
    tasks.allocate(_request(planned, "greedy", {}), _unlimited())


def _reloads() -> None:
    """Find reasons where there are bases; with planned loads, and with stocks that are refilled from."""
    problem = _small_problem()
    stocked = Base("base-1", 0.5, 0.5, stock=(1.0, 1.0))
    refilled = replace(problem, bases=(stocked,))
    objective = replace(problem.objective, unloading="planned", loading="planned")
    for each in (refilled, replace(refilled, objective=objective)):
        tasks.allocate(_request(each, "greedy", {}), _unlimited())
    for algorithm in ("local_search", "exact"):
        tasks.allocate(_request(refilled, algorithm, _PARAMETERS[algorithm]), _unlimited())
    # What could be brought besides is not worth the way.
    dear = replace(refilled, objective=replace(objective, distance_weight=100.0))
    tasks.allocate(_request(dear, "greedy", {}), _unlimited())


def _promises() -> None:
    """Find reasons where an area is promised, nobody may fly to another one, and the end costs reward."""
    problem = _small_problem()
    (carrier, other), (*rest, last) = problem.uavs, problem.targets
    problem = replace(
        problem,
        uavs=(replace(carrier, committed=("area-1",)), other),
        targets=(*rest, replace(last, skills=("winch",))),
        objective=replace(problem.objective, makespan_weight=0.1),
    )
    tasks.allocate(_request(problem, "local_search", _PARAMETERS["local_search"]), _unlimited())


def _combining() -> None:
    problem = _small_problem()
    problem = replace(problem, uavs=tuple(replace(u, loadlist=(9.0, 9.0)) for u in problem.uavs))
    parameters = parse_parameters("local_search", {"moves": 40_000, "restarts": 1})
    solver = create_solver("local_search", parameters, protocol.SolverContext(threads=2))
    solver.solve(problem, 0, never, lambda _progress: None)


def _sharing() -> None:
    """Let threads share a plan, which has to have UAVs enough."""
    parameters = parse_parameters("local_search", {"moves": 400, "restarts": 0})
    solver = create_solver("local_search", parameters, protocol.SolverContext(threads=2))
    solver.solve(_large_problem(40, 80), 0, never, lambda _progress: None)


def _evaluation() -> None:
    """Evaluate a plan of nothing, which has reasons, and one that breaks a rule."""
    problem = _small_problem()
    problem = replace(problem, uavs=tuple(replace(uav, endurance=0.1) for uav in problem.uavs))
    payload = {"problem": problem_to_record(problem), "at": 0.0}
    evaluating.evaluate({**payload, "assignment": [[3, 3]]}, _unlimited())
    with suppress(IllegalPlan):
        evaluating.evaluate({**payload, "assignment": [[0, 3]]}, _unlimited())


def _geography() -> None:
    compile_problem(replace(_small_problem(), crs="wgs84"))


def warm_up_at_once(most_uavs: int = 50, most_targets: int = 100) -> None:
    """Load and compile what :func:`app.allocation.tasks.allocate_at_once` needs; see :func:`warm_up`."""
    compile_in_turns()
    request = _request(_small_problem(), "greedy", {})
    tasks.allocate_at_once({**request, "bound_time_limit_s": 1.0}, _unlimited())
    _unloading()
    _geography()
    _time_answers(most_uavs, most_targets)
    if not compiled_here():
        # It completes answers too. Otherwise workers are about to compile this, and nobody waits for it here.
        _planned_reasons()


def _time_answers(most_uavs: int, most_targets: int) -> None:
    """Know how long answers take here before the first one is asked for in a short time.

    The problem is a large one, so that the memory is there too that such a one takes: the system may need
    longer to find it than all the work takes that is done in it.
    """
    largest = _large_problem(min(most_uavs, _LARGEST_TRIED[0]), min(most_targets, _LARGEST_TRIED[1]))
    planned = replace(largest, objective=replace(largest.objective, unloading="planned"))
    requests = [_request(problem, "greedy", {}) for problem in (largest, planned)]
    for request in requests:
        tasks.allocate_at_once(request, _unlimited())
    tasks.answer_time.forget()
    for request in requests:
        for _ in range(_ANSWERS_TIMED):
            tasks.allocate_at_once(request, _unlimited())
    # With the reasons too.
    tasks.allocate(requests[0], _unlimited())


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


_PARTS: dict[str, Callable[[], None]] = {
    "greedy": partial(_algorithm, "greedy"),
    "transfer": partial(_named, _TRANSFER),
    "planned unloading": _unloading,
    "reasons of planned unloading": _planned_reasons,
    **{name: partial(_algorithm, name) for name in _PARAMETERS if name != "greedy"},
    "rest of transfer": partial(_named, _TRANSFER_REST),
    "reloads": _reloads,
    "promises": _promises,
    "combining": _combining,
    "sharing": _sharing,
    "bound": _bound,
    "geography": _geography,
    "evaluation": _evaluation,
}
"""What together loads and compiles all there is."""

_DEFAULT = ("transfer", "local_search", "greedy", "planned unloading", "geography")
"""Parts that an answer of the default algorithm needs: what takes longest first, then what is
a part of it and is compiled beside it."""

_OTHERS = tuple(part for part in _PARTS if part not in _DEFAULT)
