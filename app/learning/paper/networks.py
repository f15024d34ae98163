"""Networks that value joint actions: what a learner trains and a roll-out asks."""

from __future__ import annotations

from typing import Protocol

import torch
from torch import Tensor, nn

from app.learning.paper.agent_network import AgentNetwork
from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.mixer import Mixer


class ValueNetwork(Protocol):
    """Q values of every agent's actions, and of joint actions; a :class:`torch.nn.Module` in all cases."""

    def unroll(self, states: Tensor, actions: Tensor) -> Tensor:
        """Q values (T, B, M, A) along episodes with states (T, B, D) and actions (T, B, M)."""
        ...

    def step(
        self, states: Tensor, last_actions: Tensor | None, hidden: Tensor | None
    ) -> tuple[Tensor, Tensor | None]:
        """Q values (B, M, A) of one step, and what to pass as `hidden` to the next."""
        ...

    def mix(self, values: Tensor, states: Tensor) -> Tensor:
        """Q value (…,) of the joint action from those of its agents (…, M) in states (…, D)."""
        ...


class QmixNetwork(nn.Module):
    """The agent network and the mixing network of QMIX.

    Parameters
    ----------
    sizes
        Sizes of the game.
    drqn_hidden_dim, qmix_hidden_dim
        Hidden units of the two.
    generator
        Where the initial weights come from; None leaves them uninitialised.
    """

    def __init__(
        self,
        sizes: NetworkSizes,
        drqn_hidden_dim: int,
        qmix_hidden_dim: int,
        generator: torch.Generator | None = None,
    ) -> None:
        super().__init__()
        self.drqn_hidden_dim, self.qmix_hidden_dim = drqn_hidden_dim, qmix_hidden_dim
        self.agent = AgentNetwork(sizes, drqn_hidden_dim, generator)
        self.mixer = Mixer(sizes, qmix_hidden_dim, generator)

    def unroll(self, states: Tensor, actions: Tensor) -> Tensor:
        """Q values (T, B, M, A) along episodes; see :meth:`AgentNetwork.unroll`."""
        return self.agent.unroll(states, actions)

    def step(
        self, states: Tensor, last_actions: Tensor | None, hidden: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        """Q values (B, M, A) of one step; see :meth:`AgentNetwork.step`."""
        return self.agent.step(states, last_actions, hidden)

    def mix(self, values: Tensor, states: Tensor) -> Tensor:
        """Q_tot (…,); see :meth:`Mixer.forward`."""
        return self.mixer.forward(values, states)
