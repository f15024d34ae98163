import copy

import numpy as np
import pytest
import torch
from stopping import at_once

from app.learning.paper import learner as learner_module
from app.learning.paper.learner import Learner
from app.learning.paper.replay_buffer import Batch

GAMMA = 0.9


def one_episode(batch: Batch, b: int) -> Batch:
    length = int(batch.filled[:, b].sum())
    return Batch(*(tensor[:length, b : b + 1] for tensor in batch))


def targets_written_out(learner, batch):
    """Eq. 5 for one episode without padding, one step at a time."""
    values = learner.target.unroll(batch.states, batch.actions)
    steps = len(batch.states)
    targets = torch.zeros(steps)
    for t in range(steps):
        targets[t] = batch.rewards[t, 0]
        if t + 1 < steps:
            best = torch.stack(
                [
                    max(
                        values[t + 1, 0, i, a]
                        for a in range(values.shape[-1])
                        if batch.allowed[t + 1, 0, i, a]
                    )
                    for i in range(values.shape[2])
                ]
            )
            targets[t] += GAMMA * learner.target.mix(best, batch.states[t + 1, 0])
    return targets


@pytest.fixture
def moved_learner(learner, batch):
    """A learner whose network and target network differ."""
    for _ in range(5):
        learner.update(batch)
    return learner


def test_targets_are_eq_5_of_the_next_step(moved_learner, batch):
    """Trap: bootstrapping off by one step."""
    targets = moved_learner.targets(batch)
    for b in range(batch.rewards.shape[1]):
        alone = one_episode(batch, b)
        expected = targets_written_out(moved_learner, alone)
        torch.testing.assert_close(targets[: len(expected), b], expected, rtol=1e-4, atol=1e-4)


def test_last_step_of_an_episode_is_terminal_also_at_the_step_limit(learner, batch):
    targets = learner.targets(batch)
    assert batch.terminated[-1].any(), "episodes that end at the step limit"
    assert torch.equal(targets[batch.terminated], batch.rewards[batch.terminated])


def test_next_value_is_a_maximum_over_allowed_actions_only(moved_learner, batch):
    """Trap: the mask missing on the next observation."""
    before = moved_learner.targets(batch)
    forbidden = [
        a for a in range(batch.allowed.shape[-1]) if not batch.allowed[1:][batch.filled[1:]][:, :, a].any()
    ]
    with torch.no_grad():
        if not forbidden:  # forbid one everywhere
            forbidden = [0]
            batch.allowed[..., 0] = False
            before = moved_learner.targets(batch)
        for a in forbidden:
            moved_learner.target.agent.fc2.bias[a] += 1e6
    assert torch.equal(moved_learner.targets(batch), before)
    with torch.no_grad():
        moved_learner.target.agent.fc2.bias[-1] += 100.0  # "return" is always allowed
    assert not torch.allclose(moved_learner.targets(batch), before)


def test_target_network_values_the_next_step_until_it_is_copied(learner, batch):
    before = learner.targets(batch)
    for _ in range(5):
        learner.update(batch)
    assert torch.equal(learner.targets(batch), before), "updates do not move the targets"
    learner.update_target()
    assert not torch.allclose(learner.targets(batch), before)
    network, target = learner.network.state_dict(), learner.target.state_dict()
    assert all(torch.equal(network[name], target[name]) for name in network)


def test_loss_is_the_mean_over_the_steps_that_were_played(moved_learner, batch):
    """Trap: padded steps reach the loss."""
    total, steps = 0.0, 0
    for b in range(batch.rewards.shape[1]):
        alone = one_episode(batch, b)
        total += moved_learner.loss(alone).item() * len(alone.rewards)
        steps += len(alone.rewards)
    assert moved_learner.loss(batch).item() == pytest.approx(total / steps, rel=1e-4)


def test_padding_changes_neither_loss_nor_gradient(moved_learner, batch):
    """Trap: padded steps reach the loss."""
    padding = ~batch.filled
    spoiled = Batch(*(tensor.clone() for tensor in batch))
    spoiled.states[padding] = 7.0
    spoiled.rewards[padding] = -1e3
    spoiled.actions[padding] = 1
    spoiled.allowed[padding] = False
    gradients = []
    for each in (batch, spoiled):
        loss = moved_learner.loss(each)
        gradients.append([loss.detach(), *torch.autograd.grad(loss, moved_learner.network.parameters())])
    for clean, dirty in zip(*gradients, strict=True):
        torch.testing.assert_close(dirty, clean, rtol=1e-4, atol=1e-6)


def test_agents_that_may_only_return_have_finite_targets(learner, batch):
    """Trap: agents without a valid action; the environment always leaves them "return"."""
    batch.allowed[..., :-1] = False
    batch.allowed[..., -1] = True
    assert learner.targets(batch).isfinite().all()
    learner.update(batch)
    assert all(parameter.isfinite().all() for parameter in learner.network.parameters())


def test_every_parameter_of_agent_and_mixer_is_trained(learner, batch):
    """Trap: the mixer's parameters left out of the optimiser."""
    before = copy.deepcopy(learner.network.state_dict())
    learner.update(batch)
    after = learner.network.state_dict()
    assert {name.split(".")[0] for name in after} == {"agent", "mixer"}
    unmoved = [name for name in after if torch.equal(before[name], after[name])]
    assert unmoved == []


def test_update_is_rmsprop_on_the_clipped_gradient(network, batch):
    reference = copy.deepcopy(network)
    learner = Learner(network, lr=1e-3, gamma=GAMMA, grad_norm_clip=0.01)
    Learner(reference, 1e-3, GAMMA, 0.01).loss(batch).backward()
    gradients = [parameter.grad for parameter in reference.parameters()]
    norm = torch.sqrt(sum(gradient.square().sum() for gradient in gradients))
    assert norm > 0.01
    learner.update(batch)
    for parameter, start, gradient in zip(
        network.parameters(), reference.parameters(), gradients, strict=True
    ):
        clipped = gradient * 0.01 / norm
        expected = start - 1e-3 * clipped / (torch.sqrt(0.01 * clipped.square()) + 1e-8)
        torch.testing.assert_close(parameter, expected, rtol=1e-4, atol=1e-5)


def test_rewards_beyond_single_precision_leave_finite_weights(learner, batch):
    batch.rewards[0, 0] = 1e30
    learner.update(batch)
    assert all(parameter.isfinite().all() for parameter in learner.network.parameters())


def test_targets_approach_returns_when_nothing_follows(network, batch):
    """With discount 0 the network learns the rewards of single steps of a fixed batch."""
    learner = Learner(network, lr=2e-3, gamma=0.0, grad_norm_clip=10.0)
    before = learner.loss(batch).item()
    for _ in range(300):
        learner.update(batch)
    assert learner.loss(batch).item() < 0.05 * before


def test_sampling_is_all_that_updates_draw(learner, buffer):
    state = torch.get_rng_state()
    learner.update(buffer.sample(8, np.random.default_rng(0)))
    assert torch.equal(torch.get_rng_state(), state)


def test_a_batch_in_parts_has_the_gradient_of_the_whole(network, batch, monkeypatch):
    gradients = []
    for work in (10**9, 1):
        monkeypatch.setattr(learner_module, "_WORK_A_PART", work)
        learner = Learner(copy.deepcopy(network), 1e-3, GAMMA, 1e9)
        assert learner.update(batch)
        gradients.append([each.grad for each in learner.network.parameters()])
    for whole, parts in zip(*gradients, strict=True):
        torch.testing.assert_close(parts, whole, rtol=1e-3, atol=1e-6)


def test_an_update_that_is_stopped_between_parts_changes_nothing(learner, batch, monkeypatch):
    monkeypatch.setattr(learner_module, "_WORK_A_PART", 1)
    before = [parameter.detach().clone() for parameter in learner.network.parameters()]
    assert not learner.update(batch, at_once())
    assert learner.updates == 0
    for parameter, old in zip(learner.network.parameters(), before, strict=True):
        assert torch.equal(parameter, old)
