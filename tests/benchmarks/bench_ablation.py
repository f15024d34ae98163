"""What each part of the learner is worth: variants trained for the same time from the same demonstrations.

    python tests/benchmarks/bench_ablation.py --work FOLDER [--minutes 1] [--seeds 3] [--workers 2]

One size, 7 x 15 with K = 3, all families. Every variant is trained from random weights for ``--minutes`` of
processor time (one thread), with the same demonstrations and the same schedule over that time, then plays
fresh problems greedily, once each. Printed is the mean of reward over that of a search of 400,000 moves, ±
the standard deviation over seeds.

- full: as ``python -m app train-universal`` learns, without corrections;
- corrections: from half of the time on also from 512 of them, which it makes then, off the clock;
- Adam: in place of Muon on the matrices, at the learning rate that suits it;
- no TD loss: cross-entropy alone;
- no demonstrations: own sampled episodes and the TD loss alone;
- VDN: Q_tot is the sum of the agents' values;
- no bias: neither distances nor what is seen of a UAV and a place together count in the attention;
- no pooling: what is seen of a UAV and a place together counts in no token;
- paper: agent and mixing network of the paper for this one size, by the paper's observations, on the same
  demonstrations with the same two losses, target network copied every 100 updates.

Demonstrations and finished runs stay in the work folder, so a stopped benchmark goes on where it was; the
table is written to ``ablation.md`` there.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import platform
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

sys.path[:0] = [str(Path(__file__).parents[2])]

from app.learning.pairwise.architecture import PairwiseConfig  # noqa: E402
from app.learning.pairwise.learner import Learner, make_decisions  # noqa: E402
from app.learning.pairwise.policy import PairwisePolicy  # noqa: E402
from app.learning.pairwise.states import all_turns  # noqa: E402
from app.learning.paper.architecture import QmixConfig  # noqa: E402
from app.learning.paper.environment import SwarmEnvironment  # noqa: E402
from app.learning.paper.episode import Actor  # noqa: E402
from app.learning.paper.learner import Learner as PaperLearner  # noqa: E402
from app.learning.paper.networks import QmixNetwork  # noqa: E402
from app.learning.paper.replay_buffer import Batch as PaperBatch  # noqa: E402
from app.learning.universal.training.corrections import correct  # noqa: E402
from app.learning.universal.training.demonstrations import (  # noqa: E402
    demonstrate,
    read_demonstrations,
    write_demonstrations,
)
from app.learning.universal.training.trainer import Material, Schedule  # noqa: E402
from app.learning.universal.updates.optimiser import adam, muon  # noqa: E402
from app.simulation.arrays import compile_problem  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import FAMILIES, generate  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402

M, N, K = 7, 15, 3
LEARNED, TRIED, CORRECTED = 1024, 64, 512
MOVES = {LEARNED: 60_000, TRIED: 400_000}
LR, MUON_LR, TD_WEIGHT, TD_EVERY, WARM_UP = 2e-3, 1e-2, 0.2, 4, 30
EPISODES = 24
"""Own episodes, and the paper's, in an update."""

CONFIG = PairwiseConfig(width=64, layers=3)
CPU = torch.device("cpu")


class Sum(nn.Module):
    """VDN; over M, as the mixer's is a mean."""

    def forward(self, values, hidden, present):
        return (values * present).sum(dim=1) / values.shape[1]


@dataclass(frozen=True)
class Variant:
    """What differs from the full learner; parts of the agent by name are 0 and stay so."""

    corrections: bool = False
    demonstrations: bool = True
    td_weight: float = TD_WEIGHT
    mixer: bool = True
    muon: bool = True
    without: tuple[str, ...] = ()


VARIANTS = {
    "full": Variant(),
    "corrections": Variant(corrections=True),
    "Adam": Variant(muon=False),
    "no TD loss": Variant(td_weight=0.0),
    "no demonstrations": Variant(demonstrations=False),
    "VDN": Variant(mixer=False),
    "no bias": Variant(without=("visit_bias", "reload_bias", "distance_bias")),
    "no pooling": Variant(without=("uav_pool", "area_pool", "base_pool")),
}
PAPER = "paper"


def problems_of(count):
    """Problems of which the greedy rule earns something; another number of them is others."""
    rng, found = np.random.default_rng([60_000_011, count]), []
    families = list(FAMILIES)
    while len(found) < count:
        problem = generate(families[len(found) % len(families)], M, N, K, rng)
        if reward_of(problem, greedy_plan(problem)) > 0.05 * max(t.level for t in problem.targets):
            found.append(problem)
    return found


def searched(folder, count):
    """Write a plan for each problem, unless the file is there; return where."""
    path = folder / f"demonstrations-{count}.jsonl"
    if not path.exists():
        rng = np.random.default_rng(count)
        write_demonstrations(path, [demonstrate(each, MOVES[count], rng) for each in problems_of(count)])
    return path


class Clock:
    """Share of a training's processor time that is over, and of the learning rate at this moment."""

    def __init__(self, seconds):
        self._seconds, self._start, self.updates = seconds, time.process_time(), 0

    @contextmanager
    def stopped(self):
        """Count nothing meanwhile."""
        begin = time.process_time()
        yield
        self._start += time.process_time() - begin

    @property
    def share(self):
        return (time.process_time() - self._start) / self._seconds

    def share_of_lr(self):
        self.updates += 1
        return min(1.0, self.updates / WARM_UP) * (0.5 + 0.5 * float(np.cos(np.pi * min(1.0, self.share))))


def train(name, seed, seconds, shown):
    """Train a variant of the networks for every size; return the policy and the number of updates."""
    variant = VARIANTS[name]
    policy = PairwisePolicy.of_seed(CONFIG, seed)
    for part in variant.without:
        for weights in getattr(policy.agent, part).parameters():
            nn.init.zeros_(weights).requires_grad_(False)
    lr, optimisers = (MUON_LR, muon) if variant.muon else (LR, adam)
    mixer = policy.mixer if variant.mixer else Sum()
    learner = Learner(policy.agent, mixer, lr=lr, td_weight=variant.td_weight, optimisers=optimisers)
    schedule, material = Schedule(1, td_weight=variant.td_weight, seed=seed), Material(shown, CPU)
    clock, corrected = Clock(seconds), not variant.corrections
    while clock.share < 1:
        if clock.share > 0.5 and not corrected:
            corrected = True
            with clock.stopped():
                material = Material(shown + corrections_of(policy, seed), CPU)
        batch, decisions = None, None
        if variant.demonstrations:
            batch, decisions = material.of_update(schedule, clock.updates)
        else:
            decisions = own_episodes(policy, shown, np.random.default_rng([seed, clock.updates]))
        learner.update(clock.share_of_lr(), batch, decisions)
    return policy, clock.updates


def corrections_of(policy, seed):
    """Let a policy play fresh problems, and search what it should have done."""
    rng = np.random.default_rng([seed, CORRECTED])
    found = (correct(each, policy, MOVES[LEARNED], rng) for each in problems_of(CORRECTED))
    return [each for each in found if each is not None]


def own_episodes(policy, shown, rng):
    """Sample episodes of some problems."""
    parts = []
    for k in rng.choice(LEARNED, EPISODES, replace=False):
        arrays = compile_problem(shown[k].problem)
        parts.append(all_turns(arrays, policy.play(arrays, np.zeros(1, np.int64), rng).plans[0]))
    return make_decisions(parts, CPU)


def train_paper(seed, seconds, shown):
    """Train the networks of the paper for this size; return them and the number of updates."""
    config = QmixConfig(M, N, K, 64, 32)
    network = QmixNetwork(config.sizes, 64, 32, torch.Generator().manual_seed(seed))
    sharpness = nn.Parameter(torch.tensor(2.0))
    learner = PaperLearner(network, LR, 0.99, 10.0)
    trained = [*network.parameters(), sharpness]
    optimiser = torch.optim.AdamW(trained, lr=LR, weight_decay=1e-4)
    episodes, clock = paper_episodes(shown), Clock(seconds)
    while clock.share < 1:
        rng = np.random.default_rng([seed, clock.updates])
        chosen = torch.from_numpy(rng.choice(LEARNED, EPISODES, replace=False))
        batch = PaperBatch(*(column[:, chosen] for column in episodes))
        optimiser.param_groups[0]["lr"] = LR * clock.share_of_lr()
        logits = network.unroll(batch.states, batch.actions) * sharpness.exp()
        logits = logits.masked_fill(~batch.allowed, -1e9)
        out = batch.filled[:, :, None] & (batch.allowed.sum(dim=3) > 1)
        loss = functional.cross_entropy(logits[out], batch.actions[out])
        if clock.updates % TD_EVERY == TD_EVERY - 1:
            loss = loss + TD_WEIGHT * learner.loss(batch)
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(trained, 1.0)
        optimiser.step()
        if clock.updates % 100 == 0:
            learner.update_target()
    return network, clock.updates


def paper_episodes(shown):
    """All demonstrations as the paper's networks see them; rewards in largest levels and a UAV."""
    steps = max(len(each.plan) for each in shown)
    sizes = SwarmEnvironment(shown[0].problem).sizes
    states = np.zeros((steps, LEARNED, sizes.state_features), np.float32)
    allowed = np.zeros((steps, LEARNED, M, N + 1), np.bool_)
    actions = np.full((steps, LEARNED, M), N, np.int64)
    rewards = np.zeros((steps, LEARNED), np.float32)
    terminated, filled = np.zeros((2, steps, LEARNED), np.bool_)
    draws = np.ones((M, 2))
    for index, each in enumerate(shown):
        environment, level = SwarmEnvironment(each.problem), max(t.level for t in each.problem.targets)
        environment.reset()
        for step, row in enumerate(each.plan):
            if environment.done:
                break
            environment.observe(states[step, index], allowed[step, index])
            earned = environment.step(np.eye(N + 1, dtype=np.float32)[row], draws, 0.0, actions[step, index])
            rewards[step, index] = earned / level / M
            filled[step, index] = True
        terminated[int(filled[:, index].sum()) - 1, index] = True
    return PaperBatch(*map(torch.from_numpy, (states, allowed, actions, rewards, terminated, filled)))


@lru_cache(maxsize=2)
def read(path):
    return read_demonstrations(path)


def run(name, seed, seconds, folder):
    """Greedy ratio of a variant on the problems that are tried, its spread over them, and its updates."""
    torch.set_num_threads(1)
    shown, tried = (read(searched(folder, count)) for count in (LEARNED, TRIED))
    if name == PAPER:
        network, updates = train_paper(seed, seconds, shown)
        rewards = [Actor(SwarmEnvironment(each.problem), network).play_greedily().reward for each in tried]
    else:
        policy, updates = train(name, seed, seconds, shown)
        rewards = [
            policy.play(compile_problem(each.problem), np.zeros(1, np.int64)).rewards[0] for each in tried
        ]
    ratios = np.array(rewards) / [each.reward for each in tried]
    return {"ratio": float(ratios.mean()), "spread": float(ratios.std()), "updates": updates}


def main():
    """Train what is missing, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--work", type=Path, required=True, help="folder of demonstrations and results")
    parser.add_argument("--minutes", type=float, default=1.0, help="of processor time a training")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    for count in (LEARNED, TRIED):
        searched(options.work, count)
    file, done = options.work / "ablation.jsonl", {}
    if file.exists():
        done = {tuple(key): value for key, value in map(json.loads, file.read_text().splitlines())}
    seconds, seeds = 60 * options.minutes, range(1, options.seeds + 1)
    asked = [(name, seed, seconds) for seed in seeds for name in (*VARIANTS, PAPER)]
    pool = ProcessPoolExecutor(options.workers, multiprocessing.get_context("spawn"))
    with pool, file.open("a", encoding="utf-8") as out:
        futures = {pool.submit(run, *key, options.work): key for key in asked if key not in done}
        for count, future in enumerate(as_completed(futures), 1):
            if future.exception():
                pool.shutdown(wait=False, cancel_futures=True)
            done[futures[future]] = future.result()
            out.write(json.dumps([futures[future], future.result()]) + "\n")
            out.flush()
            print(f"\r{count} of {len(futures)} trainings", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    text = "\n".join(table(done, options, seconds))
    print(text)
    (options.work / "ablation.md").write_text(text + "\n", encoding="utf-8")


def table(done, options, seconds):
    """Lines of Markdown."""
    tried = read(searched(options.work, TRIED))
    rule = np.array([reward_of(each.problem, greedy_plan(each.problem)) / each.reward for each in tried])
    lines = [
        f"{platform.machine()}, torch {torch.__version__}, one thread: {options.minutes:g} min of processor "
        f"time each, {options.seeds} seeds, {LEARNED} demonstrations, {TRIED} fresh problems of {M} x {N}",
        "",
        "| variant | greedy ratio | updates |",
        "| --- | --- | --- |",
    ]
    for name in (*VARIANTS, PAPER):
        runs = [done[name, seed, seconds] for seed in range(1, options.seeds + 1)]
        ratios = np.array([each["ratio"] for each in runs])
        updates = np.mean([each["updates"] for each in runs])
        lines.append(f"| {name} | {ratios.mean():.3f} ± {ratios.std():.3f} | {updates:.0f} |")
    lines.append(f"| greedy rule | {rule.mean():.3f} | |")
    return lines


if __name__ == "__main__":
    main()
