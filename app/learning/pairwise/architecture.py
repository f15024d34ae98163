"""What the networks of ``qmix-universal-2`` look like, in numbers; no torch here."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from app.domain.said import said
from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)
from app.learning.paper.architecture import read_config
from app.learning.universal.network.architecture import (
    DISTANCE_FEATURES,
    HEADS,
    layer_shapes,
    linear_shapes,
    mixer_shapes,
    norm_shapes,
)

QMIX_UNIVERSAL_2 = "qmix-universal-2"
"""Architecture: attention over UAVs, areas and bases, a score for each pair, a mixer; for any size."""

UNIVERSAL_FEATURES_2 = "universal-2"
"""Version of the network inputs, which :mod:`app.learning.pairwise.features` names."""

RETURNS_FROM = 0.75
"""Probability of "return" from which a UAV returns, if it acts greedily.

A return is for good, and what speaks against it is spread over all places: the most likely single action
would often be "return" where the policy is rather sure that the UAV should fly on.
"""

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
            width = fields["width"]
            raise ValueError(
                said("config field width is {width}, not a multiple of {heads}", width=width, heads=HEADS)
            )
        return cls(**fields)


def expected_tensors(config: PairwiseConfig) -> dict[str, tuple[tuple[int, ...], str]]:
    """Return shape and type (safetensors' name) of every tensor of ``qmix-universal-2``, by name."""
    width, mixer, half = config.width, config.qmix_hidden_dim, config.width // 2
    edges = config.layers * HEADS
    shapes: dict[str, tuple[int, ...]] = {
        **linear_shapes("agent.uav_in", len(UavFeature), width),
        **linear_shapes("agent.area_in", len(AreaFeature), width),
        **linear_shapes("agent.base_in", len(BaseFeature), width),
        **linear_shapes("agent.visit_in", len(VisitFeature), half),
        **linear_shapes("agent.reload_in", len(ReloadFeature), half),
        **linear_shapes("agent.uav_pool", 2 * width, width),
        **linear_shapes("agent.area_pool", width, width),
        **linear_shapes("agent.base_pool", width, width),
        "agent.visit_bias.weight": (2 * edges, half),
        "agent.reload_bias.weight": (2 * edges, half),
        "agent.distance_bias.weight": (edges, DISTANCE_FEATURES),
        **norm_shapes("agent.norm", width),
        **linear_shapes("agent.uav_head", width, width),
        "agent.area_head.weight": (width, width),
        "agent.base_head.weight": (width, width),
        "agent.visit_head.weight": (width, half),
        "agent.reload_head.weight": (width, half),
        **linear_shapes("agent.home_head", width, width),
        **linear_shapes("agent.score", width, 1),
        "agent.sharpness": (),
        **mixer_shapes(width, mixer),
    }
    shapes |= layer_shapes(config.layers, width)
    return {name: (shape, "F32") for name, shape in shapes.items()}
