"""The policy by itself, on problems of many kinds: one roll-out, first sight, samples, and as by default.

    python tests/benchmarks/bench_policy.py --work FOLDER [--policies FOLDER] [--problems 24] [--kinds A B]
    [--ways first-sight] [--reference 1] [--workers 2]

Every kind has so many fresh problems, numbered; none was trained on. Rewards are over the best of `auto` in
``--reference`` processor seconds, and staying at home counts as 0. Printed are means, with the lowest in
brackets, and medians of processor time. What `auto` found is kept in the work folder, for other policies.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

sys.path[:0] = [str(Path(__file__).parents[2])]

from library_on_trial import library_of, policies_for_every_size  # noqa: E402

from app.domain.problem import Problem  # noqa: E402
from app.learning.parameters import TransferQmixParameters  # noqa: E402
from app.learning.transfer import TransferQmix  # noqa: E402
from app.learning.universal.training.curriculum import with_greedy_unloading  # noqa: E402
from app.simulation.drawn_generator import drawn, drawn_size  # noqa: E402
from app.simulation.drawn_surroundings import with_surroundings  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import FAMILIES, generate  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import Deadline, never  # noqa: E402

STREAM = 70_000_027
SIZES = ((5, 10), (7, 15), (10, 20), (20, 30))
PURE = {"n_epochs": 0, "polish": False}
WAYS: dict[str, dict[str, Any]] = {
    "one-roll-out": {**PURE, "samples": 0, "orders": 1},
    "first-sight": {**PURE, "samples": 0},
    "64-samples": {**PURE, "samples": 64},
    "default": {},
}

Random = np.random.Generator


def of_a_family(number: int, rng: Random) -> Problem:
    """Families take turns, then sizes; K is 3 in half of them, otherwise 1 to 6."""
    m, n = SIZES[number // len(FAMILIES) % len(SIZES)]
    k = 3 if rng.random() < 0.5 else int(rng.integers(1, 7))
    return generate(list(FAMILIES)[number % len(FAMILIES)], m, n, k, rng)


def of_no_family(_number: int, rng: Random) -> Problem:
    return drawn(*drawn_size(rng), rng)


def until(is_wanted: Callable[[Problem], bool], make: Callable[[Random], Problem], rng: Random) -> Problem:
    """Draw until a problem is of the kind."""
    while not is_wanted(problem := make(rng)):
        pass
    return problem


def with_bases(number: int, rng: Random) -> Problem:
    return until(lambda p: bool(p.bases), partial(of_no_family, number), rng)


def surrounded(number: int, rng: Random) -> Problem:
    return with_surroundings(of_no_family(number, rng), rng)


def all_deadlines(_number: int, rng: Random) -> Problem:
    """15 x 40 of any place, with a deadline at every area."""
    return until(lambda p: all(t.deadline is not None for t in p.targets), lambda r: drawn(15, 40, 3, r), rng)


def six_materials(_number: int, rng: Random) -> Problem:
    """Six materials, of which a UAV carries one or two."""
    return until(
        lambda p: all(0 < sum(a > 0 for a in u.loadlist) <= 2 for u in p.uavs),
        lambda r: drawn(*drawn_size(r)[:2], 6, r),
        rng,
    )


def all_alike(number: int, rng: Random) -> Problem:
    """UAVs that differ in nothing."""
    problem = of_a_family(number, rng)
    first = problem.uavs[0]
    return replace(problem, uavs=tuple(replace(first, id=uav.id) for uav in problem.uavs))


def many_visits(_number: int, rng: Random) -> Problem:
    """Twenty visits a UAV, about: few UAVs with range and load for all of it."""
    m = int(rng.integers(1, 5))
    problem = generate("clustered", m, 20 * m, 2, rng)
    uavs = tuple(
        replace(uav, voyage=4.0 * uav.voyage, loadlist=tuple(20.0 * amount for amount in uav.loadlist))
        for uav in problem.uavs
    )
    return replace(problem, uavs=uavs, max_steps=25)


KINDS = {
    "families": of_a_family,
    "no-family": of_no_family,
    "bases": with_bases,
    "surrounded": surrounded,
    "deadlines": all_deadlines,
    "six-materials": six_materials,
    "alike": all_alike,
    "many-visits": many_visits,
}


def problem_of(kind: str, number: int) -> Problem:
    """Return the problem of a number, without planned unloading: the policy decides where UAVs fly."""
    rng = np.random.default_rng([STREAM, number, *kind.encode()])
    return with_greedy_unloading(KINDS[kind](number, rng))


def reference(kind: str, number: int, seconds: float) -> float:
    """What `auto` earns in so many processor seconds."""
    time.monotonic = time.process_time
    problem = problem_of(kind, number)
    solver = create_solver("auto", parse_parameters("auto", {}), SolverContext())
    limit = Deadline(seconds, time.process_time)
    return reward_of(problem, solver.solve(problem, 1, limit, lambda _told: None).plan)


def answer(url: str, kind: str, number: int, way: str) -> tuple[float, float]:
    """What the policy earns in a way, and the processor seconds that it takes."""
    torch.set_num_threads(1)
    problem = problem_of(kind, number)
    solver = TransferQmix(TransferQmixParameters(**WAYS[way]), SolverContext(url))
    begin = time.process_time()
    plan = solver.solve(problem, 1, never, lambda _progress: None).plan
    return reward_of(problem, plan), time.process_time() - begin


def references(
    processes: ProcessPoolExecutor, file: Path, asked: list[tuple[str, int]], seconds: float
) -> dict[tuple[str, int], float]:
    """Do what is missing in the file; return all of it."""
    done = {}
    if file.exists():
        done = {(kind, number, s): earned for kind, number, s, earned in map(json.loads, file.open())}
    missing = [key for key in asked if (*key, seconds) not in done]
    with file.open("a", encoding="utf-8") as out:
        found = (
            processes.map(reference, *zip(*missing, strict=True), [seconds] * len(missing)) if missing else ()
        )
        for key, earned in zip(missing, found, strict=False):
            done[(*key, seconds)] = earned
            out.write(json.dumps([*key, seconds, earned]) + "\n")
    return {key: done[(*key, seconds)] for key in asked}


def rows(given: argparse.Namespace, url: str) -> Iterator[str]:
    """Yield lines of Markdown: a row a kind."""
    given.work.mkdir(parents=True, exist_ok=True)
    asked = [(kind, number) for kind in given.kinds for number in range(given.problems)]
    yield "| | " + " | ".join(given.ways) + " |\n" + "| --- " * (1 + len(given.ways)) + "|"
    with ProcessPoolExecutor(given.workers) as processes:
        best = references(processes, given.work / "reference.jsonl", asked, given.reference)
        # What is compiled or loaded at a first call is not the policy's.
        list(processes.map(partial(answer, url, "families"), range(4), given.ways[:1] * 4))
        for kind in given.kinds:
            cells = []
            for way in given.ways:
                work = partial(answer, url, kind, way=way)
                earned, took = np.array(list(processes.map(work, range(given.problems)))).T
                over = np.array([best[kind, number] for number in range(given.problems)])
                share = np.clip(np.divide(earned, over, out=np.ones_like(over), where=over > 0), 0.0, None)
                cells.append(f"{share.mean():.4f} ({share.min():.3f}), {np.median(took):.3f} s")
            yield f"| {kind} | " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--work", type=Path, required=True, help="folder of what `auto` found")
    options.add_argument("--policies", type=Path, help="folder of checkpoints; the shipped ones if left out")
    options.add_argument("--problems", type=int, default=24, help="of each kind")
    options.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    options.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS)[:3])
    options.add_argument("--reference", type=float, default=1.0, help="processor seconds of `auto`")
    options.add_argument("--workers", type=int, default=os.cpu_count())
    given = options.parse_args()
    with library_of(policies_for_every_size(given.policies)) as url:
        for line in rows(given, url):
            print(line, flush=True)


if __name__ == "__main__":
    main()
