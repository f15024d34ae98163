"""How much of the protocol is run: how many problems, seeds and epochs."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple, Self

from app.reproduction.errors import ImpossibleScale


class Cell(NamedTuple):
    """A size of the grid: M UAVs and N areas, always with three materials as in section 5.1."""

    m: int
    n: int

    def __str__(self) -> str:
        return f"{self.m}x{self.n}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``5x10``.

        Raises
        ------
        ImpossibleScale
            If it is no size of the grid.
        """
        for cell in (*GRID, *SMALL):
            if str(cell) == text:
                return cls(*cell)
        raise ImpossibleScale(f"{text!r} is no size of the grid: {' '.join(map(str, (*GRID, *SMALL)))}")


GRID = tuple(Cell(m, n) for m in (5, 10, 20) for n in (5, 10, 20, 30))
"""Section 5.2.4, with the 5 areas of Figs. 10 and 11."""

SMALL = (Cell(2, 5), Cell(3, 5), Cell(4, 5))
"""Beside the grid, for DQN: its joint action space grows by a factor of six with every UAV."""

SHOWN = (Cell(5, 10), Cell(10, 10), Cell(10, 5))
"""M < N, M = N and M > N: the sizes of Figs. 5 to 11."""

RACE_FAMILIES = ("uniform", "clustered", "deadline", "scarce")
"""Of :mod:`app.simulation.generator`: as the paper's, towns and bases, deadlines, too little for all."""

DRAWN = "drawn"

RACE_PLACES = (*(f"{family}-{cell}" for family in RACE_FAMILIES for cell in GRID), DRAWN)
"""Families and sizes of the race, and problems of no family."""


@dataclass(frozen=True, slots=True)
class Scale:
    """How much is run. The defaults are the full protocol, which takes more than a hundred core hours.

    Attributes
    ----------
    problems, seeds
        Problems a size, and seeds a problem, of everything that is quick.
    learning_problems, learning_seeds
        The same of what learns from nothing: QMIX, DQN, and transfer from a source trained for the purpose.
    epochs
        Epochs of Algorithm 1 at the sizes of the paper's figures (Table 1: 50,000).
    grid_epochs
        Epochs of Algorithm 1 and of DQN elsewhere, and of the sources trained for the purpose.
    service_epochs
        Epochs of `qmix` in service mode.
    reference_moves
        Moves of the long local search that looks for the best known plan.
    nodes
        Nodes of the search tree that proves it.
    timed_problems
        Problems a size on which general optimisers are compared with.
    seconds
        What each gets there.
    cells
        The sizes.
    race_problems, race_seeds
        Problems a place of the race, and seeds a problem.
    race_evaluations
        Plans that each may fly in the race of equal evaluations; in that of equal seconds each has `seconds`.
    race_places
        Families and sizes, by the names of :mod:`app.reproduction.race.places`.
    """

    problems: int = 10
    seeds: int = 5
    learning_problems: int = 10
    learning_seeds: int = 5
    epochs: int = 50_000
    grid_epochs: int = 50_000
    service_epochs: int = 5_000
    reference_moves: int = 8_000_000
    nodes: int = 200
    timed_problems: int = 10
    seconds: float = 1.0
    cells: tuple[Cell, ...] = (*GRID, *SMALL)
    race_problems: int = 10
    race_seeds: int = 5
    race_evaluations: int = 20_000
    race_places: tuple[str, ...] = RACE_PLACES

    def __post_init__(self) -> None:
        for each in fields(self):
            if (
                each.name not in ("cells", "race_places")
                and getattr(self, each.name) < (each.name == "seconds") * 1e-3
            ):
                raise ImpossibleScale(f"{each.name} is {getattr(self, each.name)}")
        if self.problems < max(self.learning_problems, self.timed_problems):
            raise ImpossibleScale(
                f"{self.learning_problems} learning and {self.timed_problems} timed problems are not among "
                f"{self.problems} problems"
            )


QUICK = Scale(
    problems=2,
    seeds=2,
    learning_problems=1,
    learning_seeds=1,
    epochs=1000,
    grid_epochs=300,
    service_epochs=64,
    reference_moves=500_000,
    nodes=20,
    timed_problems=1,
    seconds=0.3,
    race_problems=2,
    race_seeds=1,
    race_evaluations=600,
    race_places=("uniform-5x10", "clustered-5x10", "drawn"),
)
"""What ``--quick`` runs: every experiment, in less than five minutes."""
