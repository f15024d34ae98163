"""The agent network: a Q value for every target and for "return", whatever their number.

Each target is a token made of what the acting UAV sees of it; one more token stands for "return". Tokens
attend to each other, nearer targets more as a learned function of their distance says, so no token has a
number. A recurrent cell carries what the UAV saw at its earlier turns (the DRQN of the paper), and a head
scores every token. All UAVs share the weights; none is told which one it is.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from app.learning.universal.network.architecture import (
    DISTANCE_FEATURES,
    HEADS,
    OWN_FEATURES,
    PAIR_FEATURES,
    RIVAL_FEATURES,
)


class Layer(nn.Module):
    """Attention among tokens, then a feed-forward part; both with a residual."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.attention_norm = nn.LayerNorm(width)
        self.attention_in = nn.Linear(width, 3 * width)
        self.attention_out = nn.Linear(width, width)
        self.feed_norm = nn.LayerNorm(width)
        self.feed_in = nn.Linear(width, 2 * width)
        self.feed_out = nn.Linear(2 * width, width)

    def forward(self, tokens: Tensor, bias: Tensor) -> Tensor:
        """Tokens (T, A, W) with attention logits raised by bias (T, H, A, A)."""
        count, a, width = tokens.shape
        mixed = self.attention_in(self.attention_norm(tokens)).view(count, a, 3, HEADS, width // HEADS)
        query, key, value = mixed.permute(2, 0, 3, 1, 4)  # (T, H, A, W / H) each
        seen = functional.scaled_dot_product_attention(query, key, value, attn_mask=bias)
        tokens = tokens + self.attention_out(seen.transpose(1, 2).reshape(count, a, width))
        return tokens + self.feed_out(functional.gelu(self.feed_in(self.feed_norm(tokens))))


class UniversalAgent(nn.Module):
    """DRQN over tokens.

    Parameters
    ----------
    width
        Width of a token, a multiple of 4; also the size of the recurrent state.
    layers
        Attention layers.
    """

    def __init__(self, width: int, layers: int) -> None:
        super().__init__()
        self.pair_in = nn.Linear(PAIR_FEATURES, width)
        self.pair_hidden = nn.Linear(width, width)
        self.rival_in = nn.Linear(RIVAL_FEATURES, width // 2)
        self.rival_out = nn.Linear(width, width)
        self.own_in = nn.Linear(OWN_FEATURES, width)
        self.home = nn.Parameter(torch.zeros(width))
        self.distance_bias = nn.Linear(DISTANCE_FEATURES, layers * HEADS, bias=False)
        self.layers = nn.ModuleList(Layer(width) for _ in range(layers))
        self.norm = nn.LayerNorm(width)
        self.memory = nn.GRU(width, width)
        self.token_head = nn.Linear(width, width)
        self.memory_head = nn.Linear(width, width)
        self.score = nn.Linear(width, 1)
        self.sharpness = nn.Parameter(torch.tensor(2.0))

    def bias(self, distance: Tensor) -> Tensor:
        """Attention biases (P, L * H, N+1, N+1) of problems with scaled distances (P, N, N)."""
        return functional.pad(
            self.distance_bias(distance_features(distance)).permute(0, 3, 1, 2), (0, 1, 0, 1)
        )

    def encode(self, pair: Tensor, own: Tensor, rivals: Tensor, bias: Tensor) -> Tensor:
        """Tokens (T, N+1, W) of turns: rows (T, N, F), (T, G), (T, N, M, R), biases (T, L * H, N+1, N+1)."""
        mine = self.own_in(own)
        others = functional.relu(self.rival_in(rivals)) * rivals[..., :1]
        pooled = torch.cat((others.mean(dim=2), others.amax(dim=2)), dim=-1)
        targets = self.pair_hidden(
            functional.gelu(self.pair_in(pair) + self.rival_out(pooled) + mine[:, None])
        )
        tokens = torch.cat((targets + mine[:, None], (mine + self.home)[:, None]), dim=1)
        for layer, layer_bias in zip(self.layers, torch.split(bias, HEADS, dim=1), strict=True):
            tokens = layer(tokens, layer_bias)
        return self.norm(tokens)

    def remember(self, tokens: Tensor, hidden: Tensor) -> Tensor:
        """Recurrent state (T, W) after seeing tokens (T, N+1, W) with the state (T, W) of the turn before."""
        # One step as a cell takes half the time of a sequence of one.
        return torch.gru_cell(tokens.mean(dim=1), hidden, *self.memory.all_weights[0])

    def values(self, tokens: Tensor, hidden: Tensor) -> Tensor:
        """Q values (T, N+1), in largest levels, of tokens (T, N+1, W) and recurrent states (T, W)."""
        joined = functional.gelu(self.token_head(tokens) + self.memory_head(hidden)[:, None])
        return self.score(joined)[..., 0]

    def logits(self, values: Tensor) -> Tensor:
        """Log-odds of the sampling policy: Q values times a learned sharpness."""
        return values * self.sharpness.exp()


def distance_features(distance: Tensor) -> Tensor:
    """What attention is told of distances (...), in spans: (..., DISTANCE_FEATURES)."""
    return torch.stack(
        (
            distance,
            distance.square(),
            torch.exp(-10 * distance),
            torch.exp(-3 * distance),
            (distance == 0).float(),
        ),
        dim=-1,
    )
