"""What the paper's networks look like, in numbers: sizes, and every tensor a checkpoint of them must have.

Nothing here needs torch, so a checkpoint's shapes can be checked before anything is built from it.
"""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass

from app.domain.said import said

QMIX_PAPER_1 = "qmix-paper-1"
"""Architecture: a shared DRQN agent and a monotonic mixing network, for one M, N and K."""

PAPER_FEATURES_1 = "paper-1"
"""Version of the network inputs: Eqs. 10-13, scaled as :mod:`app.library.description` does."""

UAV_FIELDS = 8
"""Numbers of a UAV's row besides its loads: x_s, y_s, x_c, y_c, speed, voyage, dis, ret (Eq. 11)."""

TARGET_FIELDS = 3
"""Numbers of a target's row besides its needs: x, y, level (Eq. 12)."""

_MAX_DIMENSION = 4096


@dataclass(frozen=True, slots=True)
class NetworkSizes:
    """Sizes of a game that agents play together, as their networks see it.

    A state is `n_agents` rows of `own_features` numbers, one an agent, followed by `common_features` numbers
    that every agent observes (Eqs. 10 and 13).
    """

    n_agents: int
    n_actions: int
    own_features: int
    common_features: int

    @property
    def state_features(self) -> int:
        """Length D of a state."""
        return self.n_agents * self.own_features + self.common_features

    @property
    def agent_inputs(self) -> int:
        """Length of an agent's input: observation, last action one-hot, agent one-hot."""
        return self.own_features + self.common_features + self.n_actions + self.n_agents


@dataclass(frozen=True, slots=True)
class QmixConfig:
    """What fixes the shape of every tensor of ``qmix-paper-1``."""

    n_uavs: int
    n_targets: int
    n_materials: int
    drqn_hidden_dim: int
    qmix_hidden_dim: int

    @property
    def sizes(self) -> NetworkSizes:
        """Return the sizes of the game."""
        return NetworkSizes(
            n_agents=self.n_uavs,
            n_actions=self.n_targets + 1,
            own_features=UAV_FIELDS + self.n_materials,
            common_features=self.n_targets * (TARGET_FIELDS + self.n_materials),
        )

    def as_record(self) -> dict[str, int]:
        """Return the fields, JSON-ready."""
        return asdict(self)

    @classmethod
    def from_record(cls, record: object) -> QmixConfig:
        """Read the fields from what a stranger may have written.

        Raises
        ------
        ValueError
            If a field is missing, unknown, no integer, or out of range.
        """
        return cls(**read_config(record, dict.fromkeys(cls.__slots__, _MAX_DIMENSION)))


def read_config(record: object, largest: Mapping[str, int]) -> dict[str, int]:
    """Read the sizes of networks from what a stranger may have written.

    Parameters
    ----------
    record
        Anything.
    largest
        The fields there must be, with the largest value of each; the smallest is 1.

    Raises
    ------
    ValueError
        If a field is missing, unknown, no integer, or out of range.
    """
    if not isinstance(record, Mapping) or set(record) != set(largest):
        raise ValueError(said("config has not exactly the fields {names}", names=list(largest)))
    for name, limit in largest.items():
        value = record[name]
        if type(value) is not int or not 1 <= value <= limit:
            raise ValueError(
                said(
                    "config field {name} is {value}, not an integer from 1 to {limit}",
                    name=name,
                    value=reprlib.repr(value),
                    limit=limit,
                )
            )
    return {name: record[name] for name in largest}


def expected_tensors(config: QmixConfig) -> dict[str, tuple[tuple[int, ...], str]]:
    """Return shape and type (safetensors' name) of every tensor of ``qmix-paper-1``, by name.

    The columns of ``agent.fc1.weight`` are the UAV's row, the targets' rows, the last action one-hot and the
    agent one-hot. The rows of ``mixer.hypernetwork.weight`` make, in this order, the first layer's weights
    (M of them for every hidden unit, UAV by UAV), its bias, the second layer's weights, and the hidden layer
    of its bias.
    """
    sizes, agent, mixer = config.sizes, config.drqn_hidden_dim, config.qmix_hidden_dim
    made = (sizes.n_agents + 3) * mixer
    shapes: dict[str, tuple[int, ...]] = {
        "agent.fc1.weight": (agent, sizes.agent_inputs),
        "agent.fc1.bias": (agent,),
        "agent.rnn.weight_ih": (3 * agent, agent),
        "agent.rnn.weight_hh": (3 * agent, agent),
        "agent.rnn.bias_ih": (3 * agent,),
        "agent.rnn.bias_hh": (3 * agent,),
        "agent.fc2.weight": (sizes.n_actions, agent),
        "agent.fc2.bias": (sizes.n_actions,),
        "mixer.hypernetwork.weight": (made, sizes.state_features),
        "mixer.hypernetwork.bias": (made,),
        "mixer.value.weight": (1, mixer),
        "mixer.value.bias": (1,),
    }
    return {name: (shape, "F32") for name, shape in shapes.items()}
