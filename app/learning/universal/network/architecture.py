"""What the universal networks look like, in numbers; no torch here."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from app.domain.said import said
from app.learning.paper.architecture import read_config

QMIX_UNIVERSAL_1 = "qmix-universal-1"
"""Architecture: attention over targets, a recurrent cell, a mixing network; for any M, N and K."""

UNIVERSAL_FEATURES_1 = "universal-1"
"""Version of the network inputs, which :mod:`app.learning.universal.episodes.observation` makes."""

PAIR_FEATURES = 30
OWN_FEATURES = 22
RIVAL_FEATURES = 6
DISTANCE_FEATURES = 5

HEADS = 4
"""Attention heads a layer; the width is a multiple of it."""

WIDEST = 512
"""Largest width that is taken."""

_LARGEST = {"width": WIDEST, "layers": 8, "qmix_hidden_dim": 1024}


@dataclass(frozen=True, slots=True)
class UniversalConfig:
    """What fixes the shape of every tensor of ``qmix-universal-1``."""

    width: int = 64
    layers: int = 2
    qmix_hidden_dim: int = 32

    def as_record(self) -> dict[str, int]:
        """Return the fields, JSON-ready."""
        return asdict(self)

    @classmethod
    def from_record(cls, record: object) -> UniversalConfig:
        """Read the fields from what a stranger may have written.

        Raises
        ------
        ValueError
            If a field is missing, unknown, no integer, or out of range.
        """
        fields = read_config(record, _LARGEST)
        if fields["width"] % HEADS:
            width = fields["width"]
            raise ValueError(
                said("config field width is {width}, not a multiple of {heads}", width=width, heads=HEADS)
            )
        return cls(**fields)


def expected_tensors(config: UniversalConfig) -> dict[str, tuple[tuple[int, ...], str]]:
    """Return shape and type (safetensors' name) of every tensor of ``qmix-universal-1``, by name."""
    width, mixer = config.width, config.qmix_hidden_dim
    half = width // 2
    shapes: dict[str, tuple[int, ...]] = {
        **linear_shapes("agent.pair_in", PAIR_FEATURES, width),
        **linear_shapes("agent.pair_hidden", width, width),
        **linear_shapes("agent.rival_in", RIVAL_FEATURES, half),
        **linear_shapes("agent.rival_out", width, width),
        **linear_shapes("agent.own_in", OWN_FEATURES, width),
        "agent.home": (width,),
        "agent.distance_bias.weight": (config.layers * HEADS, DISTANCE_FEATURES),
        **norm_shapes("agent.norm", width),
        "agent.memory.weight_ih_l0": (3 * width, width),
        "agent.memory.weight_hh_l0": (3 * width, width),
        "agent.memory.bias_ih_l0": (3 * width,),
        "agent.memory.bias_hh_l0": (3 * width,),
        **linear_shapes("agent.token_head", width, width),
        **linear_shapes("agent.memory_head", width, width),
        **linear_shapes("agent.score", width, 1),
        "agent.sharpness": (),
        **mixer_shapes(width, mixer),
    }
    shapes |= layer_shapes(config.layers, width)
    return {name: (shape, "F32") for name, shape in shapes.items()}


def layer_shapes(layers: int, width: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the layers of attention."""
    shapes: dict[str, tuple[int, ...]] = {}
    for layer in range(layers):
        name = f"agent.layers.{layer}"
        shapes |= {
            **norm_shapes(f"{name}.attention_norm", width),
            **linear_shapes(f"{name}.attention_in", width, 3 * width),
            **linear_shapes(f"{name}.attention_out", width, width),
            **norm_shapes(f"{name}.feed_norm", width),
            **linear_shapes(f"{name}.feed_in", width, 2 * width),
            **linear_shapes(f"{name}.feed_out", 2 * width, width),
        }
    return shapes


def mixer_shapes(width: int, mixer: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the mixing network."""
    return {
        **linear_shapes("mixer.agent_weight", 2 * width, mixer),
        **linear_shapes("mixer.hidden_bias", width, mixer),
        **linear_shapes("mixer.out_weight", width, mixer),
        **linear_shapes("mixer.out_bias.0", width, mixer),
        **linear_shapes("mixer.out_bias.2", mixer, 1),
    }


def linear_shapes(name: str, inputs: int, outputs: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a linear part."""
    return {f"{name}.weight": (outputs, inputs), f"{name}.bias": (outputs,)}


def norm_shapes(name: str, width: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a norm."""
    return {f"{name}.weight": (width,), f"{name}.bias": (width,)}
