"""A turn of the policy for every size, as a computer on board plays it: rows in, an action out."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from app.learning.universal.network.agent import UniversalAgent
from app.learning.universal.network.architecture import (
    OWN_FEATURES,
    PAIR_FEATURES,
    RIVAL_FEATURES,
    UniversalConfig,
)

PAIR_NAMES = (
    "allowed",
    "distance",
    "cost",
    "value",
    "earned",
    "share_of_need",
    "share_of_load",
    "need_left",
    "level",
    "range_slack",
    "home_then",
    "detour",
    "has_deadline",
    "deadline_slack",
    "service_time",
    "flight_time",
    "best_rival",
    "second_rival",
    "lead_over_rivals",
    "rivals_able",
    "rivals_supply",
    "follow_up",
    "earned_with_follow_up",
    "regret_of_best_rival",
    "best_rival_acts_later",
    "lead_over_elsewhere",
    "earned_share_of_value",
    "fills_need",
    "empties_load",
    "rest_by_rivals",
)
"""Columns of ``pair``, one row a target; what they mean is in ``ON_BOARD.md``."""

OWN_NAMES = (
    "visits_allowed",
    "best_visit",
    "best_of_rivals",
    "load_against_largest",
    "load_left",
    "range_left",
    "distance_home",
    "cost_home",
    "return_is_charged",
    "must_return",
    "steps_left",
    "one_over_steps_left",
    "last_step",
    "clock",
    "speed",
    "uavs_against_targets",
    "need_covered",
    "supply_needed",
    "weight_of_distance",
    "uavs_out",
    "place_in_turn",
    "one_over_targets",
)
"""Columns of ``own``."""

RIVAL_NAMES = ("able", "earned", "regret", "share_of_need", "acts_later", "distance")
"""Columns of ``rivals``, one row a target and UAV."""


class UniversalOnBoard(nn.Module):
    """The agent network without the mixer, which only the training needs.

    Parameters
    ----------
    agent
        Its weights are shared, not copied.
    """

    INPUTS = ("pair", "own", "rivals", "distances", "hidden")
    OUTPUTS = ("values", "logits", "action", "new_hidden")

    def __init__(self, agent: UniversalAgent) -> None:
        super().__init__()
        self.agent = agent

    def forward(
        self, pair: Tensor, own: Tensor, rivals: Tensor, distances: Tensor, hidden: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Take T turns in the same mission.

        Parameters
        ----------
        pair, own, rivals
            (T, N, 30), (T, 22) and (T, N, M, 6) observations.
        distances
            (N, N) between targets, over the mission's span.
        hidden
            (T, W) recurrent states of the UAVs' turns before; zeros at first.

        Returns
        -------
        tuple of Tensor
            (T, N+1) Q values; (T, N+1) log-odds, minus infinity where a visit is not allowed; (T,) the most
            likely action, N for "return"; (T, W) recurrent states for the next turns.
        """
        tokens = self.agent.encode(pair, own, rivals, self.agent.bias(distances[None]))
        remembered = self.agent.remember(tokens, hidden)
        values = self.agent.values(tokens, remembered)
        allowed = functional.pad(pair[:, :, 0] > 0, (0, 1), value=True)
        logits = self.agent.logits(values).masked_fill(~allowed, -torch.inf)
        return values, logits, logits.argmax(dim=1), remembered

    @staticmethod
    def example(config: UniversalConfig) -> tuple[Tensor, ...]:
        """Make inputs of some size to trace with; no two of T, N, M are equal, and none is 1."""
        t, n, m = 2, 5, 3
        return (
            torch.rand(t, n, PAIR_FEATURES),
            torch.rand(t, OWN_FEATURES),
            torch.rand(t, n, m, RIVAL_FEATURES),
            torch.rand(n, n),
            torch.zeros(t, config.width),
        )

    @staticmethod
    def dynamic_shapes() -> tuple[dict[int, object], ...]:
        """Name the axes whose length is free, by input."""
        turns, targets, uavs = map(torch.export.Dim, ("turns", "targets", "uavs"))
        return (
            {0: turns, 1: targets},
            {0: turns},
            {0: turns, 1: targets, 2: uavs},
            {0: targets, 1: targets},
            {0: turns},
        )
