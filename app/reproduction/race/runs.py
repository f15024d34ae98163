"""Which runs the race has: the product of places, problems, entrants and seeds."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from app.reproduction.grid import FIRST_SEED
from app.reproduction.methods import GENERAL_OPTIMISERS
from app.reproduction.race.entrants import ENTRANTS, Budget, Entrant
from app.reproduction.race.places import Place
from app.reproduction.records import TIMED, UNTIMED
from app.reproduction.scale import SHOWN, Scale
from app.solvers.registry import parse_parameters


@dataclass(frozen=True, slots=True)
class RaceRun:
    """One entrant on one problem with one seed.

    Attributes
    ----------
    place, problem
        Where, and the problem's number there.
    method
        A name in :data:`~app.reproduction.race.entrants.ENTRANTS`.
    seed
        Of the solver.
    parameters
        All of the algorithm's, defaults filled in.
    seconds
        Of a timed run.
    """

    place: Place
    problem: int
    method: str
    seed: int
    parameters: dict[str, Any]
    seconds: float | None

    @property
    def id(self) -> str:
        """A path without suffix."""
        return f"race/{self.place}/{self.method}-p{self.problem}-s{self.seed}"

    @property
    def how(self) -> Entrant:
        """The entrant."""
        return ENTRANTS[self.method]

    @property
    def folder(self) -> str:
        """Where its record is."""
        return UNTIMED if self.seconds is None else TIMED

    def as_record(self) -> dict[str, Any]:
        """Return what tells it from other runs, as JSON has it."""
        return {
            "place": str(self.place),
            "problem": self.problem,
            "method": self.method,
            "seed": self.seed,
            "parameters": self.parameters,
            "seconds": self.seconds,
        }


def race_runs(scale: Scale) -> list[RaceRun]:
    """List the runs, problem by problem; those of packages that are not installed are left out."""
    found = []
    for entrant in ENTRANTS.values():
        if entrant.algorithm in GENERAL_OPTIMISERS and find_spec(entrant.algorithm) is None:
            continue
        for text in scale.race_places:
            place = Place.parse(text)
            if not entrant.learns or place.cell in SHOWN:
                found += _runs(scale, entrant, place)
    return sorted(found, key=lambda run: (run.problem, run.seed, not run.how.learns))


def _runs(scale: Scale, entrant: Entrant, place: Place) -> list[RaceRun]:
    problems, seeds = scale.race_problems, scale.race_seeds
    if entrant.learns:
        problems, seeds = min(problems, scale.learning_problems), min(seeds, scale.learning_seeds)
    if entrant.budget is Budget.REFERENCE:
        seeds = min(seeds, 1)
    parameters = entrant.parameters(scale)
    if entrant.algorithm not in GENERAL_OPTIMISERS:
        parameters = parse_parameters(entrant.algorithm, parameters).model_dump(mode="json")
    seconds = scale.seconds if entrant.budget is Budget.SECONDS else None
    return [
        RaceRun(place, number, entrant.name, FIRST_SEED + seed, parameters, seconds)
        for number in range(problems)
        for seed in range(seeds)
    ]
