"""Tables, each as Markdown for people and as CSV for programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.learning.paper.joint_environment import MAX_JOINT_ACTIONS
from app.reproduction.grid import MATERIALS
from app.reproduction.methods import METHODS, Kind
from app.reproduction.results import Results, Spread, spread
from app.reproduction.scale import GRID, SMALL, Cell

Value = str | int | float | None

_HIDDEN = 64
_BYTES = 4
"""Of a weight of DQN's output layer, each joint action with 64 weights and a bias."""

_PAPER_SECONDS = {"ga": 6, "qmix-paper": 120, "transfer-paper": 8}
"""Table 4, on an Apple M1 Pro."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table.

    Attributes
    ----------
    name
        Of its files.
    title, notes
        Above and below it in Markdown.
    columns, rows
        What it holds; floats are written with four digits after the point in Markdown, in full in CSV.
    timed
        Whether it depends on how long something took.
    """

    name: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Value]]
    notes: str = ""
    timed: bool = False

    def write(self, folder: Path, provenance: str) -> None:
        """Write ``name.md``, with where it comes from, and ``name.csv``, whose first line says so."""
        folder.mkdir(parents=True, exist_ok=True)
        head = [f"# {self.title}", "", _row(self.columns), _row(["---"] * len(self.columns))]
        lines = [*head, *(_row(map(_shown, row)) for row in self.rows)]
        tail = [f"\n{self.notes}"] if self.notes else []
        text = "\n".join([*lines, *tail, f"\n{provenance}"]) + "\n"
        (folder / f"{self.name}.md").write_text(text, encoding="utf-8")
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow([f"# {provenance}"])
        writer.writerows([self.columns, *self.rows])
        (folder / f"{self.name}.csv").write_text(buffer.getvalue(), encoding="utf-8")


def _row(cells: Iterable[object]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"


def _shown(value: Value) -> str:
    if value is None:
        return "–"
    return f"{value:.4f}" if isinstance(value, float) else str(value)


def tables(results: Results) -> list[Table]:
    """Return all tables but that of claims."""
    return [
        overview(results),
        grid(results),
        references(results),
        action_space(),
        runs(results),
        running_times(results),
        general_optimisers(results),
    ]


def overview(results: Results) -> Table:
    """A row a size, a column a method: the mean share of the best known."""
    names = [name for name, method in METHODS.items() if method.kind is not Kind.TIMED]
    rows: list[list[Value]] = []
    for cell in results.cells:
        found = [results.ratios(cell, name) for name in names]
        rows.append([str(cell), *(None if each is None else f"{each.mean:.3f}" for each in found)])
    notes = (
        "Mean share of the best known reward, over problems and seeds; – where a method is not run. The "
        "paper's learners are given the best plan that they ever saw, not the policy's last one. `grid` has "
        "the spread."
    )
    return Table("overview", "Share of the best known reward", ["size", *names], rows, notes)


def grid(results: Results) -> Table:
    """A row a size and method: mean and spread."""
    columns = [
        "size", "method", "runs", "mean reward", "mean share", "spread of problems", "spread of seeds",
        "lowest share", "runs that found the best known", "share of what the history ends with",
    ]  # fmt: skip
    rows: list[list[Value]] = []
    for cell in results.cells:
        for name in results.methods(cell):
            if METHODS[name].kind is Kind.TIMED:
                continue
            entries, found = results.entries(cell, name), results.ratios(cell, name)
            policy = results.policy_ratios(cell, name)
            assert found is not None
            mean = sum(e.reward for e in entries) / len(entries)
            best = sum(results.is_best(e) for e in entries)
            rows.append(
                [str(cell), name, found.count, mean, *_parts(found), best, policy.mean if policy else None]
            )
    notes = (
        "Shares are of the best known reward of each problem. Spreads are standard deviations: of the "
        "problems' means, and over the seeds of a problem (root mean square). The history of the paper's "
        "learners ends with the greedy policy alone, that of searches with their best plan."
    )
    return Table("grid", "Every size and method", columns, rows, notes)


def _parts(found: Spread) -> tuple[float, float, float, float]:
    return found.mean, found.problems, found.seeds, found.lowest


def references(results: Results) -> Table:
    """A row a size: how much is known about the best plans."""
    rows: list[list[Value]] = []
    for cell in results.cells:
        entries = results.entries(cell, "exact")
        gaps = []
        for entry in entries:
            best, bound = results.best_known(cell, entry.run.problem), results.bound(cell, entry.run.problem)
            gaps.append((bound - best) / bound if bound else 0.0)
        if entries:
            proven = sum(gap <= 1e-9 for gap in gaps)
            rows.append([str(cell), len(entries), proven, sum(gaps) / len(gaps), max(gaps)])
    notes = "A gap is the share of the bound by which the best known reward may fall short of the best."
    columns = ["size", "problems", "best known is proven", "mean gap to the bound", "largest gap"]
    return Table("references", "What the best known rewards are worth", columns, rows, notes)


def action_space() -> Table:
    """A row a size: what DQN has to tell apart, and what QMIX has to."""
    rows: list[list[Value]] = []
    for cell in (*SMALL, *GRID):
        m, n = cell
        joint = (n + 1) ** m
        size = (_HIDDEN + 1) * joint * _BYTES
        runs_here = "yes" if joint <= MAX_JOINT_ACTIONS else "no"
        rows.append([str(cell), _power(joint), _power(m**n), m * (n + 1), n + 1, _bytes(size), runs_here])
    columns = [
        "size", "joint actions (N+1)^M", "as printed, M^N", "values QMIX compares a step, M(N+1)",
        "outputs of QMIX's network, N+1", "DQN's output layer", "DQN is run",
    ]  # fmt: skip
    notes = (
        "M UAVs choose one of N areas or home. A step of DQN has one value for each joint action, here at "
        f"most {MAX_JOINT_ACTIONS:,}; its output layer has 65 numbers of {_BYTES} bytes for each. "
        f"The number of materials, {MATERIALS}, does not matter."
    )
    return Table("action_space", "Growth of the joint action space", columns, rows, notes)


def _power(count: int) -> str:
    digits = len(str(count))
    return f"{count:,}" if digits <= 6 else f"{count / 10 ** (digits - 1):.1f}e{digits - 1}"


def _bytes(size: int) -> str:
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if size < 1000:
            return f"{size} {unit}"
        size //= 1000
    return f"{_power(size)} PB"


def runs(results: Results) -> Table:
    """A row a run without a time limit."""
    rows: list[list[Value]] = []
    for cell in results.cells:
        for name in results.methods(cell):
            if METHODS[name].kind is Kind.TIMED:
                continue
            for e in results.entries(cell, name):
                last = e.curve[-1] if e.curve else None
                epochs = e.epochs[-1] if e.epochs else None
                rows.append(
                    [
                        str(cell),
                        e.run.problem,
                        name,
                        e.run.seed,
                        e.reward,
                        results.ratio(e),
                        last,
                        epochs,
                        e.bound,
                    ]
                )
    columns = ["size", "problem", "method", "seed", "reward", "share", "history ends with", "epochs", "bound"]
    return Table("runs", "Every run", columns, rows)


def running_times(results: Results) -> Table:
    """A row a size and method: Table 4, and the same of the others."""
    rows: list[list[Value]] = []
    for cell in results.cells:
        ours = results.entries(cell, "ga")
        for name in results.methods(cell):
            entries = results.entries(cell, name)
            if METHODS[name].kind is Kind.TIMED:
                continue
            found = spread([(e.run.problem, e.seconds) for e in entries])
            assert found is not None
            epochs = max((e.epochs[-1] for e in entries if e.epochs), default=None)
            times = found.mean / (sum(e.seconds for e in ours) / len(ours)) if ours else None
            paper = _PAPER_SECONDS.get(name) if cell == Cell(5, 10) else None
            rows.append([str(cell), name, found.count, epochs, found.mean, times, paper])
    columns = [
        "size",
        "method",
        "runs",
        "epochs",
        "seconds",
        "times the genetic algorithm's",
        "Table 4, seconds",
    ]
    notes = (
        "Seconds of the solver alone, compiled and loaded, one thread a process, as many processes as cores "
        "at the same time. The paper's seconds are for 5x10 on an Apple M1 Pro, in Python."
    )
    return Table("running_times", "Running times (Table 4)", columns, rows, notes, timed=True)


def general_optimisers(results: Results) -> Table:
    """A row a size and optimiser: what each gets in the same time."""
    rows: list[list[Value]] = []
    names = [name for name, method in METHODS.items() if method.kind is Kind.TIMED]
    for cell in results.cells:
        for name in names:
            entries, found = results.entries(cell, name), results.ratios(cell, name)
            if found is not None:
                seconds = entries[0].run.parameters["seconds"]
                illegal = sum(not e.legal for e in entries)
                label = METHODS[name].label
                rows.append(
                    [
                        str(cell),
                        label,
                        found.count,
                        seconds,
                        found.mean,
                        found.problems,
                        found.lowest,
                        illegal,
                    ]
                )
    columns = [
        "size",
        "optimiser",
        "runs",
        "seconds",
        "mean share",
        "spread",
        "lowest share",
        "illegal plans",
    ]
    notes = (
        "Share of the best known reward without a time limit; every plan was flown again by the simulator, "
        "an illegal one counts as 0. What PyVRP and OR-Tools cannot express is listed in the documentation."
    )
    return Table(
        "general_optimisers", "General optimisers in the same time", columns, rows, notes, timed=True
    )
