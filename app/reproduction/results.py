"""The records, read back: rewards by size, method, problem and seed, and what they are compared with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, pstdev

import numpy as np
import numpy.typing as npt

from app.reproduction.grid import Run
from app.reproduction.methods import METHODS, Kind
from app.reproduction.records import RecordStore
from app.reproduction.scale import Cell

Curves = npt.NDArray[np.float64]

_SAME = 1e-9
"""Relative difference below which two rewards are one."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One finished run.

    Attributes
    ----------
    run
        What was run.
    reward
        Of the plan, flown again by the simulator.
    epochs, curve
        The history: epochs and rewards, of one length.
    bound, proven
        Of `exact`: no greedily unloading plan earns more than `bound`; whether its plan reaches it.
    seconds
        What the solver took.
    legal
        Whether the plan could be flown.
    """

    run: Run
    reward: float
    epochs: tuple[int, ...]
    curve: tuple[float, ...]
    bound: float | None
    proven: bool
    seconds: float
    legal: bool


@dataclass(frozen=True, slots=True)
class Spread:
    """A mean and how far its parts lie apart.

    Attributes
    ----------
    mean
        Over problems and seeds.
    problems
        Standard deviation of the problems' means.
    seeds
        Standard deviation over the seeds of a problem, root mean square over problems.
    lowest
        The least value.
    count
        Values.
    """

    mean: float
    problems: float
    seeds: float
    lowest: float
    count: int


class Results:
    """What a set of runs came to.

    Parameters
    ----------
    runs
        All of them finished.
    store
        Where their records are.

    Raises
    ------
    KeyError
        If a run has no record.
    """

    def __init__(self, runs: Iterable[Run], store: RecordStore) -> None:
        self._entries: dict[tuple[Cell, str], list[Entry]] = {}
        self.sources: set[tuple[str, str, str]] = set()
        for run in sorted(runs, key=lambda each: (each.cell, each.method, each.problem, each.seed)):
            self._entries.setdefault((run.cell, run.method), []).append(self._read(run, store))
        self.cells = tuple(sorted({cell for cell, _ in self._entries}))
        self._best, self._bounds = self._references()

    def _read(self, run: Run, store: RecordStore) -> Entry:
        record, timing = store.read(run), store.timing(run)
        if record is None or timing is None:
            raise KeyError(run.id)
        self.sources.add((timing["commit"], timing["machine"], timing["versions"]))
        history = record.get("history") or {"epoch": [], "reward": []}
        return Entry(
            run,
            record["reward"],
            tuple(history["epoch"]),
            tuple(history["reward"]),
            record.get("bound"),
            bool(record.get("proven")),
            timing["seconds"],
            record["legal"],
        )

    def _references(self) -> tuple[dict[tuple[Cell, int], float], dict[tuple[Cell, int], float]]:
        best: dict[tuple[Cell, int], float] = {}
        bounds: dict[tuple[Cell, int], float] = {}
        for (cell, method), entries in self._entries.items():
            for entry in entries:
                key = cell, entry.run.problem
                # What a time limit ends differs from run to run, and with it every ratio would.
                if METHODS[method].kind is not Kind.TIMED:
                    best[key] = max(best.get(key, 0.0), entry.reward)
                if entry.bound is not None:
                    bounds[key] = entry.bound
        return best, bounds

    def entries(self, cell: Cell, method: str) -> Sequence[Entry]:
        """Return a method's runs at a size, by problem and seed; none where it was not run there."""
        return self._entries.get((cell, method), [])

    def methods(self, cell: Cell) -> list[str]:
        """Name the methods that were run at a size, in the order of the table of methods."""
        return [name for name in METHODS if (cell, name) in self._entries]

    def best_known(self, cell: Cell, problem: int) -> float:
        """Return the largest reward of any run without a time limit; 0 where staying at home is best."""
        return self._best[cell, problem]

    def bound(self, cell: Cell, problem: int) -> float | None:
        """Return the bound of `exact`, at least the best known reward; None where it was not run."""
        bound = self._bounds.get((cell, problem))
        return None if bound is None else max(bound, self._best[cell, problem])

    def problems(self, cell: Cell) -> list[int]:
        """List the numbers of a size's problems."""
        return sorted(number for each, number in self._best if each == cell)

    def ratio(self, entry: Entry, reward: float | None = None) -> float:
        """Return a reward's share of the best known; a run's own reward where none is given."""
        best = self.best_known(entry.run.cell, entry.run.problem)
        earned = entry.reward if reward is None else reward
        return earned / best if best > 0 else float(earned >= -_SAME)

    def is_best(self, entry: Entry) -> bool:
        """Whether a run found a plan as good as the best known one."""
        best = self.best_known(entry.run.cell, entry.run.problem)
        return entry.reward >= best - _SAME * max(1.0, best)

    def ratios(self, cell: Cell, method: str) -> Spread | None:
        """Return the spread of a method's share of the best known; None where it was not run."""
        return spread([(e.run.problem, self.ratio(e)) for e in self.entries(cell, method)])

    def policy_ratios(self, cell: Cell, method: str) -> Spread | None:
        """Return the same of what the history ends with: of the paper's learners the greedy policy alone."""
        entries = [e for e in self.entries(cell, method) if e.curve]
        return spread([(e.run.problem, self.ratio(e, e.curve[-1])) for e in entries])

    def curves(self, cell: Cell, method: str) -> tuple[tuple[int, ...], Curves] | None:
        """Return epochs and, a row a run, the share of the best known; None where it was not run."""
        entries = self.entries(cell, method)
        if not entries:
            return None
        longest = max((e.epochs for e in entries), key=len)
        rows = [
            # A run ends early where nothing can be flown; it stays where it is.
            [self.ratio(e, value) for value in (*e.curve, *[e.curve[-1]] * (len(longest) - len(e.curve)))]
            for e in entries
        ]
        return longest, np.array(rows)

    def quotient(self, cell: Cell, method: str, other: str) -> list[float]:
        """Return, by problem that both solved, one method's mean reward over another's."""
        found = []
        for number in self.problems(cell):
            ours = [e.reward for e in self.entries(cell, method) if e.run.problem == number]
            theirs = [e.reward for e in self.entries(cell, other) if e.run.problem == number]
            if ours and theirs and fmean(theirs) > 0:
                found.append(fmean(ours) / fmean(theirs))
        return found


def spread(values: Iterable[tuple[int, float]]) -> Spread | None:
    """Summarise values by problem; None where there are none."""
    by_problem: dict[int, list[float]] = {}
    for problem, value in values:
        by_problem.setdefault(problem, []).append(value)
    if not by_problem:
        return None
    everything = [value for each in by_problem.values() for value in each]
    return Spread(
        fmean(everything),
        pstdev([fmean(each) for each in by_problem.values()]),
        fmean(pstdev(each) ** 2 for each in by_problem.values()) ** 0.5,
        min(everything),
        len(everything),
    )
