"""The mixing network: agents' Q values into that of their joint action (section 2.2; Rashid et al. 2018)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import elu, relu

from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.initialisation import UninitialisedLinear, initialise


class Mixer(nn.Module):
    """Q_tot = ELU(q·|W₁(s)| + b₁(s))·|w₂(s)| + b₂(s), monotonic in every agent's q.

    A hypernetwork makes the weights from the state: W₁, b₁ and w₂ by one linear layer each, b₂ by two with a
    ReLU between. The linear layers that read the state are one matrix here.

    Parameters
    ----------
    sizes
        Sizes of the game.
    hidden_dim
        Hidden units E.
    generator
        Where the initial weights come from; None leaves them uninitialised.
    """

    def __init__(
        self, sizes: NetworkSizes, hidden_dim: int, generator: torch.Generator | None = None
    ) -> None:
        super().__init__()
        self.sizes = sizes
        self.hidden_dim = hidden_dim
        made = (sizes.n_agents + 3) * hidden_dim
        self.hypernetwork = UninitialisedLinear(sizes.state_features, made)
        self.value = UninitialisedLinear(hidden_dim, 1)
        if generator is not None:
            initialise(self.hypernetwork, sizes.state_features, generator)
            initialise(self.value, hidden_dim, generator)

    def forward(self, values: Tensor, states: Tensor) -> Tensor:
        """Mix.

        Parameters
        ----------
        values
            (…, M) Q value of each agent's action.
        states
            (…, D).

        Returns
        -------
        Tensor
            (…,) Q_tot.
        """
        m, e = self.sizes.n_agents, self.hidden_dim
        made = self.hypernetwork(states)  # (…, (M+3)·E)
        w1, b1, w2, v = made.split([m * e, e, e, e], dim=-1)
        weights = w1.abs().unflatten(-1, (m, e))  # (…, M, E)
        # Not a product of matrices: one row by one small matrix an element is slower as such.
        hidden = elu((values.unsqueeze(-1) * weights).sum(-2) + b1)  # (…, E)
        bias: Tensor = self.value(relu(v)).squeeze(-1)
        return (hidden * w2.abs()).sum(-1) + bias
