"""What every algorithm is: one small protocol, and the words it speaks.

A solver is built from its parameters and a context, then solves problems. It is found by name in
:mod:`app.solvers.registry`; service, command line, dashboard and benchmarks know no other way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from pydantic import BaseModel, ConfigDict

from app.domain.plan import Plan
from app.domain.problem import Problem

STORED = "stored"
"""Key of the validation's context that is true where parameters come from what a version before stored."""


class Parameters(BaseModel):
    """Base of every algorithm's parameters: frozen, strict, nothing unknown, every field described."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def no_spare_threads() -> int:
    """No core is idle."""
    return 0


@dataclass(frozen=True, slots=True)
class SolverContext:
    """What a solver may use besides the problem.

    Attributes
    ----------
    library_url
        Database of the policy library, or None where there is none.
    threads
        Cores it may keep busy, at least 1.
    spare_threads
        Returns how many more it may keep busy at this moment, because nobody else does. Where what it finds
        depends on their number, that is for searches under a time limit, which depend on the moment anyway.
    """

    library_url: str | None = None
    threads: int = 1
    spare_threads: Callable[[], int] = no_spare_threads


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a solver is.

    Attributes
    ----------
    fraction
        Of the work, 0 to 1.
    epoch
        Generations, training epochs or rounds done.
    best_reward
        True reward of the incumbent.
    incumbent
        The best plan so far.
    """

    fraction: float
    epoch: int
    best_reward: float
    incumbent: Plan


Report = Callable[[Progress], None]


class StopCriterion(Protocol):
    """Says when to end early, and how long that leaves.

    Asking does not change it, and costs little enough to ask every epoch. :mod:`app.solvers.stop` has
    criteria, and what puts one together from others.
    """

    def __call__(self) -> bool:
        """Return True once the solver should return its incumbent."""
        ...

    def seconds_left(self) -> float:
        """Return the seconds of the time limit that are left; infinity where there is none.

        Once they are zero or less, calling it returns True.
        """
        ...


MOST_EVALUATIONS = 10_000
"""In a history; even."""


@dataclass(slots=True)
class History:
    """Reward against epoch, as in the paper's figures; two lists of one length.

    A long run would make an answer that takes long to send: beyond :data:`MOST_EVALUATIONS` every second
    evaluation is dropped, and from then on only every second one kept, and so on. The first and the newest
    stay.
    """

    epoch: list[int] = field(default_factory=list)
    reward: list[float] = field(default_factory=list)
    _every: int = field(default=1, init=False, repr=False, compare=False)
    _since_kept: int = field(default=0, init=False, repr=False, compare=False)

    def add(self, epoch: int, reward: float) -> None:
        """Append one evaluation."""
        if self._since_kept:
            self.epoch.pop()
            self.reward.pop()
        self.epoch.append(epoch)
        self.reward.append(reward)
        self._since_kept = (self._since_kept + 1) % self._every
        if len(self.epoch) > MOST_EVALUATIONS and not self._since_kept:
            del self.epoch[1::2], self.reward[1::2]
            self._every *= 2


@dataclass(frozen=True, slots=True)
class SourcePolicy:
    """The library's policy that was transferred, and its distance to the problem."""

    id: str
    name: str
    distance: float


@dataclass(frozen=True, slots=True)
class Proof:
    """What an algorithm knows of plans that it has not found.

    Attributes
    ----------
    bound
        No plan earns more that unloads as the algorithm's do: greedily, or with planned amounts.
    proven
        Whether the plan reaches it, so that it is the best there is.
    """

    bound: float
    proven: bool


@dataclass(frozen=True, slots=True)
class Solution:
    """What a solver found.

    Attributes
    ----------
    plan
        The incumbent; legal, and never absent: where nothing can be flown it sends everybody home.
    history
        Reward against epoch.
    parameters
        The parameters as they were used, defaults filled in.
    source_policy
        The transferred policy, if any.
    checkpoint
        What was learned, as a checkpoint of :mod:`app.learning.checkpoints.checkpoint`, or None.
    proof
        How good the plan is, if the algorithm knows.
    answered_by
        The algorithm whose plan it is, by its name in the registry, where it is not this one's; else None.
    """

    plan: Plan
    history: History
    parameters: Parameters
    source_policy: SourcePolicy | None = None
    checkpoint: bytes | None = None
    proof: Proof | None = None
    answered_by: str | None = None


class Solver(Protocol):
    """An algorithm. ``__init__(parameters, context)`` builds it; one object may solve many problems."""

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """Find a plan.

        Parameters
        ----------
        problem
            The problem.
        seed
            0 or more; source of all randomness: the same problem, seed and parameters give the same solution
            as long as `stop` does not end it early.
        stop
            Asked at least every few milliseconds of work, where the algorithm allows.
        report
            Told about progress; may be called often.

        Returns
        -------
        Solution
            The best plan found by its true reward, also when `stop` was true from the beginning.

        Raises
        ------
        ProblemTooLarge
            If the algorithm cannot hold the problem.
        NoCompatibleSource
            If it transfers and the library has nothing to transfer.
        """
        ...
