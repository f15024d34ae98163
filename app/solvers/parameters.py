"""Parameters of the algorithms in this room, by the paper's names."""

from __future__ import annotations

from pydantic import Field

from app.solvers.protocol import Parameters


class GreedyParameters(Parameters):
    """The greedy rule has nothing to set."""


class GeneticParameters(Parameters):
    """Table 2 of the paper; its ``max_step`` is the problem's ``max_steps``, its ``seed`` the request's."""

    num_total: int = Field(default=30, ge=2, le=10_000, description="Population size (Table 2)")
    iteration: int = Field(default=200, ge=0, le=1_000_000, description="Generations (Table 2)")
    crossover_rate: float = Field(
        default=0.8, ge=0, le=1, description="Probability that two parents are crossed"
    )
    mutation_rate: float = Field(default=0.05, ge=0, le=1, description="Probability that a gene is redrawn")


class LocalSearchParameters(Parameters):
    """How long the local search goes on."""

    moves: int | None = Field(
        default=None, ge=0, le=10_000_000_000, description="Moves tried, over all rounds; null: by size"
    )
    restarts: int | None = Field(
        default=None,
        ge=0,
        le=1_000_000,
        description="Rounds of cooling after the first; null: by size and moves",
    )


class AutoParameters(LocalSearchParameters):
    """What a request may fix instead of leaving it to `auto`."""

    policy: bool | None = Field(
        default=None,
        description="Whether plans of the nearest policy of the library are among the starts; null: where "
        "that pays, by size and time limit",
    )


class ExactParameters(Parameters):
    """When to give up the proof."""

    nodes: int = Field(
        default=20_000, ge=0, le=10_000_000, description="Most nodes of the search tree that are looked at"
    )
