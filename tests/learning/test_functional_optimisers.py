"""Weights step as torch's own optimisers step them."""

import pytest
import torch

from app.learning.compute.functional_optimisers import AdamW, RMSprop


def weights_after(make, seed, skip_one):
    torch.manual_seed(seed)
    network = torch.nn.Sequential(torch.nn.Linear(7, 5), torch.nn.Tanh(), torch.nn.Linear(5, 3))
    if skip_one:
        network[2].bias.requires_grad_(False)
    optimiser = make(network.parameters())
    for step in range(20):
        optimiser.param_groups[0]["lr"] = 0.01 / (1 + step)
        network.zero_grad()
        network(torch.randn(11, 7)).square().sum().backward()
        optimiser.step()
    return [each.detach().clone() for each in network.parameters()]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (lambda w: RMSprop(w, 0.01), lambda w: torch.optim.RMSprop(w, lr=0.01, foreach=True)),
        (lambda w: AdamW(w, 0.01, 0.1), lambda w: torch.optim.AdamW(w, lr=0.01, weight_decay=0.1)),
    ],
    ids=["rmsprop", "adamw"],
)
@pytest.mark.parametrize("skip_one", [False, True], ids=["every gradient", "one weight without"])
def test_weights_are_those_of_torch(ours, theirs, skip_one, seed):
    pairs = list(zip(weights_after(ours, seed, skip_one), weights_after(theirs, seed, skip_one), strict=True))
    assert pairs
    for mine, torchs in pairs:
        assert torch.equal(mine, torchs)
