"""What each part of the learner is worth: variants trained for the same time from the same demonstrations.

    python tests/benchmarks/bench_ablation.py --work FOLDER [--minutes 1] [--seeds 3] [--workers 2]

One size, 7 x 15 with K = 3, all families. Every variant is trained from random weights for ``--minutes`` of
processor time (one thread), with the same demonstrations and the same schedule over that time, then plays
fresh problems greedily, once each, in the order their UAVs have. Printed is the mean of reward over that of a
search of 400,000 moves, ± the standard deviation over seeds.

- full: as ``python -m app train-universal`` learns, but for its random orders of UAVs and its later steps;
- Adam: in place of Muon on the matrices, at the learning rate that suits it;
- no demonstrations: own sampled episodes and the TD loss alone;
- no turns: all UAVs of a step decide on the state at its beginning (``at_once.py``);
- VDN: Q_tot is the sum of the agents' values;
- no memory: a layer in place of the recurrent cell;
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
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

sys.path[:0] = [str(Path(__file__).parents[2])]

from app.learning.universal.updates.learner import Learner, make_batch  # noqa: E402
from at_once import play_at_once, replay_turns_at_once  # noqa: E402

from app.learning.paper.architecture import QmixConfig  # noqa: E402
from app.learning.paper.environment import SwarmEnvironment  # noqa: E402
from app.learning.paper.episode import Actor  # noqa: E402
from app.learning.paper.learner import Learner as PaperLearner  # noqa: E402
from app.learning.paper.networks import QmixNetwork  # noqa: E402
from app.learning.paper.replay_buffer import Batch as PaperBatch  # noqa: E402
from app.learning.universal.episodes.rollout import play  # noqa: E402
from app.learning.universal.episodes.turns import replay_turns  # noqa: E402
from app.learning.universal.network.agent import UniversalAgent  # noqa: E402
from app.learning.universal.network.architecture import UniversalConfig  # noqa: E402
from app.learning.universal.network.mixer import UniversalMixer  # noqa: E402
from app.learning.universal.training.curriculum import Shard  # noqa: E402
from app.learning.universal.training.demonstrations import demonstrate, read_shard  # noqa: E402
from app.learning.universal.updates.optimiser import adam, muon  # noqa: E402
from app.simulation.arrays import ProblemArrays  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import FAMILIES, generate  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402

M, N, K = 7, 15, 3
LEARNED, TRIED = 1024, 64
MOVES = {LEARNED: 60_000, TRIED: 400_000}
LR, MUON_LR, TD_WEIGHT, OWN_EVERY, TD_EVERY, WARM_UP = 2e-3, 1e-2, 0.2, 16, 4, 30
SHUT = -60.0
"""Bias of a gate that lets nothing through."""

EPISODES = 24
"""An update of every variant."""

CONFIG = UniversalConfig()


class Layer(nn.Module):
    """In place of the recurrent cell: what was seen before is not remembered."""

    def __init__(self, width):
        super().__init__()
        self.layer = nn.Linear(width, width)

    def forward(self, seen):
        return torch.tanh(self.layer(seen)), None

    @property
    def all_weights(self):
        """The weights of a recurrent cell that forgets all there was: what is left is tanh of the layer."""
        weight, bias = self.layer.weight, self.layer.bias
        none, shut = torch.zeros_like(bias), torch.full_like(bias, SHUT)
        weight_ih = torch.cat([torch.zeros_like(weight), torch.zeros_like(weight), weight])
        bias_ih = torch.cat([none, shut, bias])
        return [[weight_ih, torch.zeros_like(weight_ih), bias_ih, torch.zeros_like(bias_ih)]]


class ForgetfulAgent(UniversalAgent):
    def __init__(self, width, layers):
        super().__init__(width, layers)
        self.memory = Layer(width)


class Sum(nn.Module):
    """VDN; over M, since rewards are too."""

    def forward(self, values, hidden, present):
        return (values * present).sum(dim=1) / values.shape[1]


@dataclass(frozen=True)
class Variant:
    """What differs from the full learner."""

    demonstrations: bool = True
    turns: bool = True
    mixer: bool = True
    memory: bool = True
    muon: bool = True


VARIANTS = {
    "full": Variant(),
    "Adam": Variant(muon=False),
    "no demonstrations": Variant(demonstrations=False),
    "no turns": Variant(turns=False),
    "VDN": Variant(mixer=False),
    "no memory": Variant(memory=False),
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
    path = folder / f"demonstrations-{count}.npz"
    if not path.exists():
        shard = Shard(M, N, problems_of(count), MOVES[count])
        shown = demonstrate(shard, np.random.default_rng(count))
        partial = path.with_suffix(".part")
        with partial.open("wb") as file:
            np.savez(file, plans=shown.plans, rewards=shown.rewards, **shown.arrays._asdict())
        partial.rename(path)
    return path


class Clock:
    """Share of a training's processor time that is over, and of the learning rate at this moment."""

    def __init__(self, seconds):
        self._seconds, self._start, self.updates = seconds, time.process_time(), 0

    @property
    def share(self):
        return (time.process_time() - self._start) / self._seconds

    def share_of_lr(self):
        self.updates += 1
        return min(1.0, self.updates / WARM_UP) * (0.5 + 0.5 * float(np.cos(np.pi * min(1.0, self.share))))


def train(name, seed, seconds, shown):
    """Train a variant of the networks for every size; return the agent and the number of updates."""
    variant = VARIANTS[name]
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        agent = (UniversalAgent if variant.memory else ForgetfulAgent)(CONFIG.width, CONFIG.layers)
        mixer = UniversalMixer(CONFIG.width, CONFIG.qmix_hidden_dim) if variant.mixer else Sum()
    lr, optimisers = (MUON_LR, muon) if variant.muon else (LR, adam)
    learner = Learner(agent, mixer, lr=lr, td_weight=TD_WEIGHT, optimisers=optimisers)
    every, clock = np.arange(EPISODES), Clock(seconds)
    while clock.share < 1:
        rng = np.random.default_rng([seed, clock.updates])
        chosen = rng.choice(LEARNED, EPISODES, replace=False)
        arrays = ProblemArrays(**{key: column[chosen] for key, column in shown.arrays._asdict().items()})
        own = not variant.demonstrations or clock.updates % OWN_EVERY == OWN_EVERY - 1
        roll_out, replay = (play, replay_turns) if variant.turns else (play_at_once, replay_turns_at_once)
        plans = roll_out(agent, arrays, every, rng).plans if own else shown.plans[chosen]
        bootstrap = not variant.demonstrations or clock.updates % TD_EVERY == TD_EVERY - 1
        batch = make_batch(arrays, replay(arrays, every, plans), torch.device("cpu"))
        learner.update(batch, clock.share_of_lr(), imitate=not own, bootstrap=bootstrap)
    return agent, clock.updates


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
    problems, steps = problems_of(LEARNED), shown.plans.shape[1]
    sizes = SwarmEnvironment(problems[0]).sizes
    states = np.zeros((steps, LEARNED, sizes.state_features), np.float32)
    allowed = np.zeros((steps, LEARNED, M, N + 1), np.bool_)
    actions = np.full((steps, LEARNED, M), N, np.int64)
    rewards = np.zeros((steps, LEARNED), np.float32)
    terminated, filled = np.zeros((2, steps, LEARNED), np.bool_)
    draws = np.ones((M, 2))
    for index, problem in enumerate(problems):
        environment, level = SwarmEnvironment(problem), max(t.level for t in problem.targets)
        environment.reset()
        step = 0
        while not environment.done:
            environment.observe(states[step, index], allowed[step, index])
            wanted = np.eye(N + 1, dtype=np.float32)[shown.plans[index, step]]
            earned = environment.step(wanted, draws, 0.0, actions[step, index])
            rewards[step, index] = earned / level / M
            filled[step, index] = True
            step += 1
        terminated[step - 1, index] = True
    return PaperBatch(*map(torch.from_numpy, (states, allowed, actions, rewards, terminated, filled)))


@lru_cache(maxsize=2)
def read(path):
    return read_shard(path)


def run(name, seed, seconds, folder):
    """Greedy ratio of a variant on the problems that are tried, its spread over them, and its updates."""
    torch.set_num_threads(1)
    shown, tried = (read(searched(folder, count)) for count in (LEARNED, TRIED))
    if name == PAPER:
        network, updates = train_paper(seed, seconds, shown)
        problems = problems_of(TRIED)
        rewards = np.array(
            [Actor(SwarmEnvironment(each), network).play_greedily().reward for each in problems]
        )
    else:
        if not VARIANTS[name].turns:
            compile_at_once(tried)
        agent, updates = train(name, seed, seconds, shown)
        roll_out = play if VARIANTS[name].turns else play_at_once
        rewards = roll_out(agent, tried.arrays, np.arange(TRIED)).rewards
    ratios = rewards / tried.rewards
    return {"ratio": float(ratios.mean()), "spread": float(ratios.std()), "updates": updates}


def compile_at_once(tried):
    """Compile what is not kept on disk, before the clock starts."""
    few = ProblemArrays(**{key: column[:1] for key, column in tried.arrays._asdict().items()})
    play_at_once(UniversalAgent(8, 1), few, np.zeros(1, np.int64))
    replay_turns_at_once(few, np.zeros(1, np.int64), tried.plans[:1])


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
    rule = [reward_of(each, greedy_plan(each)) for each in problems_of(TRIED)] / tried.rewards
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
