"""Regret of the chosen source: how much reward it costs not to know which policy of the library is best.

    python tests/benchmarks/bench_source_choice.py [--policies FOLDER] [--problems 128] [--report FILE]

Fresh problems of all families and four sizes; K is 3 in half of them, otherwise 1 to 6. Every policy for
every size in the library is rolled out on each, greedily and as the service does it (``transfer_qmix`` with
``n_epochs`` and ``samples`` 0 and no polish, from that source). The oracle knows the best one. A choice's
regret is the share of the oracle's reward that it gives away:

- service: the nearest four by their summaries, the best of them by its roll-out, as requests are answered;
- at sight: what a request for the bare roll-out takes, from fewer policies;
- nearest: the nearest by its summary, untried;
- paper: the nearest by the paper's distance, untried. It compares only tasks of the same M, N and K, so each
  policy stands there with one task of each of its families, drawn at the problem's size;
- general: always the policy that was trained on most families;
- random: any, the mean over all.
"""

from __future__ import annotations

import argparse
import platform
import sys
from pathlib import Path

import numpy as np
import torch

sys.path[:0] = [str(Path(__file__).parents[2])]

from library_on_trial import library_of, policies_for_every_size  # noqa: E402

from app.learning.checkpoints.source_policies import SHORTLIST, SourcePolicies  # noqa: E402
from app.learning.parameters import TransferQmixParameters  # noqa: E402
from app.learning.transfer import TransferQmix  # noqa: E402
from app.library.description import task_description  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import FAMILIES, generate  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.stop import never  # noqa: E402

SIZES = ((5, 10), (7, 15), (10, 20), (20, 30))
STREAM = 50_000_017
BARE = {"n_epochs": 0, "samples": 0, "polish": False}
CHOICES = ("service", "at sight", "nearest", "paper", "general", "random")


def problem_of(number):
    """A fresh problem and its family; families take turns, then sizes."""
    rng = np.random.default_rng([STREAM, number])
    family = list(FAMILIES)[number % len(FAMILIES)]
    m, n = SIZES[number // len(FAMILIES) % len(SIZES)]
    k = 3 if rng.random() < 0.5 else int(rng.integers(1, 7))
    return family, generate(family, m, n, k, rng)


def roll_out(url, problem, **source):
    """Greedy roll-out of a policy by the service: which one it was, and what it earned."""
    solver = TransferQmix(TransferQmixParameters(**BARE, **source), SolverContext(url))
    solution = solver.solve(problem, 1, never, lambda _progress: None)
    return solution.source_policy.id, reward_of(problem, solution.plan)


def by_the_paper(policies, problem, number):
    """Id of the policy with the nearest task by the paper's distance."""
    here, found = task_description(problem), {}
    for order, policy in enumerate(policies):
        for family in policy.metadata.get("families", FAMILIES):
            rng = np.random.default_rng([STREAM, number, order, *family.encode()])
            task = generate(family, problem.n_uavs, problem.n_targets, problem.n_materials, rng)
            distance = float(((task_description(task) - here) ** 2).sum())
            found[policy.id] = min(distance, found.get(policy.id, np.inf))
    return min(found, key=found.get)


def regrets_of(url, policies, number):
    """Regret in percent of every choice, and the oracle's policy; None where nothing can be earned."""
    _, problem = problem_of(number)
    earned = {policy.id: roll_out(url, problem, source=policy.id)[1] for policy in policies}
    best = max(earned.values())
    if best <= 0:
        return None
    shortlist = [source.policy.id for source in SourcePolicies(url).shortlist(problem)]
    general = max(policies, key=lambda policy: len(policy.metadata.get("families", FAMILIES)))
    chosen = {
        "service": max(earned[each] for each in shortlist),
        "at sight": earned[roll_out(url, problem)[0]],
        "nearest": earned[shortlist[0]],
        "paper": earned[by_the_paper(policies, problem, number)],
        "general": earned[general.id],
        "random": float(np.mean(list(earned.values()))),
    }
    return {name: 100 * (best - reward) / best for name, reward in chosen.items()}, max(
        earned, key=earned.get
    )


def main():
    """Print the table, a row a family."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--policies", type=Path, help="folder of checkpoints; the shipped ones if left out")
    parser.add_argument("--problems", type=int, default=128)
    parser.add_argument("--report", type=Path, help="Markdown file to write")
    options = parser.parse_args()
    torch.set_num_threads(1)
    policies = policies_for_every_size(options.policies)
    found, oracles = {family: [] for family in FAMILIES}, {policy.id: 0 for policy in policies}
    with library_of(policies) as url:
        for number in range(options.problems):
            regrets = regrets_of(url, policies, number)
            if regrets is not None:
                found[problem_of(number)[0]].append([regrets[0][name] for name in CHOICES])
                oracles[regrets[1]] += 1
            print(f"\r{number + 1} of {options.problems} problems", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    lines = [
        f"{platform.machine()}, torch {torch.__version__}; {len(policies)} policies, {SHORTLIST} tried; "
        "mean regret in %, ± standard deviation over problems; in the last row the 95th percentile.",
        "",
        "| family | problems | " + " | ".join(CHOICES) + " |",
        "| --- " * (2 + len(CHOICES)) + "|",
    ]
    rows = {family: np.array(values) for family, values in found.items() if values}
    rows["all"] = np.concatenate(list(rows.values()))
    for family, values in rows.items():
        cells = [f"{a:.2f} ± {b:.2f}" for a, b in zip(values.mean(axis=0), values.std(axis=0), strict=True)]
        lines.append(f"| {family} | {len(values)} | " + " | ".join(cells) + " |")
    late = np.percentile(rows["all"], 95, axis=0)
    lines.append(f"| 95 % | {len(rows['all'])} | " + " | ".join(f"{each:.2f}" for each in late) + " |")
    shares = ", ".join(f"{name} {count}" for name, count in oracles.items())
    lines += ["", f"The oracle took: {shares}."]
    print("\n".join(lines))
    if options.report:
        options.report.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
