"""What roll-outs ask is the network that was trained."""

import numpy as np
import pytest
import torch

from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.network.architecture import (
    OWN_FEATURES,
    PAIR_FEATURES,
    RIVAL_FEATURES,
    UniversalConfig,
)
from app.learning.universal.network.inference import ask, ask_together, attention_bias, compile_agent


@pytest.mark.parametrize(
    ("width", "layers", "turns", "targets", "uavs"),
    [(64, 2, 8, 20, 10), (64, 2, 3, 11, 1), (4, 1, 2, 1, 3), (12, 3, 1, 2, 2), (20, 2, 2, 70, 5)],
)
def test_it_is_the_agent(width, layers, turns, targets, uavs):
    agent = UniversalPolicy.of_seed(UniversalConfig(width, layers, 8), seed=5).agent
    rng = np.random.default_rng(width + targets)
    pair, own, rivals, distance, hidden = (
        rng.random(shape, np.float32) - offset
        for shape, offset in (
            ((turns, targets, PAIR_FEATURES), 0.5),
            ((turns, OWN_FEATURES), 0.5),
            ((turns, targets, uavs, RIVAL_FEATURES), 0.5),
            ((2, targets, targets), 0.0),
            ((turns, width), 0.5),
        )
    )
    problem = rng.integers(2, size=turns)
    with torch.inference_mode():
        for parameter in agent.parameters():
            parameter.add_(torch.from_numpy(rng.normal(size=parameter.shape, scale=0.1).astype(np.float32)))
        biases = agent.bias(torch.from_numpy(distance))
        tokens = agent.encode(*map(torch.from_numpy, (pair, own, rivals)), biases[problem])
        remembered = agent.remember(tokens, torch.from_numpy(hidden))
        values = agent.values(tokens, remembered).numpy()

    found = np.full((turns, targets + 1), np.nan, np.float32)
    after = hidden.copy()
    asked = (compile_agent(agent), pair, own, rivals, attention_bias(agent, distance), problem)
    ask(*asked, after, found)

    np.testing.assert_allclose(after, remembered.numpy(), atol=2e-5)
    np.testing.assert_allclose(found, values, rtol=1e-4, atol=1e-4 * np.abs(values).max())

    together, threaded = np.empty_like(found), hidden.copy()
    ask_together(*asked, threaded, together, spare=3)
    assert together.tobytes() == found.tobytes()
    assert threaded.tobytes() == after.tobytes()
