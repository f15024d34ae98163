"""The policy by itself, on problems of many kinds: roll-outs, first sight, samples, and as by default.

    python tests/benchmarks/bench_policy.py --work FOLDER [--policies FOLDER] [--problems 24] [--first 0]
    [--kinds A B] [--ways first-sight] [--reference 1] [--workers 2]

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
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

sys.path[:0] = [str(Path(__file__).parents[2])]

from library_on_trial import library_of, policies_for_every_size  # noqa: E402
from problem_kinds import KINDS  # noqa: E402

from app.domain.problem import Problem  # noqa: E402
from app.learning.parameters import TransferQmixParameters  # noqa: E402
from app.learning.transfer import TransferQmix  # noqa: E402
from app.learning.universal.training.curriculum import with_greedy_unloading  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import Deadline, never  # noqa: E402

STREAM = 70_000_027
PURE = {"n_epochs": 0, "polish": False}
WAYS: dict[str, dict[str, Any]] = {
    "one-roll-out": {**PURE, "samples": 0, "orders": 1},
    "alone": {**PURE, "samples": 0, "recombine": False},
    "first-sight": {**PURE, "samples": 0},
    "64-samples": {**PURE, "samples": 64},
    "default": {},
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
    numbers = range(given.first, given.first + given.problems)
    asked = [(kind, number) for kind in given.kinds for number in numbers]
    yield "| | " + " | ".join(given.ways) + " |\n" + "| --- " * (1 + len(given.ways)) + "|"
    with ProcessPoolExecutor(given.workers) as processes:
        best = references(processes, given.work / "reference.jsonl", asked, given.reference)
        # What is compiled or loaded at a first call is not the policy's.
        list(processes.map(partial(answer, url, "families"), range(4), given.ways[:1] * 4))
        for kind in given.kinds:
            cells = []
            for way in given.ways:
                work = partial(answer, url, kind, way=way)
                earned, took = np.array(list(processes.map(work, numbers))).T
                over = np.array([best[kind, number] for number in numbers])
                share = np.clip(np.divide(earned, over, out=np.ones_like(over), where=over > 0), 0.0, None)
                cells.append(f"{share.mean():.4f} ({share.min():.3f}), {np.median(took):.3f} s")
            yield f"| {kind} | " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--work", type=Path, required=True, help="folder of what `auto` found")
    options.add_argument("--policies", type=Path, help="folder of checkpoints; the shipped ones if left out")
    options.add_argument("--problems", type=int, default=24, help="of each kind")
    options.add_argument("--first", type=int, default=0, help="number of the first problem of each")
    options.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    options.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS)[:4])
    options.add_argument("--reference", type=float, default=1.0, help="processor seconds of `auto`")
    options.add_argument("--workers", type=int, default=os.cpu_count())
    given = options.parse_args()
    with library_of(policies_for_every_size(given.policies)) as url:
        for line in rows(given, url):
            print(line, flush=True)


if __name__ == "__main__":
    main()
