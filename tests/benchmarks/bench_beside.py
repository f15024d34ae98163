"""Speed of the inner loops beside another checkout's, in one run: what a change of the rules costs.

    python tests/benchmarks/bench_beside.py ../before [--rounds 5]

Moves of `local_search`, decisions of the simulator, roll-outs of the policy for every size and epochs of
paper mode. Each round measures both checkouts in a process of their own, one after the other; a figure is the
best of all rounds, since noise only ever adds. Processor time of one thread. Both must be compiled
(`python -m app compile`), with the same packages.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import torch

# Of the checkout that this process measures.
if "--rates" not in sys.argv:
    sys.path.insert(0, str(Path(__file__).parents[2]))

from library_on_trial import library_of, policies_for_every_size

from app.simulation.arrays import compile_problem
from app.simulation.evaluation import rewards_of
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import never

HERE = Path(__file__).resolve().parents[2]
SIZES = ((5, 10), (10, 20), (20, 30), (100, 300))
MOVES = 100_000
EPOCHS, FIRST_UPDATE = 150, 32


def rates() -> Iterator[tuple[str, float]]:
    """Yield a name and a rate for each measurement, of the checkout that this process runs in."""
    torch.set_num_threads(1)

    def solving(
        name: str, parameters: dict[str, object], size: tuple[int, int], context: SolverContext
    ) -> Callable[[], object]:
        problem = generate("uniform", *size, 3, np.random.default_rng(1))
        solver = create_solver(name, parse_parameters(name, parameters), context)
        return lambda: solver.solve(problem, 1, never, lambda _progress: None)

    for size in SIZES:
        work = solving("local_search", {"moves": MOVES}, size, SolverContext())
        yield f"local_search, moves/s, {size[0]} x {size[1]}", MOVES / _seconds(work)
    for size in SIZES:
        problem = generate("uniform", *size, 3, np.random.default_rng(1))
        plan = solving("greedy", {}, size, SolverContext())().plan  # type: ignore[attr-defined]  # a solution
        arrays, decisions = compile_problem(problem), len(plan.assignment) * size[0]
        batch = np.repeat(plan.as_array()[None], max(1, 400_000 // decisions), axis=0)
        seconds = _seconds(lambda a=arrays, b=batch: rewards_of(a, b))  # type: ignore[misc]
        yield f"simulator, decisions/s, {size[0]} x {size[1]}", len(batch) * decisions / seconds
    with library_of(policies_for_every_size(None)) as url:
        for size in SIZES[:3]:
            played = {"n_epochs": 0, "polish": False, "samples": 4, "replans": 0}
            seconds = _seconds(solving("transfer_qmix", played, size, SolverContext(url)))
            yield f"policy, requests of 4 samples/s, {size[0]} x {size[1]}", 1 / seconds
    epochs = {"mode": "paper", "n_epochs": EPOCHS, "learning_starts": FIRST_UPDATE}
    for size in SIZES[:2]:
        seconds = _seconds(solving("qmix", epochs, size, SolverContext()), runs=1)
        yield f"paper mode, epochs/s, {size[0]} x {size[1]}", EPOCHS / seconds


def _seconds(work: Callable[[], object], runs: int = 3) -> float:
    """Return the processor time of the quickest of several runs, after one that is not counted."""
    work()
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def measured(checkout: Path) -> dict[str, float]:
    """Measure a checkout in a process of its own."""
    paths = (checkout, Path(__file__).parent)
    given = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths)), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--rates"]
    told = subprocess.run(command, cwd=checkout, env=given, check=True, capture_output=True, text=True)
    return dict(json.loads(told.stdout))


def main() -> None:
    """Print a row a measurement."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("other", type=Path, nargs="?", default=HERE)
    options.add_argument("--rounds", type=int, default=5)
    options.add_argument("--rates", action="store_true", help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.rates:
        print(json.dumps(list(rates())))
        return
    here: dict[str, float] = {}
    other: dict[str, float] = {}
    for _ in range(given.rounds):
        for best, checkout in ((other, given.other.resolve()), (here, HERE)):
            for name, rate in measured(checkout).items():
                best[name] = max(best.get(name, 0.0), rate)
    print(f"{'':45} {'other':>14} {'here':>14} {'here/other':>10}")
    for name, rate in here.items():
        print(f"{name:45} {other[name]:>14,.1f} {rate:>14,.1f} {rate / other[name]:>10.3f}")


if __name__ == "__main__":
    main()
