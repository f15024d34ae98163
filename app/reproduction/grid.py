"""Which runs there are: the product of sizes, problems, methods and seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from app.domain.problem import Problem
from app.reproduction.methods import GENERAL_OPTIMISERS, METHODS, Breadth, Kind, Method
from app.reproduction.records import TIMED, UNTIMED
from app.reproduction.scale import Cell, Scale
from app.simulation.generator import generate
from app.solvers.registry import parse_parameters

FAMILY = "uniform"
"""The family with the paper's sizes and magnitudes: rewards of one to four at 5 x 10, λ = 1."""

MATERIALS = 3
"""Section 5.1."""

FIRST_SEED = 123
"""Tables 1 to 3."""

PROBLEM_SEED = 2022
"""Problems are drawn from it; the shipped source tasks are drawn from another stream."""


@dataclass(frozen=True, slots=True)
class Run:
    """One solver on one problem with one seed.

    Attributes
    ----------
    cell, problem
        The size, and the problem's number within it.
    method
        A name in :data:`~app.reproduction.methods.METHODS`.
    seed
        Of the solver.
    parameters
        All of the algorithm's, defaults filled in; of a timed run, its seconds.
    """

    cell: Cell
    problem: int
    method: str
    seed: int
    parameters: dict[str, Any]

    @property
    def id(self) -> str:
        """A path without suffix: size, method, problem and seed."""
        return f"{self.cell}/{self.method}-p{self.problem}-s{self.seed}"

    @property
    def how(self) -> Method:
        """The method."""
        return METHODS[self.method]

    @property
    def folder(self) -> str:
        """Where its record is."""
        return TIMED if self.how.kind is Kind.TIMED else UNTIMED

    def as_record(self) -> dict[str, Any]:
        """Return what tells it from other runs, as JSON has it."""
        return {
            "m": self.cell.m,
            "n": self.cell.n,
            "problem": self.problem,
            "method": self.method,
            "seed": self.seed,
            "parameters": self.parameters,
        }


def problem_of(cell: Cell, number: int) -> Problem:
    """Return a problem of a size; the same number is the same problem always."""
    return generate(
        FAMILY, cell.m, cell.n, MATERIALS, np.random.default_rng([PROBLEM_SEED, cell.m, cell.n, number])
    )


def runs_of(scale: Scale) -> list[Run]:
    """List the runs, the longest first; those of packages that are not installed are left out."""
    found = []
    for method in METHODS.values():
        if method.algorithm in GENERAL_OPTIMISERS and find_spec(method.algorithm) is None:
            continue
        for cell in scale.cells:
            if cell in method.cells:
                found += _runs(scale, method, cell)
    return sorted(found, key=lambda run: (-_work(run), run.problem, run.seed))


def _runs(scale: Scale, method: Method, cell: Cell) -> list[Run]:
    problems, seeds = _breadth(scale, method.breadth)
    parameters = method.parameters(scale, cell)
    if method.kind is Kind.SOLVE:
        parameters = parse_parameters(method.algorithm, parameters).model_dump(mode="json")
    return [
        Run(cell, number, method.name, FIRST_SEED + seed, parameters)
        for number in range(problems)
        for seed in range(seeds)
    ]


def _breadth(scale: Scale, breadth: Breadth) -> tuple[int, int]:
    return {
        Breadth.ALL: (scale.problems, scale.seeds),
        Breadth.LEARNING: (scale.learning_problems, scale.learning_seeds),
        Breadth.ONCE: (scale.problems, 1),
        Breadth.TIMED: (scale.timed_problems, 1),
    }[breadth]


def _work(run: Run) -> float:
    """About how long it takes, to begin with what would otherwise be waited for at the end."""
    epochs = (run.parameters.get("n_epochs") or 0) if run.how.breadth is Breadth.LEARNING else 0
    joint = 6.0**run.cell.m if run.how.algorithm == "dqn" else 0.0
    return float(epochs * (run.cell.m * run.cell.n + joint / 10))


def missing_packages() -> Sequence[str]:
    """Name the packages of general optimisers that are not installed."""
    return [name for name in GENERAL_OPTIMISERS if find_spec(name) is None]
