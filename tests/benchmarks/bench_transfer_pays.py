"""Does transfer pay? Fine-tuning from the library's best source, against the same learner from nothing.

    python tests/benchmarks/bench_transfer_pays.py --work FOLDER [--problems 24] [--seeds 3] [--workers 2]

Fresh problems of all families and three sizes, K = 3. ``transfer_qmix`` in service mode, without its local
search, for ``--transfer-seconds`` (1): it picks its source, samples, plans groups anew (four times as many
episodes as by default) and fine-tunes until the time is up.
``qmix`` in service mode, the same networks and the same fine-tuning from random weights, for
``--scratch-seconds`` (30). Both begin with the greedy rule's plan. Rewards are those of the best plan, over
what a search of 400,000 moves earns. Time is processor time of one thread, what the solvers report later does
not count, and compiling and loading come before.

Every run is kept in the work folder, so a stopped benchmark goes on where it was. There it also writes
``transfer_pays.md`` (both tables) and ``curve.csv`` (reward by time of every run).
"""

from __future__ import annotations

import argparse
import csv
import json
import multiprocessing
import platform
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np
import torch

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1] / "support")]

from library_on_trial import library_of, policies_for_every_size  # noqa: E402
from stopping import After  # noqa: E402

from app.learning.parameters import QmixParameters, TransferQmixParameters  # noqa: E402
from app.learning.qmix import Qmix  # noqa: E402
from app.learning.transfer import TransferQmix  # noqa: E402
from app.learning.universal.training.demonstrations import demonstrate  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import FAMILIES, generate  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.stop import Deadline  # noqa: E402

SIZES = ((5, 10), (7, 15), (10, 20))
STREAM = 40_000_033
MOMENTS = (0.1, 0.2, 0.3, 0.5, 0.7, 1, 2, 3, 5, 7, 10, 15, 20, 30, 45, 60)
MOVES = 400_000
FOREVER = 10**6
REPLANS = 768


def problem_of(number):
    """A fresh problem, its family and its size; families take turns, then sizes."""
    family = list(FAMILIES)[number % len(FAMILIES)]
    m, n = SIZES[number // len(FAMILIES) % len(SIZES)]
    return family, m, n, generate(family, m, n, 3, np.random.default_rng([STREAM, number]))


def solver_of(method, url):
    if method == "transfer":
        parameters = TransferQmixParameters(polish=False, replans=REPLANS, n_epochs=FOREVER)
        return TransferQmix(parameters, SolverContext(url))
    return Qmix(QmixParameters(n_epochs=FOREVER), SolverContext())


def run(number, method, seed, seconds, url):
    """What one run earned, moment by moment."""
    torch.set_num_threads(1)
    *_, problem = problem_of(number)
    warm(method, url)
    told, start = [], time.process_time()
    solution = solver_of(method, url).solve(
        problem,
        seed,
        Deadline(seconds, time.process_time),
        lambda p: told.append((time.process_time() - start, p.best_reward)),
    )
    floor = reward_of(problem, greedy_plan(problem))
    rewards = [
        max([floor, *(reward for at, reward in told if at <= moment)])
        for moment in MOMENTS
        if moment <= seconds
    ]
    source = solution.source_policy
    return {"rewards": rewards, "source": None if source is None else source.id}


_warm = set()


def warm(method, url):
    """Compile and load what a method needs, once a process."""
    if method in _warm:
        return
    _warm.add(method)
    problem = generate("deadline", 3, 5, 3, np.random.default_rng(1))
    solver_of(method, url).solve(problem, 1, After(400), lambda _progress: None)


def reference(number):
    """Reward of a searched plan."""
    _, _, _, problem = problem_of(number)
    shown = demonstrate(problem, MOVES, np.random.default_rng(number))
    if shown is None:
        raise ValueError(f"nothing can be earned in problem {number}")
    return shown.reward


def all_runs(options, url, file):
    """Do what is missing; return every result by its key, (kind, problem, seed, seconds)."""
    done = {}
    if file.exists():
        done = {tuple(key): value for key, value in map(json.loads, file.read_text().splitlines())}
    asked = [("reference", number, 0, 0.0) for number in range(options.problems)]
    for number in range(options.problems):
        for seed in range(1, options.seeds + 1):
            asked.append(("transfer", number, seed, options.transfer_seconds))
            asked.append(("scratch", number, seed, options.scratch_seconds))
    missing = [key for key in asked if key not in done]
    pool = ProcessPoolExecutor(options.workers, multiprocessing.get_context("spawn"))
    with pool, file.open("a", encoding="utf-8") as out:
        futures = {}
        for kind, number, seed, seconds in missing:
            work = (reference, number) if kind == "reference" else (run, number, kind, seed, seconds, url)
            futures[pool.submit(*work)] = (kind, number, seed, seconds)
        for count, future in enumerate(as_completed(futures), 1):
            done[futures[future]] = future.result()
            out.write(json.dumps([futures[future], future.result()]) + "\n")
            out.flush()
            print(f"\r{count} of {len(missing)} runs", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return {key: done[key] for key in asked}


def ratios(runs, kind, number):
    """Rewards over the reference, (seeds, moments)."""
    rows = [value["rewards"] for key, value in runs.items() if key[:2] == (kind, number)]
    return np.array(rows) / runs["reference", number, 0, 0.0]


def table(runs, options):
    """Lines of Markdown: a row a problem."""
    lines = [
        f"| family | M x N | greedy rule | transfer, {options.transfer_seconds:g} s "
        f"| scratch, {options.scratch_seconds:g} s | passes | source |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    passes, pairs, gains = 0, 0, []
    for number in range(options.problems):
        family, m, n, problem = problem_of(number)
        carried, scratch = (ratios(runs, kind, number)[:, -1] for kind in ("transfer", "scratch"))
        better = carried.mean() >= scratch.mean() - 1e-9
        passes += better
        pairs += (carried >= scratch - 1e-9).sum()
        gains.append(carried.mean() - scratch.mean())
        rule = reward_of(problem, greedy_plan(problem)) / runs["reference", number, 0, 0.0]
        source = runs["transfer", number, 1, options.transfer_seconds]["source"]
        lines.append(
            f"| {family} | {m} x {n} | {rule:.3f} | {carried.mean():.3f} ± {carried.std():.3f} "
            f"| {scratch.mean():.3f} ± {scratch.std():.3f} | {'yes' if better else 'no'} | {source} |"
        )
    lines += [
        "",
        f"Transfer passes on {passes} of {options.problems} problems by the mean of {options.seeds} seeds, "
        f"and in {pairs} of {options.problems * options.seeds} runs; it is ahead by "
        f"{np.mean(gains):.3f} ± {np.std(gains):.3f}.",
    ]
    return lines


def curve(runs, options):
    """Lines of Markdown: the mean over problems and seeds by time, and bars from 0.7 to 1."""
    means = {}
    for kind in ("transfer", "scratch"):
        rows = np.concatenate([ratios(runs, kind, number) for number in range(options.problems)])
        means[kind] = list(zip(rows.mean(axis=0), rows.std(axis=0), strict=True))
    lines = ["| s | transfer | scratch | |", "| --- | --- | --- | --- |"]
    for index, moment in enumerate(MOMENTS):
        words, bars = [], []
        for kind, mark in (("transfer", "T"), ("scratch", "s")):
            if index < len(means[kind]):
                mean, spread = means[kind][index]
                words.append(f"{mean:.3f} ± {spread:.3f}")
                bars.append((mean, mark))
            else:
                words.append("")
        if bars:
            line = [" "] * 61
            for mean, mark in bars:
                line[int(np.clip((mean - 0.7) / 0.3, 0, 1) * 60)] = mark
            drawing = "".join(line).rstrip().replace(" ", ".")
            lines.append(f"| {moment:g} | {words[0]} | {words[1]} | `{drawing}` |")
    return lines


def main():
    """Print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--work", type=Path, required=True, help="folder of results")
    parser.add_argument("--policies", type=Path, help="folder of checkpoints; the shipped ones if left out")
    parser.add_argument("--problems", type=int, default=24)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--transfer-seconds", type=float, default=1.0)
    parser.add_argument("--scratch-seconds", type=float, default=30.0)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    with library_of(policies_for_every_size(options.policies)) as url:
        runs = all_runs(options, url, options.work / "transfer_pays.jsonl")
    text = "\n".join(
        [
            f"{platform.machine()}, {platform.python_implementation()} {platform.python_version()}, "
            f"torch {torch.__version__}; {options.problems} problems, {options.seeds} seeds, one thread each",
            "",
            *table(runs, options),
            "",
            *curve(runs, options),
        ]
    )
    print(text)
    (options.work / "transfer_pays.md").write_text(text + "\n", encoding="utf-8")
    with (options.work / "curve.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("family", "m", "n", "problem", "seed", "method", "seconds", "reward", "ratio"))
        for (kind, number, seed, _), value in runs.items():
            if kind != "reference":
                family, m, n, _ = problem_of(number)
                best = runs["reference", number, 0, 0.0]
                for moment, reward in zip(MOMENTS, value["rewards"], strict=False):
                    writer.writerow((family, m, n, number, seed, kind, moment, reward, reward / best))


if __name__ == "__main__":
    main()
