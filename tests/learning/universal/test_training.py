"""Fitting the policy for every size: what it learns, and that seeds decide everything, stopped or not."""

from contextlib import suppress

import numpy as np
import pytest
import torch

from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.universal.training import trainer
from app.learning.universal.training.demonstrations import Demonstration, demonstrate, with_return
from app.learning.universal.training.trainer import Material, Schedule, fit, trained, updates_done
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan

SMALL = PairwiseConfig(width=16, layers=1, qmix_hidden_dim=4)
"""Wide enough for both of the optimisers."""
UPDATES = 24
CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def shown():
    """Searched plans of a few small problems of two sizes."""
    rng = np.random.default_rng(1)
    problems = [generate("uniform", *size, 2, rng) for size in [(3, 5), (6, 9)] * 4]
    return [demonstrate(problem, 2000, rng) for problem in problems]


def neighbours(rng):
    """Every UAV has what one area needs, all areas another material; each visits its own, and the best plan
    is to do so."""
    m = 4
    needs, places, own = np.eye(m), rng.random((m, 2)), rng.permutation(m)
    problem = Problem(
        uavs=tuple(
            UAV(f"u{i}", *(2 * [0.5, 0.5]), 1.0, 4.0, tuple(needs[own[i]].tolist())) for i in range(m)
        ),
        targets=tuple(Target(f"a{j}", *places[j].tolist(), 5.0, tuple(needs[j].tolist())) for j in range(m)),
        objective=Objective(distance_weight=0.1),
        max_steps=3,
    )
    plan = Plan((tuple(own.tolist()),))
    return Demonstration(problem, with_return(plan, problem), reward_of(problem, plan))


def played(policy, each):
    return policy.play(compile_problem(each.problem), np.zeros(1, np.int64)).rewards[0]


def test_policy_learns_what_is_shown(tmp_path):
    rng = np.random.default_rng(2)
    shown, fresh = ([neighbours(rng) for _ in range(count)] for count in (30, 12))
    policy = PairwisePolicy.of_seed(SMALL, 3)
    before = [played(policy, each) for each in fresh]
    told = []
    fit(
        policy,
        shown,
        Schedule(60, lr=2e-2, seed=5),
        tmp_path / "state",
        watch=lambda *said: told.append(said),
    )
    assert [update for update, _ in told] == list(range(1, 61))
    assert told[-1][1]["imitation"] < 0.7 * told[0][1]["imitation"]
    best = [each.reward for each in fresh]
    assert [played(policy, each) for each in fresh] == pytest.approx(best)
    assert np.mean(before) < 0.9 * np.mean(best), "nothing was to be learned"


def train(shown, state, stopped=UPDATES, **part):
    """Train by a schedule; stopped as a machine that goes down stops it."""

    class Down(Exception):
        pass

    def watch(update, _losses):
        if update == stopped < UPDATES:
            raise Down

    with suppress(Down):
        fit(PairwisePolicy.of_seed(SMALL, 3), shown, Schedule(UPDATES, seed=5), state, watch=watch, **part)


def test_training_resumes_to_the_same_bytes(shown, tmp_path, monkeypatch):
    monkeypatch.setattr(trainer, "SAVE_EVERY", 5)
    whole, pieces, first, second = (tmp_path / name for name in ("whole", "pieces", "first", "second"))
    train(shown, whole)
    for stopped in (3, 8, 19):
        train(shown, pieces, stopped)
        assert updates_done(pieces) == stopped // 5 * 5
    train(shown, pieces)
    train(shown, first, until=13)
    assert updates_done(first) == 13
    train(shown, second, before=first)
    assert whole.read_bytes() == pieces.read_bytes() == second.read_bytes() != first.read_bytes()


def test_policy_of_a_state_is_the_one_that_was_trained(shown, tmp_path):
    policy = PairwisePolicy.of_seed(SMALL, 3)
    fit(policy, shown, Schedule(6, seed=5), tmp_path / "state")
    again = trained(tmp_path / "state", SMALL)
    assert all(torch.equal(a, b) for a, b in zip(again.parameters(), policy.parameters(), strict=True))
    untrained = PairwisePolicy.of_seed(SMALL, 3)
    weights = zip(untrained.agent.layers.parameters(), again.agent.layers.parameters(), strict=True)
    assert not any(torch.equal(a, b) for a, b in weights)


def test_td_loss_is_learned_every_fourth_update_and_only_where_it_has_a_weight(shown):
    material = Material(shown, CPU)
    episodes = [material.of_update(Schedule(8), update)[1] for update in range(8)]
    assert [each is not None for each in episodes] == 2 * [False, False, False, True]
    assert material.of_update(Schedule(8, td_weight=0.0), 3)[1] is None


def test_whole_episodes_are_of_small_problems_with_their_rewards(shown):
    large = demonstrate(
        generate("uniform", 14, 20, 2, np.random.default_rng(3)), 2000, np.random.default_rng(3)
    )
    assert Material([large], CPU).decisions(np.random.default_rng(0)) is None
    decisions = Material([large, *shown], CPU).decisions(np.random.default_rng(0))
    assert decisions.batch.sight.uavs.shape[1] <= 6
    shares = sorted(each.reward / sum(t.level for t in each.problem.targets if any(t.need)) for each in shown)
    assert sorted(decisions.reward.sum(dim=1).tolist()) == pytest.approx(shares, abs=1e-5)


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


def test_batch_has_problems_of_about_one_size(shown, monkeypatch):
    # No more states than those of one size have.
    monkeypatch.setattr(trainer, "BATCH_PAIRS", 150)
    sizes = set()
    for seed in range(6):
        sight, action = Material(shown, CPU).batch(np.random.default_rng(seed))
        sizes.add((sight.uavs.shape[1], sight.areas.shape[1]))
        assert sight.present.all()
        assert (action.amax(dim=1) >= 0).all()
    assert sizes == {(3, 5), (6, 9)}


def test_of_a_large_problem_there_are_few_states():
    problem = generate("uniform", 100, 300, 3, np.random.default_rng(4))
    plan = greedy_plan(problem)
    shown = Demonstration(problem, with_return(plan, problem), reward_of(problem, plan))
    batch = Material([shown], CPU).batch(np.random.default_rng(0))
    assert 1 <= len(batch.action) <= 2


def test_only_what_comes_after_the_first_step_is_learned(shown, monkeypatch):
    each = max(shown, key=lambda each: len(each.plan))
    last = len(each.plan) - 1
    monkeypatch.setattr(trainer, "BATCH_PAIRS", 10_000)
    rng = np.random.default_rng(0)
    actions = Material([each._replace(first=last)], CPU).batch(rng).action
    known = actions[actions >= 0]
    assert (known == each.problem.n_targets).all(), "the last row sends everybody home"
    everywhere = Material([each], CPU).batch(rng).action
    assert ((everywhere >= 0) & (everywhere < each.problem.n_targets)).any()
