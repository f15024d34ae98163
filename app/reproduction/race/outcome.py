"""The race's records, read back: shares of the best known reward by entrant, place, problem and seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.reproduction.race.entrants import ENTRANTS, Budget
from app.reproduction.race.places import PLACES, Place
from app.reproduction.race.runs import RaceRun
from app.reproduction.race.statistics import Floats
from app.reproduction.records import RecordStore

_SAME = 1e-9
"""Relative difference below which two rewards are one."""


@dataclass(frozen=True, slots=True)
class Finish:
    """One finished run.

    Attributes
    ----------
    run
        What was run.
    reward
        Of the plan, flown again by the simulator; None where the problem was refused.
    evaluations, curve
        The history: evaluations made, and the best reward then.
    """

    run: RaceRun
    reward: float | None
    evaluations: tuple[int, ...]
    curve: tuple[float, ...]


class Outcome:
    """What the race came to.

    Parameters
    ----------
    runs
        All of them finished.
    store
        Where their records are.

    Attributes
    ----------
    sources
        Commits, machines and versions.
    places
        Where it was run.

    Raises
    ------
    KeyError
        If a run has no record.
    """

    def __init__(self, runs: Sequence[RaceRun], store: RecordStore) -> None:
        self.sources: set[tuple[str, str, str]] = set()
        self._finishes: dict[tuple[str, Place], list[Finish]] = {}
        self._best: dict[tuple[Place, int], float] = {}
        self._proven: set[tuple[Place, int]] = set()
        for run in sorted(runs, key=lambda each: (each.problem, each.seed)):
            self._read(run, store)
        ran = {run.place for run in runs}
        self.places = [place for place in PLACES if place in ran]

    def _read(self, run: RaceRun, store: RecordStore) -> None:
        record, timing = store.read(run), store.timing(run)
        if record is None or timing is None:
            raise KeyError(run.id)
        self.sources.add((timing["commit"], timing["machine"], timing["versions"]))
        history = record.get("history") or {"epoch": [], "reward": []}
        finish = Finish(
            run,
            record.get("reward"),
            tuple(map(run.how.evaluations, history["epoch"])),
            tuple(history["reward"]),
        )
        self._finishes.setdefault((run.method, run.place), []).append(finish)
        key = run.place, run.problem
        # What a time limit ends differs from run to run, and with it every share would.
        if run.seconds is None and finish.reward is not None:
            self._best[key] = max(self._best.get(key, 0.0), finish.reward)
        if record.get("proven"):
            self._proven.add(key)

    def entrants(self, budget: Budget) -> list[str]:
        """Name those that ran for a budget, and the references beside them, in the order of the list."""
        ran = {name for name, _ in self._finishes}
        return [n for n, each in ENTRANTS.items() if n in ran and each.budget in (budget, Budget.REFERENCE)]

    def finishes(self, name: str, place: Place) -> Sequence[Finish]:
        """Return an entrant's runs at a place, by problem and seed."""
        return self._finishes.get((name, place), [])

    def share(self, finish: Finish, reward: float | None = None) -> float:
        """Return a reward's share of the best known; the run's own where none is given."""
        best = self._best[finish.run.place, finish.run.problem]
        earned = finish.reward if reward is None else reward
        assert earned is not None
        return earned / best if best > _SAME else float(earned >= -_SAME)

    def proven(self, place: Place) -> int:
        """Return on how many problems of a place the best known reward is proven."""
        return sum(each == place for each, _ in self._proven)

    def shares(self, name: str, place: Place, numbers: set[int] | None = None) -> Floats | None:
        """Return shares of the best known, (P, S), of the problems that were not refused; None without any.

        Parameters
        ----------
        name, place
            Whose, and where.
        numbers
            Of the problems; None: all.
        """
        rows: dict[int, list[float]] = {}
        for finish in self.finishes(name, place):
            if finish.reward is not None and (numbers is None or finish.run.problem in numbers):
                rows.setdefault(finish.run.problem, []).append(self.share(finish))
        return np.array([rows[number] for number in sorted(rows)]) if rows else None

    def solved(self, name: str, place: Place) -> set[int]:
        """Return the numbers of the problems that an entrant ran on and did not refuse."""
        return {f.run.problem for f in self.finishes(name, place) if f.reward is not None}

    def strata(self, name: str) -> list[Floats]:
        """Return the shares of an entrant at every place where it ran."""
        found = [self.shares(name, place) for place in self.places]
        return [each for each in found if each is not None]

    def refused(self, name: str) -> int:
        """Return how many runs of an entrant were refused."""
        return sum(f.reward is None for place in self.places for f in self.finishes(name, place))
