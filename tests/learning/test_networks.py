import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn.functional import elu, one_hot

from app.learning.paper.architecture import NetworkSizes, QmixConfig, expected_tensors
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import Actor
from app.learning.paper.mixer import Mixer
from app.learning.paper.networks import QmixNetwork

SIZES = NetworkSizes(n_agents=3, n_actions=4, own_features=5, common_features=7)


@pytest.fixture
def agent(make_network):
    return make_network(SIZES).agent


def random_episodes(steps, batch, seed=0):
    generator = torch.Generator().manual_seed(seed)
    states = torch.randn(steps, batch, SIZES.state_features, generator=generator)
    actions = torch.randint(SIZES.n_actions, (steps, batch, SIZES.n_agents), generator=generator)
    return states, actions


def written_out(agent, states, actions):
    """The agent network as the paper has it, one agent, one episode, one step at a time."""
    steps, batch, _ = states.shape
    values = torch.empty(steps, batch, SIZES.n_agents, SIZES.n_actions)
    for b in range(batch):
        for i in range(SIZES.n_agents):
            hidden = torch.zeros(agent.hidden_dim)
            last = torch.zeros(SIZES.n_actions)
            for t in range(steps):
                state = states[t, b]
                own = state[i * SIZES.own_features : (i + 1) * SIZES.own_features]
                common = state[SIZES.n_agents * SIZES.own_features :]
                who = one_hot(torch.tensor(i), SIZES.n_agents)
                hidden = agent.rnn(torch.relu(agent.fc1(torch.cat([own, common, last, who]))), hidden)
                values[t, b, i] = agent.fc2(hidden)
                last = one_hot(actions[t, b, i], SIZES.n_actions).float()
    return values


def test_agent_values_are_those_of_the_network_written_out(agent):
    states, actions = random_episodes(steps=4, batch=3)
    torch.testing.assert_close(
        agent.unroll(states, actions), written_out(agent, states, actions), rtol=1e-4, atol=1e-5
    )


def test_unrolling_is_stepping_with_the_hidden_state_handed_on(agent):
    states, actions = random_episodes(steps=4, batch=3)
    unrolled = agent.unroll(states, actions)
    hidden, last = None, None
    with torch.inference_mode():
        for t in range(4):
            values, hidden = agent.step(states[t], last, hidden)
            last = actions[t]
            torch.testing.assert_close(values, unrolled[t].detach(), rtol=1e-4, atol=1e-5)


def test_hidden_state_starts_from_zeros_in_every_episode(agent):
    """Trap: the hidden state of one episode reaches the next, or its neighbour in the batch."""
    states, actions = random_episodes(steps=4, batch=3)
    together = agent.unroll(states, actions)
    for b in range(3):
        alone = agent.unroll(states[:, b : b + 1], actions[:, b : b + 1])
        torch.testing.assert_close(together[:, b : b + 1], alone, rtol=1e-4, atol=1e-5)


def test_every_episode_of_an_actor_starts_from_zeros(problem, network):
    """Trap: the same between roll-outs; the values of each are those of its own episode unrolled."""
    environment, heard = SwarmEnvironment(problem), []
    step = environment.step

    def listening(values, draws, epsilon, actions):
        heard.append(values.copy())
        return step(values, draws, epsilon, actions)

    environment.step = listening
    actor = Actor(environment, network)
    for _ in range(3):
        heard.clear()
        record = actor.play_greedily()
        states = torch.from_numpy(record.states[: record.length]).unsqueeze(1)
        actions = torch.from_numpy(record.actions[: record.length]).unsqueeze(1)
        unrolled = network.unroll(states, actions)[:, 0].detach().numpy()
        assert record.length > 1
        np.testing.assert_allclose(np.array(heard), unrolled, rtol=1e-4, atol=1e-5)


def test_last_row_of_actions_is_not_read(agent):
    states, actions = random_episodes(steps=3, batch=2)
    other = actions.clone()
    other[-1] = (other[-1] + 1) % SIZES.n_actions
    assert torch.equal(agent.unroll(states, actions), agent.unroll(states, other))


def test_mixer_is_the_monotonic_network_written_out():
    mixer = Mixer(SIZES, 6, torch.Generator().manual_seed(1))
    generator = torch.Generator().manual_seed(2)
    values, states = (
        torch.randn(3, generator=generator),
        torch.randn(SIZES.state_features, generator=generator),
    )
    made = mixer.hypernetwork(states)
    w1, b1 = made[:18].reshape(3, 6).abs(), made[18:24]
    w2, b2 = made[24:30].abs(), mixer.value(torch.relu(made[30:]))[0]
    expected = elu(values @ w1 + b1) @ w2 + b2
    torch.testing.assert_close(mixer(values, states), expected)


@settings(max_examples=50)
@given(seed=st.integers(0, 2**32), scale=st.sampled_from([0.1, 1.0, 30.0]), data=st.data())
def test_mixer_never_falls_when_an_agents_value_rises(seed, scale, data):
    generator = torch.Generator().manual_seed(seed)
    mixer = Mixer(SIZES, 6, generator)
    with torch.no_grad():
        for parameter in mixer.parameters():
            parameter.mul_(scale)
    states = scale * torch.randn(20, SIZES.state_features, generator=generator)
    values = (scale * torch.randn(20, SIZES.n_agents, generator=generator)).requires_grad_()
    (gradient,) = torch.autograd.grad(mixer(values, states).sum(), values)
    assert (gradient >= 0).all()
    assert (gradient > 0).any(), "it depends on the agents at all"
    agent = data.draw(st.integers(0, SIZES.n_agents - 1))
    raised = values.detach().clone()
    raised[:, agent] += 1.0
    with torch.no_grad():
        before, after = mixer(values, states), mixer(raised, states)
    assert (after >= before - 1e-4 * before.abs().clamp(min=1.0)).all()


@settings(max_examples=20)
@given(
    m=st.integers(1, 6), n=st.integers(1, 8), k=st.integers(1, 4), h=st.integers(1, 20), e=st.integers(1, 20)
)
def test_architecture_lists_exactly_the_networks_tensors(m, n, k, h, e):
    config = QmixConfig(m, n, k, h, e)
    network = QmixNetwork(config.sizes, h, e)
    shapes = {name: (tuple(tensor.shape), "F32") for name, tensor in network.state_dict().items()}
    assert shapes == expected_tensors(config)


def test_initial_weights_come_from_the_generator_alone():
    torch_state, numpy_state = torch.get_rng_state(), np.random.get_state()[1].copy()
    first = QmixNetwork(SIZES, 8, 4, torch.Generator().manual_seed(5)).state_dict()
    second = QmixNetwork(SIZES, 8, 4, torch.Generator().manual_seed(5)).state_dict()
    other = QmixNetwork(SIZES, 8, 4, torch.Generator().manual_seed(6)).state_dict()
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert not any(torch.equal(first[name], other[name]) for name in first)
    bound = 1 / np.sqrt(SIZES.agent_inputs)
    assert 0.9 * bound < first["agent.fc1.weight"].abs().max() <= bound
    assert torch.equal(torch.get_rng_state(), torch_state)
    assert np.array_equal(np.random.get_state()[1], numpy_state)
