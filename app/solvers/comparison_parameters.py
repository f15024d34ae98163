"""Parameters of the algorithms for comparison, by the names of the literature.

They stand apart from :mod:`app.solvers.parameters`: what is changed here compiles nothing else anew.
"""

from __future__ import annotations

from pydantic import Field

from app.solvers.protocol import Parameters


class SearchParameters(Parameters):
    """What the algorithms for comparison have in common."""

    evaluations: int | None = Field(
        default=None,
        ge=0,
        le=1_000_000_000,
        description="Whole plans that are flown; null: as many as the time limit allows, without one by size",
    )


class KeySearchParameters(SearchParameters):
    """What searches over random keys have in common."""

    swarm: int = Field(default=30, ge=3, le=10_000, description="Members of the swarm")


class ParticleSwarmParameters(KeySearchParameters):
    """Of the particle swarm (Shi and Eberhart 1998), and of its variable neighbourhood search."""

    inertia_start: float = Field(default=0.9, ge=0, le=1, description="Inertia at the beginning")
    inertia_end: float = Field(default=0.4, ge=0, le=1, description="Inertia at the end; linear between")
    cognitive: float = Field(default=2.0, ge=0, le=10, description="Pull of a member's own best position")
    social: float = Field(default=2.0, ge=0, le=10, description="Pull of the swarm's best position")
    max_velocity: float = Field(default=0.2, gt=0, le=1, description="Most that a key changes in one move")
    neighbours: int = Field(
        default=30, ge=0, le=10_000, description="Neighbours of the best position tried after every move"
    )


class GreyWolfParameters(KeySearchParameters):
    """Of the grey wolves: nothing beside the size of the pack."""


class BeetleAntennaeParameters(KeySearchParameters):
    """Of the beetle swarm (Wang, Yang and Liu 2018)."""

    inertia_start: float = Field(default=0.9, ge=0, le=1, description="Inertia at the beginning")
    inertia_end: float = Field(default=0.4, ge=0, le=1, description="Inertia at the end; linear between")
    cognitive: float = Field(default=2.0, ge=0, le=10, description="Pull of a member's own best position")
    social: float = Field(default=2.0, ge=0, le=10, description="Pull of the swarm's best position")
    max_velocity: float = Field(default=0.2, gt=0, le=1, description="Most that a key changes by the swarm")
    swarm_share: float = Field(
        default=0.4, ge=0, le=1, description="Share of the swarm's pull in a move; the antennae have the rest"
    )
    step: float = Field(
        default=1.0, gt=0, le=10, description="Step along the antennae, in velocities, at first"
    )
    step_end: float = Field(
        default=0.1, gt=0, le=1, description="What is left of the step at the end, as a share"
    )


class AntColonyParameters(SearchParameters):
    """Of the ant colony: how UAVs respond, and how their thresholds follow what they do."""

    days: int = Field(default=20, ge=1, le=10_000, description="Plans between two changes of the thresholds")
    steepness: float = Field(default=4.0, gt=0, le=50, description="Exponent of the response to a stimulus")
    threshold_min: float = Field(default=0.1, gt=0, le=1, description="Least threshold")
    threshold_max: float = Field(default=1.0, gt=0, le=10, description="Largest threshold, and the first")
    learning: float = Field(
        default=0.2,
        ge=0,
        le=1,
        description="Share that a threshold falls by where the UAV was in a good plan",
    )
    forgetting: float = Field(default=0.05, ge=0, le=1, description="Share that all thresholds rise by")


class MarketParameters(SearchParameters):
    """What markets have in common: who hears whom, and what is done with time that is left."""

    communication_range: float | None = Field(
        default=None, ge=0, description="How far UAVs hear each other, in the problem's lengths; null: all do"
    )
    message_loss: float = Field(default=0.0, ge=0, lt=1, description="Probability that a message is lost")
    message_delay: int = Field(default=0, ge=0, le=100, description="Rounds that a message takes longer")
    cancelled: float = Field(
        default=0.3,
        ge=0,
        le=1,
        description="Share of the contracts that are cancelled before each next market",
    )


class ContractNetParameters(MarketParameters):
    """Of the contract net: nothing else."""


class BundleParameters(MarketParameters):
    """Of the consensus-based bundle algorithm."""

    rounds: int = Field(default=200, ge=1, le=100_000, description="Most rounds of messages of an auction")


class SemiRandomQParameters(SearchParameters):
    """Of Q-learning with semi-random exploration."""

    learning_rate: float = Field(
        default=0.2, gt=0, le=1, description="Step of the values towards what is seen"
    )
    gamma: float = Field(default=1.0, ge=0, le=1, description="Discount of what comes later")
    epsilon_start: float = Field(default=1.0, ge=0, le=1, description="Share of explored actions at first")
    epsilon_end: float = Field(default=0.05, ge=0, le=1, description="The same at the end; linear between")
