"""What roll-outs ask is the network that was trained."""

import numpy as np
import pytest
import torch

from app.learning.compute.kernels import Float32s
from app.learning.pairwise.agent import Sight
from app.learning.pairwise.architecture import HEADS, PairwiseConfig
from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)
from app.learning.pairwise.inference import ask, compile_agent, place_bias
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.pairwise.rollout import _ask_together
from app.learning.pairwise.seen import Seen


def any_sight(rng: np.random.Generator, states: int, m: int, n: int, d: int) -> tuple[Seen, Float32s]:
    """States that no problem has, of every size; a third of the pairs are allowed, and two places are one."""
    kinds = (UavFeature, AreaFeature, BaseFeature, VisitFeature, ReloadFeature)
    shapes = ((m,), (n,), (d,), (m, n), (m, d))
    seen = Seen(
        *(
            rng.normal(size=(states, *shape, len(kind))).astype(np.float32)
            for shape, kind in zip(shapes, kinds, strict=True)
        )
    )
    for pairs in (seen.visits, seen.reloads):
        pairs[..., 0] = rng.random(pairs.shape[:-1]) < 0.35
    distance = rng.random((2, n + d, n + d), np.float32)
    distance[:, 0, -1] = 0.0
    return seen, distance


def torch_values(policy: PairwisePolicy, seen: Seen, distance: Float32s) -> Float32s:
    """Values by the module; minus infinity where an action is not allowed."""
    states, m = seen.uavs.shape[:2]
    present = torch.ones(states, m + distance.shape[1], dtype=torch.bool)
    with torch.no_grad():
        parts = (torch.from_numpy(each) for each in (*seen, distance))
        values, _ = policy.agent(Sight(*parts, present))
    n = seen.areas.shape[1]
    values[:, :, :n][torch.from_numpy(seen.visits[..., 0] == 0)] = -torch.inf
    values[:, :, n + 1 :][torch.from_numpy(seen.reloads[..., 0] == 0)] = -torch.inf
    return values.numpy()


@pytest.mark.parametrize("bases", [0, 1, 3])
@pytest.mark.parametrize(
    ("width", "layers", "states", "uavs", "areas"),
    [(64, 3, 4, 8, 15), (HEADS, 1, 2, 1, 1), (12, 2, 3, 1, 9), (20, 1, 2, 9, 1), (32, 2, 2, 3, 50)],
)
def test_it_is_the_module(width, layers, states, uavs, areas, bases):
    rng = np.random.default_rng(width + uavs + bases)
    policy = PairwisePolicy.of_seed(PairwiseConfig(width, layers, 8), seed=5)
    with torch.no_grad():
        for parameter in policy.parameters():
            parameter.add_(torch.from_numpy(rng.normal(size=parameter.shape, scale=0.1).astype(np.float32)))
    seen, distance = any_sight(rng, states, uavs, areas, bases)
    problem = rng.integers(2, size=states)
    expected = torch_values(policy, seen, distance[problem])

    biases, compiled = place_bias(policy.agent, distance), compile_agent(policy.agent)
    found = np.full(expected.shape, np.nan, np.float32)
    ask(compiled, seen, biases, problem, found)

    assert np.array_equal(np.isfinite(found), np.isfinite(expected))
    some = np.isfinite(expected)
    assert np.isfinite(found[:, :, areas]).all(), "to return is always allowed"
    np.testing.assert_allclose(
        found[some], expected[some], rtol=1e-4, atol=2e-4 * np.abs(expected[some]).max()
    )

    shared = np.empty_like(found)
    _ask_together(compiled, seen, biases, problem, shared, spare=3)
    assert shared.tobytes() == found.tobytes(), "by more threads"


def test_padding_is_not_seen_by_the_module(make_policy):
    """States of problems of many sizes are learned from in one batch: nobody attends to what is not there."""
    rng, policy = np.random.default_rng(9), make_policy()
    m, n, d, more = 3, 4, 2, (2, 3, 1)
    seen, distance = any_sight(rng, 2, m, n, d)
    alone = torch_values(policy, seen, distance)
    sizes = [(m, more[0]), (n, more[1]), (d, more[2])]
    grown = [sizes[:1], sizes[1:2], sizes[2:], sizes[:2], [sizes[0], sizes[2]]]
    padded = [
        np.pad(part, [(0, 0), *((0, extra) for _, extra in axes), (0, 0)])
        for part, axes in zip(seen, grown, strict=True)
    ]
    places = np.r_[0:n, n + more[1] : n + more[1] + d]
    wide = np.zeros((2, n + d + 4, n + d + 4), np.float32)
    wide[:, places[:, None], places] = distance
    present = np.zeros((2, m + n + d + 6), np.bool_)
    present[:, np.r_[0:m, m + 2 + places]] = True
    with torch.inference_mode():
        values, _ = policy.agent(Sight(*map(torch.from_numpy, (*padded, wide, present))))
    actions = np.r_[0:n, n + 3, n + 4 : n + 4 + d]
    found = values.numpy()[:, :m][:, :, actions]
    some = np.isfinite(alone)
    np.testing.assert_allclose(found[some], alone[some], rtol=1e-4, atol=1e-5 * np.abs(alone[some]).max())
