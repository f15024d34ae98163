"""Parameters of the learners, by the paper's names (Tables 1 and 3); no torch here.

Tables 1 and 3 also list ``seed``, which is the request's. What the tables leave out comes from the family of
public QMIX implementations whose parameter names the paper uses.

A parameter that only one mode of an algorithm has a use for says so in its schema, under ``modes``. It is
null by default, and that mode fills it in; the other mode refuses it, unless it is what that mode has anyway,
so that what an answer says was used can be asked for again.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from app.solvers.protocol import STORED, Parameters

MAX_EPOCHS = 10_000_000
MAX_STORED_EPISODES = 100_000
MAX_HIDDEN_UNITS = 1024
MAX_SAMPLES = 100_000
REPLANS_A_SAMPLE = 3
MAX_REPLANS = REPLANS_A_SAMPLE * MAX_SAMPLES
MAX_ORDERS = 1000
MAX_MOVES = 10_000_000_000

TABLE_3_EPOCHS = 200

LEARNING_RATE, FINE_TUNING_LR = 1e-3, 1e-4
"""Of Adam in service mode: from nothing, and from a policy of the library."""

SERVICE_GRAD_NORM_CLIP = 1.0
"""Largest norm of the gradient in service mode."""

SERVICE_EPSILON = 0.2
"""Chance, in service mode, that a turn of every other episode is any that is allowed: where a policy has
become sure, no temperature makes it try something else, and recombination needs routes that are new."""

Mode = Literal["service", "paper"]

_MODES = "modes"
_PAPER = Field(json_schema_extra={_MODES: ["paper"]})
_SERVICE = Field(json_schema_extra={_MODES: ["service"]})

_EVALUATE = Field(ge=1, le=MAX_EPOCHS)
_BATCH = Field(ge=1, le=4096, description="Episodes an update (Table 1)")
_BUFFER = Field(ge=1, le=MAX_STORED_EPISODES, description="Episodes the replay buffer holds (Table 1: 100)")
_COPIES = Field(
    ge=1,
    le=MAX_EPOCHS,
    description="Epochs from one copy to the target network to the next (Tables 1 and 3: 200)",
)
_LR = Field(gt=0, le=1, description="Learning rate of RMSprop (5e-4); service mode has its own, of Adam")
_GAMMA = Field(ge=0, le=1, description="Discount")
_CLIP = Field(gt=0, le=1e6, description="Largest norm of the gradient (10); service mode has its own")
_EPSILON_START = Field(ge=0, le=1, description="Probability of a random action at the beginning")
_EPSILON_END = Field(ge=0, le=1, description="Probability of a random action after the annealing (0.05)")
_ANNEALING = Field(
    ge=1, le=1_000_000_000, description="Environment steps over which it changes, linearly (50,000)"
)
_STARTS = Field(
    ge=1,
    le=MAX_STORED_EPISODES,
    description="Stored episodes before the first update; null: a full buffer (Algorithm 1, line 10)",
)
_AGENT_UNITS = Field(ge=1, le=MAX_HIDDEN_UNITS, description="Hidden units of the agent network (Table 1: 64)")
_MIXER_UNITS = Field(
    ge=1, le=MAX_HIDDEN_UNITS, description="Hidden units of the mixing network (Table 1: 32)"
)
_EVALUATE_TEXT = "Epochs from one greedy evaluation to the next"


class LearningParameters(Parameters):
    """How a learner plays, stores and updates: Table 1, and the decisions it leaves open."""

    n_epochs: int = Field(
        default=50_000, ge=0, le=MAX_EPOCHS, description="Epochs; one episode and one update each (Table 1)"
    )
    evaluate_per_epoch: Annotated[int, _EVALUATE] = Field(
        default=100, description=f"{_EVALUATE_TEXT} (Table 1)"
    )
    batch_size: Annotated[int, _BATCH] = 32
    buffer_size: Annotated[int, _BUFFER] = 100
    update_target_params: Annotated[int, _COPIES] = 200
    lr: Annotated[float, _LR] = 5e-4
    gamma: Annotated[float, _GAMMA] = 0.99
    grad_norm_clip: Annotated[float, _CLIP] = 10.0
    epsilon_start: Annotated[float, _EPSILON_START] = 1.0
    epsilon_end: Annotated[float, _EPSILON_END] = 0.05
    epsilon_anneal_steps: Annotated[int, _ANNEALING] = 50_000
    learning_starts: Annotated[int | None, _STARTS] = None

    @property
    def first_update(self) -> int:
        """Stored episodes before the first update; a full buffer is always enough."""
        return min(self.learning_starts or self.buffer_size, self.buffer_size)


class TableParameters(LearningParameters):
    """Everything that Algorithm 1 is run with."""

    drqn_hidden_dim: Annotated[int, _AGENT_UNITS] = 64
    qmix_hidden_dim: Annotated[int, _MIXER_UNITS] = 32


class _ModalParameters(Parameters):
    """Parameters of an algorithm with two modes; what only paper mode updates its networks by is here."""

    fixed_in_service: ClassVar[Mapping[str, float]] = {}
    """What service mode has in place of parameters of paper mode."""

    mode: Mode = Field(default="service", description="How it learns")
    batch_size: Annotated[int, _BATCH] = 32
    gamma: Annotated[float, _GAMMA] = 0.99
    buffer_size: Annotated[int | None, _BUFFER, _PAPER] = None
    update_target_params: Annotated[int | None, _COPIES, _PAPER] = None
    lr: Annotated[float | None, _LR, _PAPER] = None
    grad_norm_clip: Annotated[float | None, _CLIP, _PAPER] = None
    epsilon_start: Annotated[float | None, _EPSILON_START, _PAPER] = None
    epsilon_end: Annotated[float | None, _EPSILON_END, _PAPER] = None
    epsilon_anneal_steps: Annotated[int | None, _ANNEALING, _PAPER] = None
    learning_starts: Annotated[int | None, _STARTS, _PAPER] = None

    @classmethod
    def modes_of(cls, name: str) -> list[str] | None:
        """Return the modes that have a use for a parameter; None for all of them."""
        extra = cls.model_fields[name].json_schema_extra
        modes = extra.get(_MODES) if isinstance(extra, dict) else None
        return None if modes is None else [str(mode) for mode in modes]  # type: ignore[union-attr]  # ours are lists

    @model_validator(mode="before")
    @classmethod
    def _leave_out_what_was_stored(cls, given: Any, info: ValidationInfo) -> Any:
        """Earlier versions stored a default for every parameter, whether the mode had a use for it or not."""
        if not isinstance(given, Mapping) or not (info.context or {}).get(STORED):
            return given
        mode = given.get("mode", "service")
        return {name: value for name, value in given.items() if not cls._is_useless(name, mode)}

    @classmethod
    def _is_useless(cls, name: str, mode: object) -> bool:
        modes = cls.modes_of(name) if name in cls.model_fields else None
        return modes is not None and mode not in modes

    @field_validator("*", mode="after")
    @classmethod
    def _refuse_what_the_mode_has_no_use_for(cls, value: object, info: ValidationInfo) -> object:
        # The mode is the first field, so it is known here unless it was refused itself.
        name, mode = str(info.field_name), info.data.get("mode")
        if value is None or mode is None or not cls._is_useless(name, mode):
            return value
        fixed = cls.fixed_in_service.get(name) if mode == "service" else None
        if value == fixed:
            return value
        modes = " and ".join(cls.modes_of(name) or ())
        own = "has no use for it" if fixed is None else f"always has {fixed:g}"
        raise PydanticCustomError(
            "useless_parameter",
            "{name} belongs to {modes} mode; {mode} mode {own}, so it cannot be {value}",
            {"name": name, "modes": modes, "mode": mode, "own": own, "value": repr(value)},
        )

    @model_validator(mode="after")
    def _fill_in(self) -> Self:
        """Fill in the paper's values where the mode is the paper's."""
        if self.mode == "paper":
            for name, value in self.table().model_dump(exclude={"n_epochs"}).items():
                object.__setattr__(self, name, value)
        return self

    @abstractmethod
    def table(self) -> TableParameters:
        """Return what Algorithm 1 is run with; service mode does so where its own networks cannot be used."""

    def in_paper(self) -> Self:
        """Return what paper mode is run with."""
        return self.model_copy(update={"mode": "paper", **self.table().model_dump()})

    def in_service(self) -> Self:
        """Return what service mode is run with."""
        return self.model_copy(update=dict(self.fixed_in_service))

    def _with_table(self, defaults: TableParameters) -> TableParameters:
        given = {name: getattr(self, name) for name in TableParameters.model_fields}
        return defaults.model_copy(update={name: v for name, v in given.items() if v is not None})


class QmixParameters(_ModalParameters):
    """Table 1 of the paper."""

    fixed_in_service: ClassVar[Mapping[str, float]] = {
        "lr": LEARNING_RATE,
        "grad_norm_clip": SERVICE_GRAD_NORM_CLIP,
        "epsilon_start": SERVICE_EPSILON,
        "epsilon_end": SERVICE_EPSILON,
    }

    mode: Mode = Field(
        default="service",
        description="service: the networks for every size, learned on the problem alone, up to about "
        "20 x 30; paper: Algorithm 1 to the letter",
    )
    n_epochs: int = Field(
        default=50_000, ge=0, le=MAX_EPOCHS, description="Epochs; one episode and one update each (Table 1)"
    )
    evaluate_per_epoch: Annotated[int, _EVALUATE] = Field(
        default=100, description=f"{_EVALUATE_TEXT} (Table 1)"
    )
    drqn_hidden_dim: Annotated[int, _AGENT_UNITS] = 64
    qmix_hidden_dim: Annotated[int, _MIXER_UNITS] = 32

    def table(self) -> TableParameters:
        """Return Table 1 with what is asked for."""
        return self._with_table(TableParameters())


class TransferQmixParameters(_ModalParameters):
    """Table 3 of the paper, and what the service's own mode adds.

    In paper mode exploration begins where a trained policy's ends.
    """

    fixed_in_service: ClassVar[Mapping[str, float]] = {
        **QmixParameters.fixed_in_service,
        "lr": FINE_TUNING_LR,
    }

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
    orders: Annotated[int | None, _SERVICE] = Field(
        default=None,
        ge=1,
        le=MAX_ORDERS,
        description="Roll-outs that policies are tried with: one is greedy, the others are sampled at a low "
        "temperature; 1 is one policy, once; null: up to 12, by size",
    )
    samples: Annotated[int | None, _SERVICE] = Field(
        default=None,
        ge=0,
        le=MAX_SAMPLES,
        description="Sampled roll-outs beside the greedy ones; 0: none; null: 64, fewer for large problems",
    )
    replans: Annotated[int | None, _SERVICE] = Field(
        default=None,
        ge=0,
        le=MAX_REPLANS,
        description="Sampled roll-outs of two to six UAVs in what the others of the best plan leave; null: "
        "three for each of samples where no polish follows, else none",
    )
    recombine: Annotated[bool | None, _SERVICE] = Field(
        default=None,
        description="Whether routes of all episodes, and of the greedy rule's plan, are put together to "
        "plans, UAV by UAV; null: true, but for a single roll-out",
    )
    n_epochs: int | None = Field(
        default=None,
        ge=0,
        le=MAX_EPOCHS,
        description="Epochs of fine-tuning; 0: none; null: 200 in paper mode (Table 3), by size in service "
        "mode",
    )
    polish: Annotated[bool | None, _SERVICE] = Field(
        default=None, description="Local search from the best plan found; null: true"
    )
    polish_moves: Annotated[int | None, _SERVICE] = Field(
        default=None, ge=0, le=MAX_MOVES, description="Moves of that local search; null: by size"
    )
    evaluate_per_epoch: Annotated[int, _EVALUATE] = Field(
        default=1, description=f"{_EVALUATE_TEXT} (Table 3)"
    )
    drqn_hidden_dim: Annotated[int | None, _AGENT_UNITS, _PAPER] = None
    qmix_hidden_dim: Annotated[int | None, _MIXER_UNITS, _PAPER] = None

    def table(self) -> TableParameters:
        """Return Table 3 with what is asked for."""
        return self._with_table(TableParameters(n_epochs=TABLE_3_EPOCHS, epsilon_start=0.05))


class DqnParameters(LearningParameters):
    """The method of section 4.1; the paper gives it no table, so it takes Table 1's."""

    hidden_dim: int = Field(
        default=64, ge=1, le=MAX_HIDDEN_UNITS, description="Units of each of the two hidden layers"
    )
