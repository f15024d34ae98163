"""The network of DQN: Q values of whole joint actions (section 4.1)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import relu

from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.initialisation import UninitialisedLinear, initialise


class JointNetwork(nn.Module):
    """fc → ReLU → fc → ReLU → fc from the state to the Q value of every joint action.

    It is a :class:`~app.learning.paper.networks.ValueNetwork` of a single agent, the swarm as a whole.

    Parameters
    ----------
    sizes
        Sizes of the game, with one agent.
    hidden_dim
        Units of each hidden layer.
    generator
        Where the initial weights come from.
    """

    def __init__(self, sizes: NetworkSizes, hidden_dim: int, generator: torch.Generator) -> None:
        super().__init__()
        self.fc1 = UninitialisedLinear(sizes.state_features, hidden_dim)
        self.fc2 = UninitialisedLinear(hidden_dim, hidden_dim)
        self.fc3 = UninitialisedLinear(hidden_dim, sizes.n_actions)
        initialise(self.fc1, sizes.state_features, generator)
        initialise(self.fc2, hidden_dim, generator)
        initialise(self.fc3, hidden_dim, generator)

    def unroll(self, states: Tensor, actions: Tensor) -> Tensor:  # noqa: ARG002 - the state is all it needs
        """Q values (T, B, 1, A) of the states (T, B, D)."""
        hidden = relu(self.fc2(relu(self.fc1(states))))
        values: Tensor = self.fc3(hidden)
        return values.unsqueeze(-2)

    def step(
        self,
        states: Tensor,
        last_actions: Tensor | None,  # noqa: ARG002 - the state is all it needs
        hidden: Tensor | None,  # noqa: ARG002 - the state is all it needs
    ) -> tuple[Tensor, None]:
        """Q values (B, 1, A) of the states (B, D)."""
        return self.unroll(states.unsqueeze(0), states)[0], None

    def mix(self, values: Tensor, states: Tensor) -> Tensor:  # noqa: ARG002 - one agent needs no mixing
        """The only agent's Q value is the joint action's: (…, 1) to (…,)."""
        return values.squeeze(-1)
