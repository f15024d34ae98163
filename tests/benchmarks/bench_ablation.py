"""What each part of the learner is worth: variants trained for the same time.

    python tests/benchmarks/bench_ablation.py --work FOLDER [--minutes 1] [--seeds 3] [--variants full VDN]

One size, 7 x 15 with K = 3. Every variant is trained from random weights for ``--minutes`` of processor time
(one thread), with as many demonstrations and the same schedule over that time. Then it plays fresh problems
of all families, and of none, greedily, once each. Printed is the mean of reward over that of a search of
400,000 moves, ± the standard deviation over seeds, and in brackets by how much it is more than the full
learner's, ± the standard error over problems. Where staying at home earns more, that counts.

- full: as ``python -m app train-universal`` learns, but of families alone and without corrections;
- order: UAVs act in the order of their numbers, in play and in the states that are learned from; otherwise
  the surest acts. Both are also played the other way;
- uniform alone, drawn alone: demonstrations of one family, and of the generator of problems of no family;
- half drawn: half of the demonstrations of each of both;
- corrections: from half of the time on also from 512 of them, which it makes then, off the clock;
- VDN: Q_tot is the sum of the agents' values;
- no TD loss: cross-entropy alone;
- no demonstrations: own sampled episodes and the TD loss alone;
- no bias: neither distances nor what is seen of a UAV and a place together count in the attention;
- no pooling: what is seen of a UAV and a place together counts in no token;
- Adam: in place of Muon on the matrices, at the learning rate that suits it;
- short search: plans of the demonstrations are searched with a tenth of the moves;
- paper: agent and mixing network of the paper for this one size, by the paper's observations, on the same
  demonstrations with the same two losses, target network copied every 100 updates. It takes no bases, so it
  plays families alone.

There is none without recurrence: the network has none.

Demonstrations and finished runs stay in the work folder, so a stopped benchmark goes on where it was; the
table of what is finished is written to ``ablation.md`` there.
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
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from torch import nn
from torch.nn import functional

sys.path[:0] = [str(Path(__file__).parents[2])]

from ablation_problems import (  # noqa: E402
    CORRECTED,
    LEARNED,
    LONG,
    MOVES,
    SHORT,
    TRIED,
    TRIED_KINDS,
    K,
    M,
    N,
    of_greedy_rule,
    problems_of,
    read,
    searched,
)

from app.learning.pairwise import rollout  # noqa: E402
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
from app.learning.universal.training.trainer import Material, Schedule  # noqa: E402
from app.learning.universal.updates.optimiser import adam, muon  # noqa: E402
from app.simulation.arrays import compile_problem  # noqa: E402

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

    kinds: tuple[str, ...] = ("families",)
    moves: int = MOVES
    in_order: bool = False
    corrections: bool = False
    demonstrations: bool = True
    td_weight: float = TD_WEIGHT
    mixer: bool = True
    muon: bool = True
    without: tuple[str, ...] = ()


VARIANTS = {
    "full": Variant(),
    "order": Variant(in_order=True),
    "uniform alone": Variant(kinds=("uniform",)),
    "drawn alone": Variant(kinds=("none",)),
    "half drawn": Variant(kinds=("families", "none")),
    "corrections": Variant(corrections=True),
    "VDN": Variant(mixer=False),
    "no TD loss": Variant(td_weight=0.0),
    "no demonstrations": Variant(demonstrations=False),
    "no bias": Variant(without=("visit_bias", "reload_bias", "distance_bias")),
    "no pooling": Variant(without=("uav_pool", "area_pool", "base_pool")),
    "Adam": Variant(muon=False),
    "short search": Variant(moves=SHORT),
}
PAPER = "paper"


class InOrder(np.random.Generator):
    """Draws no order of UAVs: those with the lowest numbers have acted."""

    def permuted(self, x, **_):
        return x


class OrderedMaterial(Material):
    """Demonstrations whose UAVs act in the order of their numbers."""

    def batch(self, rng):
        return super().batch(InOrder(rng.bit_generator))


def by_number(_logits, choice):
    """Let the lower number be the surer."""
    return np.tile(-np.arange(choice.shape[1], dtype=np.float64), (len(choice), 1))


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
    schedule = Schedule(1, td_weight=variant.td_weight, seed=seed)
    material = (OrderedMaterial if variant.in_order else Material)(shown, CPU)
    # What is compiled or loaded at a first call is not the training's.
    material.of_update(schedule, TD_EVERY - 1)
    own_episodes(policy, shown, np.random.default_rng(seed))
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
    found = (correct(each, policy, MOVES, rng) for each in problems_of("families", CORRECTED))
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


def played(play, tried):
    """Reward of each problem, over what the long search earns."""
    return [round(float(play(each.problem)) / each.reward, 5) for each in tried]


def run(name, seed, seconds, folder):
    """Greedy ratios of a variant on the problems that are tried, by who acts first, and its updates."""
    torch.set_num_threads(1)
    variant = VARIANTS.get(name, Variant())
    files = [searched(folder, kind, LEARNED, variant.moves) for kind in variant.kinds]
    shown = [each for file in files for each in read(file)[: LEARNED // len(files)]]
    tried = {kind: read(searched(folder, kind, TRIED, LONG)) for kind in TRIED_KINDS}
    if name == PAPER:
        network, updates = train_paper(seed, seconds, shown)

        def of_paper(problem):
            return Actor(SwarmEnvironment(problem), network).play_greedily().reward

        return {"order": {"families": played(of_paper, tried["families"])}, "updates": updates}
    policy, updates = train(name, seed, seconds, shown)

    def of_policy(problem):
        return policy.play(compile_problem(problem), np.zeros(1, np.int64)).rewards[0]

    surest = {kind: played(of_policy, tried[kind]) for kind in tried}
    with patch.object(rollout, "_log_probability", by_number):
        order = {kind: played(of_policy, tried[kind]) for kind in tried}
    return {"surest": surest, "order": order, "updates": updates}


def main():
    """Train what is missing, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--work", type=Path, required=True, help="folder of demonstrations and results")
    parser.add_argument("--minutes", type=float, default=1.0, help="of processor time a training")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--variants", nargs="+", default=[*VARIANTS, PAPER], choices=[*VARIANTS, PAPER])
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    for kind in TRIED_KINDS:
        searched(options.work, kind, TRIED, LONG)
    for name in options.variants:
        variant = VARIANTS.get(name, Variant())
        for kind in variant.kinds:
            searched(options.work, kind, LEARNED, variant.moves)
    file, done = options.work / "ablation.jsonl", {}
    if file.exists():
        done = {tuple(key): value for key, value in map(json.loads, file.read_text().splitlines())}
    seconds, seeds = 60 * options.minutes, range(1, options.seeds + 1)
    asked = [(name, seed, seconds) for seed in seeds for name in options.variants]
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
    """Lines of Markdown, of what is finished."""
    seeds = range(1, options.seeds + 1)
    tried = {kind: read(searched(options.work, kind, TRIED, LONG)) for kind in TRIED_KINDS}
    reloads = np.array([each.problem.n_bases > 0 for each in tried["none"]])
    columns = {
        "families": ("families", np.ones(TRIED, np.bool_)),
        "none": ("none", np.ones(TRIED, np.bool_)),
        f"the {reloads.sum()} of them with bases": ("none", reloads),
        "without": ("none", ~reloads),
    }
    lines = [
        f"{platform.machine()}, torch {torch.__version__}, one thread: {options.minutes:g} min of processor "
        f"time each, {options.seeds} seeds, {LEARNED} demonstrations, {TRIED} fresh problems, {M} x {N}",
        "",
        f"| variant | {' | '.join(columns)} | updates |",
        f"| --- | {'--- | ' * len(columns)}--- |",
    ]

    def ratios(name, way, kind):
        """(seeds, problems)"""
        return np.maximum([done[name, seed, seconds][way][kind] for seed in seeds], 0.0)

    def row(title, name, way):
        cells = [title]
        for kind, which in columns.values():
            if kind not in done[name, seeds[0], seconds][way]:
                cells.append("–")
                continue
            mine, full = ratios(name, way, kind)[:, which], ratios("full", "surest", kind)[:, which]
            means, more = mine.mean(axis=1), (mine - full).mean(axis=0)
            against = f" ({more.mean():+.3f} ± {more.std() / len(more) ** 0.5:.3f})" if more.any() else ""
            cells.append(f"{means.mean():.3f} ± {means.std():.3f}{against}")
        cells.append(f"{np.mean([done[name, seed, seconds]['updates'] for seed in seeds]):.0f}")
        lines.append(f"| {' | '.join(cells)} |")

    for name in (*VARIANTS, PAPER):
        if any((each, seed, seconds) not in done for each in ("full", name) for seed in seeds):
            continue
        row(name, name, "order" if name in {"order", PAPER} else "surest")
        if name == "full":
            row("full, played in order", name, "order")
        if name == "order":
            row("order, played by the surest", name, "surest")
    rule = {kind: of_greedy_rule(tried[kind]) for kind in tried}
    cells = (f"{rule[kind][which].mean():.3f}" for kind, which in columns.values())
    lines.append(f"| greedy rule | {' | '.join(cells)} | |")
    return lines


if __name__ == "__main__":
    main()
