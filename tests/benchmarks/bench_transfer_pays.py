"""Does transfer pay? A policy of the library against the same learner from nothing, with statistics.

    python tests/benchmarks/bench_transfer_pays.py --work FOLDER [--problems 144] [--seeds 10] [--workers 2]
    [--seconds 30] [--arms transfer scratch]

Fresh problems of all families and three sizes, K = 3, none of which anything was tuned on. Every run has the
same code and the same budget of processor time of one thread; there is no local search. The arms:

- transfer: a policy of the library; samples, plans groups anew (four times as many episodes as by default),
  recombines, then fine-tunes until the time is up;
- scratch: the same with random weights in place of the policy's, and the learning rate from nothing;
- without learning: transfer, but it ends after its samples;
- qmix: ``qmix`` in service mode, from random weights, which neither samples nor plans groups anew.

All begin with the greedy rule's plan. Shares are rewards of the best plan so far over those of a search of
400,000 moves. The claim: transfer after one second is not worse than scratch after thirty, by more than
0.1 % of the searched reward. It holds where the 95 % intervals of the mean difference by problem, and of its
interquartile mean, lie above that; bootstrap over problems, families being strata. Runs that never reach a
level count with a time that is longer than all others.

Runs are kept in the work folder, so a stopped benchmark goes on where it was. There it also writes
``transfer_pays.md`` (the tables) and ``curve.csv`` (share by time of every run).
"""

from __future__ import annotations

import argparse
import csv
import json
import multiprocessing
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1] / "support")]

from library_on_trial import library_of, policies_for_every_size  # noqa: E402
from stopping import After  # noqa: E402

from app.domain.problem import Problem  # noqa: E402
from app.learning.checkpoints.checkpoint import encode  # noqa: E402
from app.learning.pairwise.architecture import PairwiseConfig  # noqa: E402
from app.learning.pairwise.policy import PairwisePolicy  # noqa: E402
from app.learning.parameters import (  # noqa: E402
    FINE_TUNING_LR,
    LEARNING_RATE,
    QmixParameters,
    TransferQmixParameters,
)
from app.learning.qmix import Qmix  # noqa: E402
from app.learning.transfer import TransferQmix  # noqa: E402
from app.learning.universal.request import transfer as request  # noqa: E402
from app.learning.universal.training.demonstrations import demonstrate  # noqa: E402
from app.library.seeding import read_policies  # noqa: E402
from app.reproduction.race.statistics import (  # noqa: E402
    Estimate,
    Floats,
    estimate,
    interquartile_mean,
    mean,
)
from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import FAMILIES, generate  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.stop import Deadline  # noqa: E402

SIZES = ((5, 10), (7, 15), (10, 20))
STREAM = 40_000_033
MOMENTS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 2, 3, 5, 7, 10, 15, 20, 30)
LEVELS = (0.95, 0.96, 0.97, 0.98, 0.99, 0.995, 1.0)
EARLY, MARGIN = 1.0, 0.001
MOVES = 400_000
FOREVER = 10**6
REPLANS = 768
ARMS = ("transfer", "scratch", "without learning", "qmix")
UNTRAINED = "untrained"

Key = tuple[str, int, int]
"""An arm or the reference, a problem and a seed."""


@dataclass(frozen=True)
class Trial:
    """Where the policies are, which of them is carried over, and how long runs are."""

    url: str
    source: str
    seconds: float


def problem_of(number: int) -> tuple[str, Problem]:
    """A fresh problem and its family; families take turns, then sizes."""
    family = list(FAMILIES)[number % len(FAMILIES)]
    m, n = SIZES[number // len(FAMILIES) % len(SIZES)]
    return family, generate(family, m, n, 3, np.random.default_rng([STREAM, number]))


def solver_of(arm: str, trial: Trial) -> Any:
    if arm == "qmix":
        return Qmix(QmixParameters(n_epochs=FOREVER), SolverContext())
    parameters = TransferQmixParameters(
        source=UNTRAINED if arm == "scratch" else trial.source,
        polish=False,
        replans=REPLANS,
        n_epochs=0 if arm == "without learning" else FOREVER,
    )
    return TransferQmix(parameters, SolverContext(trial.url))


def run(trial: Trial, arm: str, number: int, seed: int) -> list[tuple[float, float]]:
    """Return when the best plan became better, and what it earned then."""
    torch.set_num_threads(1)
    request.FINE_TUNING_LR = LEARNING_RATE if arm == "scratch" else FINE_TUNING_LR
    _, problem = problem_of(number)
    warm(trial, arm)
    better = [(0.0, reward_of(problem, greedy_plan(problem)))]
    start = time.process_time()

    def told(progress: Any) -> None:
        if progress.best_reward > better[-1][1] + 1e-12:
            better.append((round(time.process_time() - start, 4), progress.best_reward))

    solver_of(arm, trial).solve(problem, seed, Deadline(trial.seconds, time.process_time), told)
    return better


_warm: set[str] = set()


def warm(trial: Trial, arm: str) -> None:
    """Compile and load what an arm needs, once a process."""
    if arm not in _warm:
        _warm.add(arm)
        problem = generate("deadline", 3, 5, 3, np.random.default_rng(1))
        solver_of(arm, trial).solve(problem, 1, After(400), lambda _progress: None)


def reference(number: int) -> float:
    """Reward of a searched plan."""
    shown = demonstrate(problem_of(number)[1], MOVES, np.random.default_rng(number))
    if shown is None:
        raise ValueError(f"nothing can be earned in problem {number}")
    return shown.reward


def all_runs(options: argparse.Namespace, trial: Trial) -> dict[Key, Any]:
    """Do what is missing; return everything."""
    file, done = options.work / "transfer_pays.jsonl", {}
    if file.exists():
        done = {tuple(key): value for key, value in map(json.loads, file.read_text().splitlines())}
    asked = [("reference", number, 0) for number in range(options.problems)]
    seeds = range(1, options.seeds + 1)
    asked += [
        (arm, number, seed) for seed in seeds for number in range(options.problems) for arm in options.arms
    ]
    missing = [key for key in asked if key not in done]
    pool = ProcessPoolExecutor(options.workers, multiprocessing.get_context("spawn"))
    with pool, file.open("a", encoding="utf-8") as out:
        futures = {
            pool.submit(reference, key[1]) if key[0] == "reference" else pool.submit(run, trial, *key): key
            for key in missing
        }
        for count, future in enumerate(as_completed(futures), 1):
            done[futures[future]] = future.result()
            out.write(json.dumps([futures[future], future.result()]) + "\n")
            out.flush()
            print(f"\r{count} of {len(missing)} runs", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return {key: done[key] for key in asked}


class Shares:
    """Shares of the searched reward of every run, by arm.

    Parameters
    ----------
    runs
        As :func:`all_runs` returns them.
    options
        Arms, problems and seeds.
    """

    def __init__(self, runs: dict[Key, Any], options: argparse.Namespace) -> None:
        self._runs, self._options = runs, options
        self._family = [problem_of(number)[0] for number in range(options.problems)]

    def of_runs(self, of_run: Callable[[Floats, Floats], float], arm: str) -> list[Floats]:
        """Work out a number of each run from (T,) times and shares; return (P, S) a family."""
        by_family = []
        for family in FAMILIES:
            rows = [
                [of_run(*self._curve(arm, number, seed)) for seed in range(1, self._options.seeds + 1)]
                for number, of in enumerate(self._family)
                if of == family
            ]
            if rows:
                by_family.append(np.array(rows))
        return by_family

    def at(self, arm: str, moment: float) -> list[Floats]:
        """Shares at a moment."""
        return self.of_runs(lambda times, shares: float(shares[times <= moment][-1]), arm)

    def _curve(self, arm: str, number: int, seed: int) -> tuple[Floats, Floats]:
        times, rewards = np.array(self._runs[arm, number, seed]).T
        return times, rewards / self._runs["reference", number, 0]


def time_to(level: float) -> Callable[[Floats, Floats], float]:
    """When a run reaches a level; infinite where it never does."""

    def of_run(times: Floats, shares: Floats) -> float:
        reached = times[shares >= level - 1e-9]
        return float(reached[0]) if len(reached) else np.inf

    return of_run


def area(seconds: float) -> Callable[[Floats, Floats], float]:
    """Mean share over the logarithm of time, from the first moment on."""
    grid = np.geomspace(MOMENTS[0], seconds, 200)
    return lambda times, shares: float(shares[np.searchsorted(times, grid, side="right") - 1].mean())


def median(values: Floats) -> Floats:
    """Median over the last axis; infinite numbers are larger than all others."""
    return np.asarray(np.quantile(values, 0.5, axis=-1, method="lower"))


def difference(ours: list[Floats], theirs: list[Floats]) -> list[Floats]:
    """By problem, of the means over seeds: (P, 1) a family."""
    return [(our.mean(axis=1) - their.mean(axis=1))[:, None] for our, their in zip(ours, theirs, strict=True)]


def claim(shares: Shares, options: argparse.Namespace, other: str) -> Iterator[str]:
    """Yield what the primary test says against another arm, and what stands beside it."""
    apart = difference(shares.at("transfer", EARLY), shares.at(other, options.seconds))
    for name, statistic in (("mean", mean), ("interquartile mean", interquartile_mean)):
        found = estimate(apart, statistic)
        holds = "holds" if found.low > -MARGIN else "does not hold"
        yield f"- transfer at {EARLY:g} s less {other} at {options.seconds:g} s, {name}: {found}: {holds}"
    start = estimate(difference(shares.at("transfer", MOMENTS[1]), shares.at(other, MOMENTS[1])), mean)
    yield f"- jump-start, the same at {MOMENTS[1]:g} s: {start}"
    areas = [shares.of_runs(area(options.seconds), arm) for arm in ("transfer", other)]
    yield f"- area over the logarithm of time, the same: {estimate(difference(*areas), mean)}"


def levels(shares: Shares, options: argparse.Namespace) -> Iterator[str]:
    """Yield a table of times to levels."""
    arms = options.arms
    yield "| share | " + " | ".join(f"{arm}, s (reached)" for arm in arms) + " | scratch / transfer |"
    yield "| --- " * (2 + len(arms)) + "|"
    for level in LEVELS:
        cells = []
        for arm in arms:
            times = shares.of_runs(time_to(level), arm)
            reached = np.concatenate([each.ravel() for each in times])
            middle = float(median(reached))
            words = f"{middle:.2f}" if np.isfinite(middle) else f"over {options.seconds:g}"
            cells.append(f"{words} ({np.isfinite(reached).mean():.0%})")
        cells.append(str(speed_up(shares, level)) if "scratch" in arms else "")
        yield f"| {level:g} | " + " | ".join(cells) + " |"


def speed_up(shares: Shares, level: float) -> str:
    """How many times as fast transfer is, median over pairs of runs, with its interval; never is infinite."""
    ours, theirs = (shares.of_runs(time_to(level), arm) for arm in ("transfer", "scratch"))
    ratios = []
    for our, their in zip(ours, theirs, strict=True):
        with np.errstate(invalid="ignore"):
            ratio = np.where(our == their, 1.0, their / np.maximum(our, 1e-3))
        ratios.append(ratio)
    found = estimate(ratios, median)
    return " ".join(_times(found))


def _times(found: Estimate) -> Iterator[str]:
    yield f"{found.value:.0f}" if np.isfinite(found.value) else "never / ever"
    yield f"[{found.low:.0f}, {'inf' if not np.isfinite(found.high) else f'{found.high:.0f}'}]"


def families(shares: Shares, options: argparse.Namespace) -> Iterator[str]:
    """Yield a table of shares by family."""
    yield (
        "| family | transfer, 1 s | " + " | ".join(f"{a}, {options.seconds:g} s" for a in options.arms) + " |"
    )
    yield "| --- " * (2 + len(options.arms)) + "|"
    early = shares.at("transfer", EARLY)
    late = {arm: shares.at(arm, options.seconds) for arm in options.arms}
    for place, family in enumerate(list(FAMILIES)[: len(early)]):
        cells = [f"{early[place].mean():.4f}", *(f"{late[arm][place].mean():.4f}" for arm in options.arms)]
        yield f"| {family} | " + " | ".join(cells) + " |"


def curve(shares: Shares, options: argparse.Namespace) -> Iterator[str]:
    """Yield the means over problems and seeds by time, with intervals."""
    yield "| s | " + " | ".join(options.arms) + " |"
    yield "| --- " * (1 + len(options.arms)) + "|"
    for moment in MOMENTS:
        if moment <= options.seconds:
            found = [estimate(shares.at(arm, moment), mean) for arm in options.arms]
            yield f"| {moment:g} | " + " | ".join(map(str, found)) + " |"


def untrained(folder: Path) -> Path:
    """Write a policy with random weights as a checkpoint."""
    config = PairwiseConfig(64, 3, 32)
    policy = PairwisePolicy.of_seed(config, 1)
    task = problem_of(0)[1]
    data = encode(
        policy, config=config, task=task, algorithm="qmix", seed=1, parameters=QmixParameters(), metrics={}
    )
    assert data is not None
    file = folder / f"{UNTRAINED}.safetensors"
    file.write_bytes(data)
    return file


def main() -> None:
    """Print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--work", type=Path, required=True, help="folder of results")
    parser.add_argument("--policies", type=Path, help="folder of checkpoints; the shipped ones if left out")
    parser.add_argument("--source", help="id of the policy that is carried over; the first if left out")
    parser.add_argument("--problems", type=int, default=144)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=list(ARMS), help="transfer is one of them")
    parser.add_argument("--seconds", type=float, default=30.0, help="of processor time a run")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    policies = policies_for_every_size(options.policies)
    with tempfile.TemporaryDirectory() as folder:
        untrained(Path(folder))
        with library_of([*policies, *read_policies(Path(folder))]) as url:
            trial = Trial(url, options.source or policies[0].id, options.seconds)
            runs = all_runs(options, trial)
    shares = Shares(runs, options)
    parts = [
        *(partial(claim, other=other) for other in options.arms if other != "transfer"),
        families,
        levels,
        curve,
    ]
    lines = [
        f"{platform.machine()}, {platform.python_implementation()} {platform.python_version()}, torch "
        f"{torch.__version__}; {options.problems} problems, {options.seeds} seeds, one thread each, "
        f"{trial.source}"
    ]
    for part in parts:
        lines += ["", *part(shares, options)]
    text = "\n".join(lines)
    print(text)
    (options.work / "transfer_pays.md").write_text(text + "\n", encoding="utf-8")
    write_curve(runs, options.work / "curve.csv")


def write_curve(runs: dict[Key, Any], path: Path) -> None:
    """Write when each run became better, and its share then."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("family", "problem", "seed", "arm", "seconds", "share"))
        for (arm, number, seed), better in runs.items():
            if arm != "reference":
                for moment, reward in better:
                    share = reward / runs["reference", number, 0]
                    writer.writerow((problem_of(number)[0], number, seed, arm, moment, share))


if __name__ == "__main__":
    main()
