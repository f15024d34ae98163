"""What the networks of ``qmix-universal-2`` look like, in numbers; no torch here."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)
from app.learning.paper.architecture import read_config

QMIX_UNIVERSAL_2 = "qmix-universal-2"
"""Architecture: attention over UAVs, areas and bases, a score for each pair, a mixer; for any size."""

UNIVERSAL_FEATURES_2 = "universal-2"
"""Version of the network inputs, which :mod:`app.learning.pairwise.features` names."""

HEADS = 4
"""Attention heads a layer; the width is a multiple of it."""

DISTANCE_FEATURES = 5
"""What attention between places is told of their distance."""

WIDEST = 448
"""Largest width that is taken."""

_LARGEST = {"width": WIDEST, "layers": 8, "qmix_hidden_dim": 1024}


@dataclass(frozen=True, slots=True)
class PairwiseConfig:
    """What fixes the shape of every tensor of ``qmix-universal-2``."""

    width: int = 64
    layers: int = 3
    qmix_hidden_dim: int = 32

    def as_record(self) -> dict[str, int]:
        """Return the fields, JSON-ready."""
        return asdict(self)

    @classmethod
    def from_record(cls, record: object) -> PairwiseConfig:
        """Read the fields from what a stranger may have written.

        Raises
        ------
        ValueError
            If a field is missing, unknown, no integer, or out of range.
        """
        fields = read_config(record, _LARGEST)
        if fields["width"] % HEADS:
            raise ValueError(f"config field width is {fields['width']}, not a multiple of {HEADS}")
        return cls(**fields)


def expected_tensors(config: PairwiseConfig) -> dict[str, tuple[tuple[int, ...], str]]:
    """Return shape and type (safetensors' name) of every tensor of ``qmix-universal-2``, by name."""
    width, mixer, half = config.width, config.qmix_hidden_dim, config.width // 2
    edges = config.layers * HEADS
    shapes: dict[str, tuple[int, ...]] = {
        **_linear("agent.uav_in", len(UavFeature), width),
        **_linear("agent.area_in", len(AreaFeature), width),
        **_linear("agent.base_in", len(BaseFeature), width),
        **_linear("agent.visit_in", len(VisitFeature), half),
        **_linear("agent.reload_in", len(ReloadFeature), half),
        **_linear("agent.uav_pool", 2 * width, width),
        **_linear("agent.area_pool", width, width),
        **_linear("agent.base_pool", width, width),
        "agent.visit_bias.weight": (2 * edges, half),
        "agent.reload_bias.weight": (2 * edges, half),
        "agent.distance_bias.weight": (edges, DISTANCE_FEATURES),
        **_norm("agent.norm", width),
        **_linear("agent.uav_head", width, width),
        "agent.area_head.weight": (width, width),
        "agent.base_head.weight": (width, width),
        "agent.visit_head.weight": (width, half),
        "agent.reload_head.weight": (width, half),
        **_linear("agent.home_head", width, width),
        **_linear("agent.score", width, 1),
        "agent.sharpness": (),
        **_linear("mixer.agent_weight", 2 * width, mixer),
        **_linear("mixer.hidden_bias", width, mixer),
        **_linear("mixer.out_weight", width, mixer),
        **_linear("mixer.out_bias.0", width, mixer),
        **_linear("mixer.out_bias.2", mixer, 1),
    }
    for layer in range(config.layers):
        name = f"agent.layers.{layer}"
        shapes |= {
            **_norm(f"{name}.attention_norm", width),
            **_linear(f"{name}.attention_in", width, 3 * width),
            **_linear(f"{name}.attention_out", width, width),
            **_norm(f"{name}.feed_norm", width),
            **_linear(f"{name}.feed_in", width, 2 * width),
            **_linear(f"{name}.feed_out", 2 * width, width),
        }
    return {name: (shape, "F32") for name, shape in shapes.items()}


def _linear(name: str, inputs: int, outputs: int) -> dict[str, tuple[int, ...]]:
    return {f"{name}.weight": (outputs, inputs), f"{name}.bias": (outputs,)}


def _norm(name: str, width: int) -> dict[str, tuple[int, ...]]:
    return {f"{name}.weight": (width,), f"{name}.bias": (width,)}
