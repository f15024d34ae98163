"""The agent network: a Q value for every UAV and every place it may go to, all at once.

UAVs, areas and bases are tokens of one transformer. What is seen of a UAV and a place together is an edge
between their tokens: it is pooled into both, and raises or lowers how much they attend to each other; so do
distances between places. A head scores each pair from its two tokens and its edge, and "return" from the
UAV's token. Nothing depends on how UAVs and places are numbered, and all UAVs share the weights.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)
from app.learning.universal.network.agent import Layer, distance_features
from app.learning.universal.network.architecture import DISTANCE_FEATURES, HEADS


class Sight(NamedTuple):
    """T states as tensors: :class:`~app.learning.pairwise.seen.Seen`, padded, and distances.

    Attributes
    ----------
    uavs, areas, bases, visits, reloads
        (T, M, U), (T, N, A), (T, D, B), (T, M, N, V), (T, M, D, R).
    distance
        (T, N+D, N+D) between places, in spans.
    present
        (T, M+N+D) which UAVs, areas and bases are no padding.
    """

    uavs: Tensor
    areas: Tensor
    bases: Tensor
    visits: Tensor
    reloads: Tensor
    distance: Tensor
    present: Tensor


class PairwiseAgent(nn.Module):
    """Scores pairs."""

    def __init__(self, config: PairwiseConfig) -> None:
        super().__init__()
        width, layers = config.width, config.layers
        half = width // 2
        self.uav_in = nn.Linear(len(UavFeature), width)
        self.area_in = nn.Linear(len(AreaFeature), width)
        self.base_in = nn.Linear(len(BaseFeature), width)
        self.visit_in = nn.Linear(len(VisitFeature), half)
        self.reload_in = nn.Linear(len(ReloadFeature), half)
        self.uav_pool = nn.Linear(2 * width, width)
        self.area_pool = nn.Linear(width, width)
        self.base_pool = nn.Linear(width, width)
        self.visit_bias = nn.Linear(half, 2 * layers * HEADS, bias=False)
        self.reload_bias = nn.Linear(half, 2 * layers * HEADS, bias=False)
        self.distance_bias = nn.Linear(DISTANCE_FEATURES, layers * HEADS, bias=False)
        self.layers = nn.ModuleList(Layer(width) for _ in range(layers))
        self.norm = nn.LayerNorm(width)
        self.uav_head = nn.Linear(width, width)
        self.area_head = nn.Linear(width, width, bias=False)
        self.base_head = nn.Linear(width, width, bias=False)
        self.visit_head = nn.Linear(half, width, bias=False)
        self.reload_head = nn.Linear(half, width, bias=False)
        self.home_head = nn.Linear(width, width)
        self.score = nn.Linear(width, 1)
        self.sharpness = nn.Parameter(torch.tensor(2.0))

    def forward(self, sight: Sight) -> tuple[Tensor, Tensor]:
        """Values (T, M, N+1+D) in largest levels, and the UAVs' tokens (T, M, W)."""
        m, n, d = sight.uavs.shape[1], sight.areas.shape[1], sight.bases.shape[1]
        count_m = sight.present[:, :m].sum(dim=1)
        count_n = sight.present[:, m : m + n].sum(dim=1)
        visits = functional.relu(self.visit_in(sight.visits)) * sight.visits[..., :1]
        places = self.area_in(sight.areas) + self.area_pool(_pooled(visits, 1, count_m))
        by_uav = [_pooled(visits, 2, count_n)]
        edges = self.visit_bias(visits)
        if d:
            reloads = functional.relu(self.reload_in(sight.reloads)) * sight.reloads[..., :1]
            bases = self.base_in(sight.bases) + self.base_pool(_pooled(reloads, 1, count_m))
            places = torch.cat((places, bases), dim=1)
            by_uav.append(_pooled(reloads, 2, sight.present[:, m + n :].sum(dim=1)))
            edges = torch.cat((edges, self.reload_bias(reloads)), dim=2)
        else:
            by_uav.append(torch.zeros_like(by_uav[0]))
        uavs = self.uav_in(sight.uavs) + self.uav_pool(torch.cat(by_uav, dim=-1))
        bias = self.bias(edges, sight)
        tokens = torch.cat((uavs, places), dim=1)
        for layer, layer_bias in zip(self.layers, bias.chunk(len(self.layers), dim=1), strict=True):
            tokens = layer(tokens, layer_bias)
        tokens = self.norm(tokens)
        own = tokens[:, :m]
        mine = self.uav_head(own)[:, :, None]
        pair = functional.gelu(mine + self.area_head(tokens[:, None, m : m + n]) + self.visit_head(visits))
        values = [self.score(pair)[..., 0], self.score(functional.gelu(self.home_head(own)))]
        if d:
            pair = functional.gelu(
                mine + self.base_head(tokens[:, None, m + n :]) + self.reload_head(reloads)
            )
            values.append(self.score(pair)[..., 0])
        return torch.cat(values, dim=2), own

    def place_bias(self, distance: Tensor) -> Tensor:
        """Attention biases (T, L * H, N+D, N+D) between places at scaled distances (T, N+D, N+D)."""
        return self.distance_bias(distance_features(distance)).permute(0, 3, 1, 2)

    def bias(self, edges: Tensor, sight: Sight) -> Tensor:
        """Attention biases (T, L * H, M+N+D, M+N+D), from edges (T, M, N+D, 2 * L * H) and distances."""
        m = sight.uavs.shape[1]
        out, back = edges.permute(0, 3, 1, 2).chunk(2, dim=1)
        places = self.place_bias(sight.distance)
        top = torch.cat((out.new_zeros(*out.shape[:2], m, m), out), dim=3)
        whole = torch.cat((top, torch.cat((back.transpose(2, 3), places), dim=3)), dim=2)
        return whole.masked_fill(~sight.present[:, None, None, :], -1e9)

    def logits(self, values: Tensor) -> Tensor:
        """Log-odds of the sampling policy: Q values times a learned sharpness."""
        return values * self.sharpness.exp()


def _pooled(edges: Tensor, axis: int, count: Tensor) -> Tensor:
    """Mean over so many (T,), and maximum, of edges that are not negative over an axis."""
    mean = edges.sum(dim=axis) / count.clamp(min=1)[:, None, None]
    return torch.cat((mean, edges.amax(dim=axis)), dim=-1)
