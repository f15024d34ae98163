"""The learner: targets by hand, a handful of demonstrations learned by heart, targets that follow slowly."""

import copy

import numpy as np
import pytest
import torch
from stopping import After

from app.learning.universal.episodes.rollout import play
from app.learning.universal.episodes.turns import replay_turns
from app.learning.universal.training.curriculum import Shard
from app.learning.universal.training.demonstrations import demonstrate
from app.learning.universal.updates.learner import Learner, evaluate, joint_values, lambda_returns, make_batch
from app.simulation.generator import generate


@pytest.fixture(scope="module")
def shown():
    rng = np.random.default_rng(8)
    problems = [generate("uniform", 3, 5, 2, rng) for _ in range(3)]
    return demonstrate(Shard(3, 5, problems, moves=5000), rng)


@pytest.fixture(scope="module")
def batch(shown):
    turns = replay_turns(shown.arrays, np.arange(len(shown.rewards)), shown.plans)
    return make_batch(shown.arrays, turns, torch.device("cpu"))


def test_lambda_returns_by_hand():
    reward = torch.tensor([[1.0, 2.0, 4.0], [3.0, 0.0, 0.0]])
    following = torch.tensor([[10.0, 20.0, 40.0], [5.0, 7.0, 9.0]])
    running = torch.tensor([[1.0, 1.0, 1.0], [1.0, 0.0, 0.0]])

    found = lambda_returns(reward, following, running, gamma=0.5, td_lambda=0.25)

    last = 4.0
    middle = 2 + 0.5 * (0.75 * 40 + 0.25 * last)
    first = 1 + 0.5 * (0.75 * 20 + 0.25 * middle)
    assert found[0].tolist() == [first, middle, last]
    assert found[1, 0] == 3.0, "after its end an episode is worth nothing"


def test_lambda_one_is_the_discounted_sum():
    reward = torch.rand(4, 5, generator=torch.Generator().manual_seed(1))
    found = lambda_returns(reward, torch.full((4, 5), 99.0), torch.ones(4, 5), 0.9, 1.0)
    expected = sum(0.9**s * reward[:, s] for s in range(5))
    assert torch.allclose(found[:, 0], expected)


def test_demonstrations_are_learned_by_heart(make_policy, shown, batch):
    policy = make_policy(1)
    learner = Learner(policy.agent, policy.mixer, lr=1e-2, td_weight=0.2)
    losses = [learner.update(batch, 1.0, imitate=True, bootstrap=u % 2 == 0) for u in range(200)]
    played = play(policy.agent, shown.arrays, np.arange(len(shown.rewards)))
    assert losses[0]["imitation"] > 0.8
    assert losses[-2]["imitation"] < 0.15
    assert losses[-2]["td"] < 0.2 * losses[0]["td"]
    assert np.mean(played.rewards / shown.rewards) > 0.97


def test_values_are_those_of_the_games_that_were_played(make_policy, shown, batch):
    """Without bootstrapping ahead of it, Q_tot of the last step of an episode becomes what it earns."""
    policy = make_policy(2)
    learner = Learner(policy.agent, policy.mixer, lr=5e-3, td_weight=1.0, td_lambda=1.0)
    for _ in range(200):
        learner.update(batch, 1.0, imitate=False, bootstrap=True)
    with torch.inference_mode():
        online = evaluate(policy.agent, batch)
        chosen = online.values.gather(1, batch.action[:, None])[:, 0]
        joint, running = joint_values(batch, chosen, online.hidden, policy.mixer)
    returns = lambda_returns(batch.reward, joint, running, 0.99, 1.0)
    error = ((joint - returns) * running).square().sum() / running.sum()
    spread = returns[running > 0].var()
    assert error < 0.05 * spread


def test_targets_follow_slowly_and_are_not_trained(make_policy, batch):
    policy = make_policy(3)
    learner = Learner(policy.agent, policy.mixer, lr=1e-3, td_weight=0.2, polyak=0.1)
    before = [p.clone() for p in learner.target_agent.parameters()]
    learner.update(batch, 1.0, imitate=True, bootstrap=True)
    for slow, start, fast in zip(
        learner.target_agent.parameters(), before, policy.agent.parameters(), strict=True
    ):
        assert torch.allclose(slow, start + 0.1 * (fast - start), atol=1e-6)
        assert slow.grad is None


def test_every_weight_is_trained(make_policy, batch):
    policy = make_policy(4)
    before = {name: p.clone() for name, p in policy.named_parameters()}
    learner = Learner(policy.agent, policy.mixer, lr=1e-3, td_weight=0.2)
    for _ in range(2):
        learner.update(batch, 1.0, imitate=True, bootstrap=True)
    same = [name for name, p in policy.named_parameters() if torch.equal(p, before[name])]
    assert same == []


@pytest.mark.parametrize("asked", [1, 2, 3])
def test_an_update_that_is_stopped_changes_nothing(make_policy, batch, asked):
    policy = make_policy(5)
    learner = Learner(policy.agent, policy.mixer, lr=1e-2, td_weight=0.2)
    before = copy.deepcopy(learner.networks.state_dict())
    stop = After(asked - 1)
    assert learner.update(batch, 1.0, imitate=True, bootstrap=True, stop=stop) == {}
    after = learner.networks.state_dict()
    assert all(torch.equal(after[name], tensor) for name, tensor in before.items())
    assert stop.asked == asked, "it went on after it was told to stop"
