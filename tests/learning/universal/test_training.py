"""Demonstrations and the training loop: reproducible from seeds, resumable at any update."""

from contextlib import suppress

import numpy as np
import pytest
import torch
from numba import typeof
from referee import replay

from app.domain.records import problem_to_record
from app.learning.universal.episodes.policy import UniversalPolicy, initial
from app.learning.universal.network.architecture import UniversalConfig
from app.learning.universal.training import trainer
from app.learning.universal.training.curriculum import SHAPES, Shard, draw_shard
from app.learning.universal.training.demonstrations import Series, demonstrate, read_shard, write_shard
from app.learning.universal.training.trainer import Schedule, fit
from app.simulation import visit
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.simulation.replay import replay as replayed
from app.solvers.greedy import greedy_plan

SMALL = UniversalConfig(width=16, layers=1, qmix_hidden_dim=4)
"""Wide enough for both of the optimisers."""
SERIES = Series("some", (4,), ("uniform", "scarce"))


@pytest.fixture(scope="module")
def shards(tmp_path_factory):
    """Two small files of demonstrations."""
    folder = tmp_path_factory.mktemp("shards")
    paths = []
    for number in range(2):
        rng = np.random.default_rng(number)
        problems = [generate("uniform", 3, 5, 2, rng) for _ in range(5)]
        shown = demonstrate(Shard(3, 5, problems, moves=2000), rng)
        path = folder / f"{number}.npz"
        np.savez(path, plans=shown.plans, rewards=shown.rewards, **shown.arrays._asdict())
        paths.append(path)
    return paths


def train(shards, state, updates):
    """Train up to an update of a schedule of 40; stopped as a machine that goes down stops it."""

    class Down(Exception):
        pass

    def watch(update, _means):
        if update == updates and updates < 40:
            raise Down

    agent, mixer = initial(SMALL, 3)
    with suppress(Down):
        fit(agent, mixer, shards, Schedule(40, seed=5), state, watch)
    return agent, mixer


def test_training_resumes_to_the_same_weights(shards, tmp_path, monkeypatch):
    monkeypatch.setattr(trainer, "SAVE_EVERY", 10)
    agent, mixer = train(shards, tmp_path / "whole.safetensors", 40)
    for stopped in (7, 23, 36):
        train(shards, tmp_path / "pieces.safetensors", stopped)
    again, again_mixer = train(shards, tmp_path / "pieces.safetensors", 40)
    for one, two in ((agent, again), (mixer, again_mixer)):
        for a, b in zip(one.parameters(), two.parameters(), strict=True):
            assert torch.equal(a, b)
    policy = UniversalPolicy.of_training(tmp_path / "whole.safetensors", SMALL)
    assert all(torch.equal(a, b) for a, b in zip(policy.agent.parameters(), agent.parameters(), strict=True))


def test_training_changes_the_policy_and_lowers_the_losses(shards, tmp_path):
    told = []
    agent, mixer = initial(SMALL, 3)
    start = [p.clone() for p in agent.parameters()]
    fit(
        agent,
        mixer,
        shards,
        Schedule(60, lr=2e-2, seed=5),
        tmp_path / "s",
        lambda n, means: told.append(dict(means)),
    )
    assert len(told) == 60
    assert told[-1]["imitation"] < 0.9 * told[0]["imitation"]
    assert not any(torch.equal(a, b) for a, b in zip(agent.parameters(), start, strict=True))


def test_learning_rate_rises_and_falls():
    schedule = Schedule(6000)
    shares = [schedule.share_of_lr(update) for update in range(6000)]
    assert shares[0] < 0.01
    assert max(shares) > 0.99
    assert shares.index(max(shares)) == 199
    assert shares[-1] < 1e-4
    short = [Schedule(50).share_of_lr(update) for update in range(50)]
    assert short.index(max(short)) == 4
    assert max(short) > 0.97


def test_shard_is_decided_by_seed_and_number(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "app.learning.universal.training.demonstrations.draw_shard",
        lambda rng, families: Shard(2, 4, [generate("uniform", 2, 4, 2, rng) for _ in range(3)], moves=500),
    )
    first, second = tmp_path / "a", tmp_path / "b"
    for folder in (first, second):
        folder.mkdir()
    one, two = (read_shard(write_shard(folder, SERIES, 7, 1)) for folder in (first, second))
    assert np.array_equal(one.plans, two.plans)
    assert all(np.array_equal(a, b) for a, b in zip(one.arrays, two.arrays, strict=True))
    # Of another type, all that is compiled would be compiled again.
    assert typeof(one.arrays) == typeof(
        compile_problem(generate("uniform", 2, 4, 2, np.random.default_rng(0)))
    )
    other = read_shard(write_shard(first, SERIES, 7, 2))
    assert not np.array_equal(one.arrays.load, other.arrays.load)
    path = write_shard(first, SERIES, 7, 1)
    written = path.stat().st_mtime_ns
    assert write_shard(first, SERIES, 7, 1).stat().st_mtime_ns == written


def test_drawn_shards_have_the_listed_shapes():
    rng = np.random.default_rng(9)
    for _ in range(20):
        shard = draw_shard(rng)
        assert (shard.n_uavs, shard.n_targets) in [(m, n) for m, n, _ in SHAPES]
        assert {(p.n_uavs, p.n_targets) for p in shard.problems} == {(shard.n_uavs, shard.n_targets)}
        assert all(1 <= p.max_steps <= 7 for p in shard.problems)


@pytest.mark.parametrize("agent", [None, initial(SMALL, 1)[0]], ids=["from greedy", "from a policy"])
def test_demonstrations_are_legal_and_better_than_greedy(agent):
    rng = np.random.default_rng(10)
    problems = [generate("single_base", 5, 8, 2, rng) for _ in range(4)]
    shown = demonstrate(Shard(5, 8, problems, moves=20_000), rng, agent)
    gained = 0.0
    for problem, plan, reward in zip(problems, shown.plans, shown.rewards, strict=True):
        record = problem_to_record(problem)
        assert replay(record, plan[: problem.max_steps].tolist())["reward"] == pytest.approx(reward)
        greedy = replay(record, greedy_plan(problem).as_array().tolist())["reward"]
        assert reward >= greedy - 1e-9
        gained += reward - greedy
    assert gained > 0.1


def test_demonstrations_in_another_order_of_uavs_earn_the_same():
    rng = np.random.default_rng(11)
    problems = [generate("mixed_loads", 4, 9, 2, rng) for _ in range(6)]
    shown = demonstrate(Shard(4, 9, problems, moves=20_000), rng)
    arrays, plans = trainer._in_random_order(shown.arrays, shown.plans, rng)
    again = replayed(arrays, plans, np.arange(6))
    assert (again.rule == visit.ALLOWED).all()
    assert np.abs(again.reward - shown.rewards).max() < 1e-9
    assert not np.array_equal(plans, shown.plans)


def test_of_large_episodes_some_uavs_are_learned_from(monkeypatch, shards):
    monkeypatch.setattr(trainer, "TURN_TOKENS", 12)
    _, batch, whole = trainer._demonstrated(shards, 0, 0, torch.device("cpu"))
    assert not whole
    assert len(batch.uav.unique()) == 1
    monkeypatch.setattr(trainer, "TURN_TOKENS", 20_000)
    _, batch, whole = trainer._demonstrated(shards, 0, 0, torch.device("cpu"))
    assert whole
    assert len(batch.uav.unique()) == 3
