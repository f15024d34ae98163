"""The mixing network: monotonic, blind to numbering and to the number of agents."""

import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from app.learning.universal.network.mixer import UniversalMixer

WIDTH = 6


def make(seed, m, batch=3):
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        mixer = UniversalMixer(WIDTH, 5)
        values, hidden = torch.randn(batch, m), torch.randn(batch, m, WIDTH)
        present = torch.rand(batch, m) < 0.7
    return mixer, values, hidden, present


@settings(max_examples=60, derandomize=True)
@given(st.integers(0, 10_000), st.integers(1, 7), st.data())
def test_raising_a_value_never_lowers_the_joint_one(seed, m, data):
    mixer, values, hidden, present = make(seed, m)
    agent = data.draw(st.integers(0, m - 1))
    raised = values.clone()
    raised[:, agent] += data.draw(st.floats(0.1, 5))
    with torch.inference_mode():
        before, after = mixer(values, hidden, present), mixer(raised, hidden, present)
    assert (after >= before - 1e-6).all()
    present_now = present[:, agent]
    assert (after[present_now] > before[present_now]).all()
    assert torch.allclose(after[~present_now], before[~present_now])


@settings(max_examples=30, derandomize=True)
@given(st.integers(0, 10_000), st.integers(2, 7))
def test_numbering_of_agents_does_not_matter(seed, m):
    mixer, values, hidden, present = make(seed, m)
    order = torch.randperm(m, generator=torch.Generator().manual_seed(seed))
    with torch.inference_mode():
        expected = mixer(values, hidden, present)
        found = mixer(values[:, order], hidden[:, order], present[:, order])
    assert torch.allclose(found, expected, atol=1e-5)


@settings(max_examples=30, derandomize=True)
@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(2, 5))
def test_a_swarm_of_copies_is_worth_no_more(seed, m, copies):
    mixer, values, hidden, _ = make(seed, m)
    with torch.inference_mode():
        once = mixer(values, hidden, torch.ones(3, m, dtype=torch.bool))
        often = mixer(
            values.repeat(1, copies),
            hidden.repeat(1, copies, 1),
            torch.ones(3, m * copies, dtype=torch.bool),
        )
    assert torch.allclose(once, often, atol=1e-5)


def test_nobody_present_is_finite():
    mixer, values, hidden, _ = make(1, 4)
    assert mixer(values, hidden, torch.zeros(3, 4, dtype=torch.bool)).isfinite().all()
