import numpy as np
import torch

from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import Actor, EpisodeRecord
from app.learning.paper.replay_buffer import ReplayBuffer

NO_DRAWS = 0.999


def test_next_states_are_those_after_the_actions(problem, batch):
    """Trap: the observation before the action is stored as the one after it."""
    environment = SwarmEnvironment(problem)
    sizes = environment.sizes
    state = np.zeros(sizes.state_features, np.float32)
    mask = np.zeros((sizes.n_agents, sizes.n_actions), np.bool_)
    for b in range(batch.states.shape[1]):
        environment.reset()
        for t in range(int(batch.filled[:, b].sum())):
            environment.observe(state, mask)
            assert np.array_equal(batch.states[t, b], state)
            assert np.array_equal(batch.allowed[t, b], mask)
            # Values that make the greedy choice the stored action.
            values = np.zeros(mask.shape, np.float32)
            values[np.arange(len(values)), batch.actions[t, b].numpy()] = 1.0
            taken = np.zeros(len(values), np.int64)
            reward = environment.step(values, np.full((len(values), 2), NO_DRAWS), 0.0, taken)
            assert np.array_equal(taken, batch.actions[t, b])
            assert np.float32(reward) == batch.rewards[t, b]
            assert environment.done == bool(batch.terminated[t, b])
        assert environment.done


def test_every_stored_action_was_allowed(batch):
    taken = batch.allowed.gather(-1, batch.actions.unsqueeze(-1)).squeeze(-1)
    assert taken[batch.filled].all()


def test_padding_has_a_valid_action_for_every_agent(batch):
    """Trap: an agent without a valid action, whose maximum is minus infinity."""
    assert not batch.filled.all()
    assert batch.allowed.any(dim=-1).all()
    padding = ~batch.filled
    assert not batch.states[padding].any()
    assert not batch.rewards[padding].any()
    assert not batch.terminated[padding].any()


def make_record(sizes, length, mark, steps=5):
    record = EpisodeRecord(sizes, steps)
    record.states[:], record.rewards[:] = mark, mark
    record.actions[:], record.allowed[:] = 1, True
    record.length = length
    return record


def test_oldest_episode_is_overwritten_and_leaves_nothing(problem):
    sizes = SwarmEnvironment(problem).sizes
    buffer = ReplayBuffer(3, sizes, 5)
    for mark, length in ((1, 5), (2, 5), (3, 5), (4, 2)):
        buffer.add(make_record(sizes, length, mark))
    assert len(buffer) == 3
    batch = buffer.sample(3, np.random.default_rng(0))
    assert sorted(batch.rewards[0].tolist()) == [2, 3, 4]
    newest = batch.rewards[0].tolist().index(4)
    assert batch.filled[:, newest].tolist() == [True, True, False, False, False]
    assert batch.terminated[:, newest].tolist() == [False, True, False, False, False]
    assert not batch.states[2:, newest].any(), "what the overwritten episode had there is gone"


def test_sample_draws_each_episode_at_most_once_and_no_longer_than_needed(problem):
    sizes = SwarmEnvironment(problem).sizes
    buffer = ReplayBuffer(10, sizes, 5)
    for mark in range(1, 5):
        buffer.add(make_record(sizes, 2, mark))
    batch = buffer.sample(32, np.random.default_rng(0))
    assert sorted(batch.rewards[0].tolist()) == [1, 2, 3, 4]
    assert batch.states.shape == (2, 4, sizes.state_features)
    seen = {int(buffer.sample(1, np.random.default_rng(seed)).rewards[0, 0]) for seed in range(60)}
    assert seen == {1, 2, 3, 4}


def test_size_is_what_it_says(problem):
    sizes = SwarmEnvironment(problem).sizes
    buffer = ReplayBuffer(7, sizes, 5)
    taken = sum(tensor.numel() * tensor.element_size() for tensor in buffer._episodes)
    assert taken == ReplayBuffer.bytes_needed(7, sizes, 5)


def test_record_belongs_to_the_actor_and_the_buffer_keeps_a_copy(problem, network):
    environment = SwarmEnvironment(problem)
    actor = Actor(environment, network)
    buffer = ReplayBuffer(2, environment.sizes, environment.max_steps)
    record = actor.play_greedily()
    buffer.add(record)
    before = buffer.sample(1, np.random.default_rng(0)).states.clone()
    record.states[:] = -1
    assert torch.equal(buffer.sample(1, np.random.default_rng(0)).states, before)
