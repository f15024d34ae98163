"""The mixing network for any number of agents: monotonic in every agent's value.

A hypernetwork makes one weight vector an agent from the agent's own recurrent state and the pooled state of
all, instead of one block of weights a numbered agent; sums over agents are means, so that the joint value
does not grow with M (as in ODIS and REFIL). All weights on agents' values are made positive: raising one
agent's value never lowers the joint one, which is what lets every UAV choose for itself.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional


class UniversalMixer(nn.Module):
    """Q_tot of a joint action from the values of its agents.

    Parameters
    ----------
    width
        Size of the agents' recurrent states.
    hidden
        Hidden units of the mixing network (``qmix_hidden_dim``).
    """

    def __init__(self, width: int, hidden: int) -> None:
        super().__init__()
        self.agent_weight = nn.Linear(2 * width, hidden)
        self.hidden_bias = nn.Linear(width, hidden)
        self.out_weight = nn.Linear(width, hidden)
        self.out_bias = nn.Sequential(nn.Linear(width, hidden), nn.ReLU(), nn.Linear(hidden, 1))

    def forward(self, values: Tensor, hidden: Tensor, present: Tensor) -> Tensor:
        """Q_tot (B,) of values (B, M) of agents with recurrent states (B, M, W).

        Agents that are not present (B, M), returned ones, count as 0.
        """
        weight = present[..., None].to(hidden.dtype)
        agents = weight.sum(dim=1).clamp(min=1.0)
        pooled = (hidden * weight).sum(dim=1) / agents
        both = torch.cat((hidden, pooled[:, None].expand_as(hidden)), dim=-1)
        positive = functional.softplus(self.agent_weight(both)) * weight
        mixed = (values[..., None] * positive).sum(dim=1) / values.shape[1]
        mixed = functional.elu(mixed + self.hidden_bias(pooled))
        joint = (mixed * functional.softplus(self.out_weight(pooled))).mean(dim=1)
        return joint + self.out_bias(pooled)[:, 0]
