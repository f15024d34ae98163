"""The policy's answer to a state, as a computer on board asks for it: what is seen in, who acts out."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from app.learning.pairwise.agent import PairwiseAgent, Sight
from app.learning.pairwise.architecture import RETURNS_FROM
from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)

COLUMNS = {
    "uavs": UavFeature,
    "areas": AreaFeature,
    "bases": BaseFeature,
    "visits": VisitFeature,
    "reloads": ReloadFeature,
}
"""Inputs whose last axis is features, and which; what they mean is in ``ON_BOARD.md``."""


class PairwiseOnBoard(nn.Module):
    """The agent network without the mixer, which only the training needs.

    Parameters
    ----------
    agent
        Its weights are shared, not copied.
    """

    INPUTS = (*COLUMNS, "distances")
    OUTPUTS = ("values", "logits", "sureness", "uav", "action")

    def __init__(self, agent: PairwiseAgent) -> None:
        super().__init__()
        self.agent = agent

    def forward(
        self, uavs: Tensor, areas: Tensor, bases: Tensor, visits: Tensor, reloads: Tensor, distances: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Answer to a state of M UAVs, N areas and D bases, D from 0.

        Parameters
        ----------
        uavs, areas, bases, visits, reloads
            (M, 34), (N, 16), (D, 3), (M, N, 28) and (M, D, 14) features.
        distances
            (N+D, N+D) between areas and then bases, over the mission's span.

        Returns
        -------
        tuple of Tensor
            (M, N+1+D) Q values: visits, "return", reloads; (M, N+1+D) log-odds, minus infinity where an
            action is not allowed; (M,) log-probability of what each UAV would do, minus infinity of those
            that have acted; (1,) the UAV that acts first, the surest; (1,) what it does: "return" from a
            probability of ``RETURNS_FROM``, otherwise the place with the highest value.
        """
        m, n, d = uavs.shape[0], areas.shape[0], bases.shape[0]
        # One base more that is not there: then there is always one, and the same graph does without bases.
        present = functional.pad(uavs.new_ones(m + n + d, dtype=torch.bool), (0, 1), value=False)
        sight = Sight(
            uavs[None],
            areas[None],
            functional.pad(bases, (0, 0, 0, 1))[None],
            visits[None],
            functional.pad(reloads, (0, 0, 0, 1))[None],
            functional.pad(distances, (0, 1, 0, 1))[None],
            present[None],
        )
        values = self.agent(sight)[0][0, :, :-1]
        home = torch.ones_like(uavs[:, :1], dtype=torch.bool)
        allowed = torch.cat((visits[:, :, 0] > 0, home, reloads[:, :, 0] > 0), dim=1)
        logits = self.agent.logits(values).masked_fill(~allowed, -torch.inf)
        places = logits.masked_fill(torch.arange(n + 1 + d) == n, -torch.inf)
        returns = logits[:, n] - places.logsumexp(dim=1) >= math.log(RETURNS_FROM / (1 - RETURNS_FROM))
        choice = torch.where(returns, n, places.argmax(dim=1))
        chosen = logits.gather(1, choice[:, None])
        # From the odds of all else, so that no probability near 1 is rounded to it.
        odds = (logits - chosen).exp().scatter(1, choice[:, None], 0.0).sum(dim=1)
        sureness = (-odds.log1p()).masked_fill(uavs[:, UavFeature.ACTED] > 0, -torch.inf)
        first = sureness.argmax(dim=0, keepdim=True)
        return values, logits, sureness, first, choice[first]

    @staticmethod
    def example() -> tuple[Tensor, ...]:
        """Make inputs of some size to trace with; no two of M, N, D are equal, and none is 0 or 1."""
        m, n, d = 3, 5, 2
        shapes = ((m,), (n,), (d,), (m, n), (m, d))
        rows = (torch.rand(*shape, len(kind)) for shape, kind in zip(shapes, COLUMNS.values(), strict=True))
        return (*rows, torch.rand(n + d, n + d))

    @staticmethod
    def dynamic_shapes() -> tuple[dict[int, object], ...]:
        """Name the axes whose length is free, by input."""
        uavs, areas = map(torch.export.Dim, ("uavs", "areas"))
        bases = torch.export.Dim("bases", min=0)
        places = torch.export.Dim.DYNAMIC
        return (
            {0: uavs},
            {0: areas},
            {0: bases},
            {0: uavs, 1: areas},
            {0: uavs, 1: bases},
            {0: places, 1: places},
        )
