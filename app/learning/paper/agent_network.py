"""The agent network: a DRQN (section 2.2), one for all UAVs."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import embedding, linear

from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.initialisation import UninitialisedGRUCell, UninitialisedLinear, initialise
from app.learning.paper.recurrence import gru


class AgentNetwork(nn.Module):
    """fc → ReLU → GRU cell → fc: Q values of one agent's actions after its observations so far.

    Its input is the observation (Eq. 13), the last action one-hot, all zeros at the beginning, and the agent
    one-hot. The first layer is one matrix over that input, but is applied block by block: what all agents
    observe is multiplied once, not once an agent, and one-hots are looked up.

    Parameters
    ----------
    sizes
        Sizes of the game.
    hidden_dim
        Hidden units H.
    generator
        Where the initial weights come from; None leaves them uninitialised.
    """

    def __init__(
        self, sizes: NetworkSizes, hidden_dim: int, generator: torch.Generator | None = None
    ) -> None:
        super().__init__()
        self.sizes = sizes
        self.hidden_dim = hidden_dim
        self.fc1 = UninitialisedLinear(sizes.agent_inputs, hidden_dim)
        self.rnn = UninitialisedGRUCell(hidden_dim, hidden_dim)
        self.fc2 = UninitialisedLinear(hidden_dim, sizes.n_actions)
        if generator is not None:
            initialise(self.fc1, sizes.agent_inputs, generator)
            initialise(self.rnn, hidden_dim, generator)
            initialise(self.fc2, hidden_dim, generator)

    def unroll(self, states: Tensor, actions: Tensor) -> Tensor:
        """Q values along whole episodes, each from a hidden state of zeros.

        Parameters
        ----------
        states
            (T, B, D) states at the beginning of each step.
        actions
            (T, B, M) integer actions taken in each step; the last row is not read.

        Returns
        -------
        Tensor
            (T, B, M, A).
        """
        steps, batch, _ = states.shape
        hidden = self._observation_layer(states)  # (T, B, M, H)
        if steps > 1:
            hidden[1:] += self._last_action_layer(actions[:-1])
        rows = batch * self.sizes.n_agents
        hidden = hidden.relu_().view(steps, rows, self.hidden_dim)
        hidden = gru(hidden, self.rnn.weight_ih, self.rnn.weight_hh, self.rnn.bias_ih, self.rnn.bias_hh)
        return self.fc2(hidden).view(steps, batch, self.sizes.n_agents, self.sizes.n_actions)

    def step(
        self, states: Tensor, last_actions: Tensor | None, hidden: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        """Q values of one step of B episodes, in inference.

        Parameters
        ----------
        states
            (B, D).
        last_actions
            (B, M) integer actions of the step before; None in the first step.
        hidden
            (B·M, H) as returned for the step before; None in the first step.

        Returns
        -------
        tuple of Tensor
            Q values (B, M, A), and the hidden state for the next step.
        """
        rows = states.shape[0] * self.sizes.n_agents
        inputs = self._observation_layer(states)
        if last_actions is not None:
            inputs += self._last_action_layer(last_actions)
        if hidden is None:
            hidden = states.new_zeros(rows, self.hidden_dim)
        hidden = torch.gru_cell(
            inputs.relu_().view(rows, self.hidden_dim),
            hidden,
            self.rnn.weight_ih,
            self.rnn.weight_hh,
            self.rnn.bias_ih,
            self.rnn.bias_hh,
        )
        values: Tensor = self.fc2(hidden)
        return values.view(states.shape[0], self.sizes.n_agents, self.sizes.n_actions), hidden

    def _blocks(self) -> tuple[Tensor, ...]:
        """Split the first layer's columns: own row, common part, last action, agent."""
        sizes = self.sizes
        return self.fc1.weight.split_with_sizes(
            [sizes.own_features, sizes.common_features, sizes.n_actions, sizes.n_agents], dim=1
        )

    def _observation_layer(self, states: Tensor) -> Tensor:
        """First layer without the last action and before its ReLU, (…, M, H)."""
        own_weight, common_weight, _, agent_weight = self._blocks()
        n_own = self.sizes.n_agents * self.sizes.own_features
        own = states[..., :n_own].view(*states.shape[:-1], self.sizes.n_agents, self.sizes.own_features)
        common = linear(states[..., n_own:], common_weight, self.fc1.bias).unsqueeze(-2)  # (…, 1, H)
        # Copied, because adding and looking up columns of a transposed matrix is several times slower.
        return linear(own, own_weight) + (common + agent_weight.t().contiguous())

    def _last_action_layer(self, actions: Tensor) -> Tensor:
        """What the last action adds to the first layer: (…, M) to (…, M, H)."""
        return embedding(actions, self._blocks()[2].t().contiguous())
