"""What a worker does before it gets work: everything is loaded, compiled and tried, so that nobody waits."""

from __future__ import annotations

import math
import multiprocessing
import os
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing.connection import wait

from app.allocation import bounding, tasks
from app.allocation.answer_time import BOUND
from app.allocation.warm_up_parts import (
    DEFAULT,
    OTHERS,
    PARTS,
    geography,
    large_problem,
    planned_reasons,
    request_for,
    small_problem,
    unlimited,
    unloading,
)
from app.domain.errors import NoCompatibleSource
from app.domain.problem import Problem
from app.jobs.worker import resolve
from app.simulation.compilation import compile_in_turns, compiled_here, first_at
from app.solvers import protocol
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import Deadline

# The learners are named, not imported, so that this room does not depend on them.
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
    for part in PARTS.values():
        part()


def _prepare_default(most_uavs: int, most_targets: int, library_url: str | None) -> None:
    _load(DEFAULT)
    if library_url is not None:
        resolve(_PRELOAD)(library_url, small_problem())
    _time_answers(most_uavs, most_targets)
    _time_algorithms(["transfer_qmix"], most_uavs, most_targets, library_url)


def _prepare_others(most_uavs: int, most_targets: int, library_url: str | None) -> None:
    _load(OTHERS)
    others = [algorithm for algorithm in _TRIED if algorithm != "transfer_qmix"]
    _time_algorithms(others, most_uavs, most_targets, library_url)
    _time_bound(large_problem(min(most_uavs, _LARGEST_TRIED[0]), min(most_targets, _LARGEST_TRIED[1])))


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
    _load(OTHERS)


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
                PARTS[part]()
            else:
                put_off.append(part)
    for part in put_off:
        PARTS[part]()


def _time_algorithms(
    algorithms: Sequence[str], most_uavs: int, most_targets: int, library_url: str | None
) -> None:
    means = protocol.SolverContext(library_url)
    for algorithm in algorithms:
        for m, n in _TRIED[algorithm]:
            _time_preparations(algorithm, large_problem(min(most_uavs, m), min(most_targets, n)), means)


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
        list(pool.map(_do, (*DEFAULT, *OTHERS)))
    warm_up()


def _do(part: str) -> None:
    PARTS[part]()


def warm_up_at_once(most_uavs: int = 50, most_targets: int = 100) -> None:
    """Load and compile what :func:`app.allocation.tasks.allocate_at_once` needs; see :func:`warm_up`."""
    compile_in_turns()
    request = request_for(small_problem(), "greedy", {})
    tasks.allocate_at_once({**request, "bound_time_limit_s": 1.0}, unlimited())
    unloading()
    geography()
    _time_answers(most_uavs, most_targets)
    if not compiled_here():
        # It completes answers too. Otherwise workers are about to compile this, and nobody waits for it here.
        planned_reasons()


def _time_answers(most_uavs: int, most_targets: int) -> None:
    """Know how long answers take here before the first one is asked for in a short time.

    The problem is a large one, so that the memory is there too that such a one takes: the system may need
    longer to find it than all the work takes that is done in it.
    """
    largest = large_problem(min(most_uavs, _LARGEST_TRIED[0]), min(most_targets, _LARGEST_TRIED[1]))
    planned = replace(largest, objective=replace(largest.objective, unloading="planned"))
    requests = [request_for(problem, "greedy", {}) for problem in (largest, planned)]
    for request in requests:
        tasks.allocate_at_once(request, unlimited())
    tasks.answer_time.forget()
    for request in requests:
        for _ in range(_ANSWERS_TIMED):
            tasks.allocate_at_once(request, unlimited())
    # With the reasons too.
    tasks.allocate(requests[0], unlimited())
