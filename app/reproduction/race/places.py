"""Where the race is run: sizes of the paper in several families, and drawn problems of no family."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from app.domain.problem import Problem
from app.reproduction.errors import ImpossibleScale
from app.reproduction.grid import FAMILY, MATERIALS, PROBLEM_SEED, problem_of
from app.reproduction.scale import DRAWN, GRID, RACE_FAMILIES, Cell
from app.simulation.drawn_generator import drawn, drawn_size
from app.simulation.generator import generate

_MOST_DRAWN = (20, 60)
"""UAVs and areas of a drawn problem, at most."""


class Place(NamedTuple):
    """A family and a size; drawn problems have sizes of their own.

    Attributes
    ----------
    family
        One of :data:`~app.reproduction.scale.RACE_FAMILIES`, or ``drawn``.
    cell
        The size; None for drawn problems.
    """

    family: str
    cell: Cell | None

    def __str__(self) -> str:
        return self.family if self.cell is None else f"{self.family}-{self.cell}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``clustered-5x10`` or ``drawn``.

        Raises
        ------
        ImpossibleScale
            If there is no such place.
        """
        for place in PLACES:
            if str(place) == text:
                return cls(*place)
        raise ImpossibleScale(f"{text!r} is no place of the race: {' '.join(map(str, PLACES))}")

    def problem(self, number: int) -> Problem:
        """Return a problem; the same number is the same problem always."""
        if self.cell is None:
            rng = np.random.default_rng([PROBLEM_SEED, number])
            return drawn(*drawn_size(rng, *_MOST_DRAWN), rng)
        if self.family == FAMILY:
            return problem_of(self.cell, number)
        seeds = [PROBLEM_SEED, RACE_FAMILIES.index(self.family), self.cell.m, self.cell.n, number]
        return generate(self.family, self.cell.m, self.cell.n, MATERIALS, np.random.default_rng(seeds))


PLACES = (*(Place(family, cell) for family in RACE_FAMILIES for cell in GRID), Place(DRAWN, None))
"""All places; their names are :data:`~app.reproduction.scale.RACE_PLACES`."""

RACE_PROBLEMS = (
    f"problems of the places named, drawn from seeds that begin with {PROBLEM_SEED}, numbers from 0"
)
"""The problems, in words."""
