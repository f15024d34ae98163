"""Parameters of the learners, by the paper's names (Tables 1 and 3); no torch here.

Tables 1 and 3 also list ``seed``, which is the request's. What the tables leave out comes from the family of
public QMIX implementations whose parameter names the paper uses.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from app.solvers.protocol import Parameters

MAX_EPOCHS = 10_000_000
MAX_STORED_EPISODES = 100_000
MAX_HIDDEN_UNITS = 1024
MAX_SAMPLES = 100_000
REPLANS_A_SAMPLE = 3
MAX_REPLANS = REPLANS_A_SAMPLE * MAX_SAMPLES
MAX_MOVES = 10_000_000_000

TABLE_3_EPOCHS = 200

Mode = Literal["service", "paper"]


class UpdateParameters(Parameters):
    """How a learner plays, stores and updates: Table 1, and the decisions it leaves open."""

    evaluate_per_epoch: int = Field(
        default=100,
        ge=1,
        le=MAX_EPOCHS,
        description="Epochs from one greedy evaluation to the next (Table 1)",
    )
    batch_size: int = Field(default=32, ge=1, le=4096, description="Episodes an update (Table 1)")
    buffer_size: int = Field(
        default=100, ge=1, le=MAX_STORED_EPISODES, description="Episodes the replay buffer holds (Table 1)"
    )
    update_target_params: int = Field(
        default=200,
        ge=1,
        le=MAX_EPOCHS,
        description="Epochs from one copy to the target network to the next (Table 1)",
    )
    lr: float = Field(default=5e-4, gt=0, le=1, description="Learning rate of RMSprop")
    gamma: float = Field(default=0.99, ge=0, le=1, description="Discount")
    grad_norm_clip: float = Field(default=10.0, gt=0, le=1e6, description="Largest norm of the gradient")
    epsilon_start: float = Field(
        default=1.0, ge=0, le=1, description="Probability of a random action at the beginning"
    )
    epsilon_end: float = Field(
        default=0.05, ge=0, le=1, description="Probability of a random action after the annealing"
    )
    epsilon_anneal_steps: int = Field(
        default=50_000,
        ge=1,
        le=1_000_000_000,
        description="Environment steps over which it changes, linearly",
    )
    learning_starts: int | None = Field(
        default=None,
        ge=1,
        le=MAX_STORED_EPISODES,
        description="Stored episodes before the first update; null: a full buffer (Algorithm 1, line 10)",
    )

    @property
    def first_update(self) -> int:
        """Stored episodes before the first update; a full buffer is always enough."""
        return min(self.learning_starts or self.buffer_size, self.buffer_size)


class LearningParameters(UpdateParameters):
    """What every learner from scratch has."""

    n_epochs: int = Field(
        default=50_000, ge=0, le=MAX_EPOCHS, description="Epochs; one episode and one update each (Table 1)"
    )


class QmixParameters(LearningParameters):
    """Table 1 of the paper."""

    mode: Mode = Field(
        default="service",
        description="service: the networks for every size, learned on the problem alone, up to about "
        "20 x 30; paper: Algorithm 1 to the letter",
    )
    drqn_hidden_dim: int = Field(
        default=64, ge=1, le=MAX_HIDDEN_UNITS, description="Hidden units of the agent network (Table 1)"
    )
    qmix_hidden_dim: int = Field(
        default=32, ge=1, le=MAX_HIDDEN_UNITS, description="Hidden units of the mixing network (Table 1)"
    )


class TransferQmixParameters(UpdateParameters):
    """Table 3 of the paper, and what the service's own mode adds.

    Exploration begins where a trained policy's ends. The service's mode has no use for the replay buffer,
    epsilon, the period of the target network and the hidden units: its policies bring their own.
    """

    mode: Mode = Field(
        default="service",
        description="service: one policy for every size, search and fine-tuning at request time; paper: "
        "Algorithm 2 to the letter, from a source task of the same size",
    )
    source: str | None = Field(
        default=None,
        min_length=1,
        max_length=128,
        description="Library id of the policy to transfer; null: in service mode the best of the nearest "
        "few, in paper mode the one of the most similar source task",
    )
    samples: int | None = Field(
        default=None,
        ge=0,
        le=MAX_SAMPLES,
        description="Sampled roll-outs beside the greedy one; 0 is the bare greedy roll-out; null: 64, fewer "
        "for large problems. Service mode only",
    )
    replans: int | None = Field(
        default=None,
        ge=0,
        le=MAX_REPLANS,
        description="Sampled roll-outs of two to six UAVs in what the others of the best plan leave; null: "
        "three for each of samples where fine-tuning or polish follows, else none. Service mode only",
    )
    n_epochs: int | None = Field(
        default=None,
        ge=0,
        le=MAX_EPOCHS,
        description="Epochs of fine-tuning; 0: none; null: 200 in paper mode (Table 3), by size in service "
        "mode",
    )
    polish: bool | None = Field(
        default=None,
        description="Local search from the best plan found; null: true. Service mode only",
    )
    polish_moves: int | None = Field(
        default=None,
        ge=0,
        le=MAX_MOVES,
        description="Moves of that local search; null: by size. Service mode only",
    )
    evaluate_per_epoch: int = Field(
        default=1, ge=1, le=MAX_EPOCHS, description="Epochs from one greedy evaluation to the next (Table 3)"
    )
    update_target_params: int = Field(
        default=200,
        ge=1,
        le=MAX_EPOCHS,
        description="Epochs, or updates, from one copy to the target network to the next (Table 3)",
    )
    epsilon_start: float = Field(
        default=0.05, ge=0, le=1, description="Probability of a random action at the beginning"
    )
    drqn_hidden_dim: int = Field(
        default=64, ge=1, le=MAX_HIDDEN_UNITS, description="Hidden units of the agent network (Table 3)"
    )
    qmix_hidden_dim: int = Field(
        default=32, ge=1, le=MAX_HIDDEN_UNITS, description="Hidden units of the mixing network (Table 3)"
    )

    @model_validator(mode="after")
    def _paper_mode_has_no_search(self) -> Self:
        if self.mode == "paper":
            for name in ("samples", "replans", "polish", "polish_moves"):
                if getattr(self, name) is not None:
                    raise ValueError(f"{name} belongs to service mode; in paper mode leave it out")
        return self

    def table_3(self) -> QmixParameters:
        """Return what Algorithm 1 is run with in paper mode."""
        given = {name: getattr(self, name) for name in QmixParameters.model_fields}
        return QmixParameters(
            **{**given, "n_epochs": TABLE_3_EPOCHS if self.n_epochs is None else self.n_epochs}
        )


class DqnParameters(LearningParameters):
    """The method of section 4.1; the paper gives it no table, so it takes Table 1's."""

    hidden_dim: int = Field(
        default=64, ge=1, le=MAX_HIDDEN_UNITS, description="Units of each of the two hidden layers"
    )
