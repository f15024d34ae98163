"""Figures 5 to 11, the grid, and what depends on time; SVG and PNG, the same bytes for the same records."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from importlib.util import find_spec
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np

from app.reproduction.errors import MissingPackage
from app.reproduction.methods import METHODS, Kind
from app.reproduction.results import Results
from app.reproduction.scale import GRID, SHOWN, SMALL, Cell

STYLE = {
    "svg.hashsalt": "uav-allocator",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "path.simplify": True,
}
"""Of matplotlib; without the fixed salt every SVG would have other ids."""

COLOURS = {
    "ga": "#d55e00",
    "qmix-paper": "#0072b2",
    "transfer-paper": "#009e73",
    "transfer-near": "#56b4e9",
    "dqn": "#999999",
    "transfer-service": "#cc79a7",
    "qmix-service": "#8a6d3b",
    "auto": "#222222",
}
"""A colour a method, of a palette that colour-blind people can tell apart."""

_GRID_METHODS = ("ga", "qmix-paper", "transfer-paper", "qmix-service", "transfer-service", "auto")
_PNG_DPI = 150
_BAND = (10, 90)
"""Percentiles between which a band lies."""


class Drawn(NamedTuple):
    """A figure, and whether it depends on how long something took."""

    name: str
    figure: Any
    timed: bool = False


def require_packages() -> None:
    """Refuse to go on without matplotlib and scipy, before hours of runs and not after.

    Raises
    ------
    MissingPackage
        If one is not installed.
    """
    for name in ("matplotlib", "scipy"):
        if find_spec(name) is None:
            raise MissingPackage(f'{name} is not installed: .venv/bin/pip install -e ".[reproduce]"')


def write_figures(results: Results, values: Path, timed: Path, provenance: str) -> None:
    """Draw all figures that there are runs for.

    Parameters
    ----------
    results
        The runs.
    values, timed
        Folders for what only depends on seeds, and for what depends on time.
    provenance
        Where they come from; it is in the files' metadata.
    """
    with styled():
        save_figures(_figures(results), values, timed, provenance)


def styled() -> AbstractContextManager[None]:
    """Return a context in which figures have the style of this room."""
    import matplotlib as mpl  # noqa: PLC0415 - an extra

    return mpl.rc_context(STYLE)


def save_figures(figures: Iterable[Drawn], values: Path, timed: Path, provenance: str) -> None:
    """Write figures as SVG and PNG; see :func:`write_figures`."""
    with styled():
        for drawn in figures:
            folder = timed if drawn.timed else values
            folder.mkdir(parents=True, exist_ok=True)
            drawn.figure.savefig(
                folder / f"{drawn.name}.svg",
                metadata={"Date": None, "Creator": "uav-allocator", "Description": provenance},
            )
            drawn.figure.savefig(
                folder / f"{drawn.name}.png",
                dpi=_PNG_DPI,
                metadata={"Software": None, "Description": provenance},
            )


def _figures(results: Results) -> list[Drawn]:
    found = []
    for cell, alone, against in zip(
        SHOWN, ("fig05", "fig08", "fig10"), ("fig07", "fig09", "fig11"), strict=True
    ):
        if results.entries(cell, "qmix-paper"):
            found.append(Drawn(f"{alone}_qmix_{cell}", _curves(results, cell, ["qmix-paper"], ["ga"])))
        if results.entries(cell, "transfer-paper"):
            shown = ["ga", "transfer-paper", "transfer-near"]
            levels = ["qmix-paper", "transfer-service"]
            found.append(Drawn(f"{against}_transfer_{cell}", _curves(results, cell, shown, levels)))
    if results.entries(SHOWN[0], "ga"):
        found.append(Drawn(f"fig06_ga_{SHOWN[0]}", _curves(results, SHOWN[0], ["ga"], [])))
    grid = [cell for cell in GRID if cell in results.cells]
    if grid:
        found += [
            Drawn("grid", _grid(results, grid)),
            Drawn("running_times", _times(results, grid), timed=True),
        ]
    if any(results.entries(cell, "dqn") for cell in results.cells):
        found.append(Drawn("dqn", _dqn(results)))
    if any(results.entries(cell, "timed-auto") for cell in grid):
        found.append(Drawn("general_optimisers", _optimisers(results, grid), timed=True))
    return [Drawn("action_space", _action_space()), *found]


def figure_of(rows: int, columns: int, width: float, height: float, **kwargs: Any) -> tuple[Any, Any]:
    """Return a figure and its axes."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - an extra

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, **kwargs)


def _curves(results: Results, cell: Cell, methods: Sequence[str], levels: Sequence[str]) -> Any:
    """Reward of one problem as in the paper, and beside it the share of the best known of all problems."""
    figure, (one, every) = figure_of(1, 2, 9.5, 4.0)
    number = results.problems(cell)[0]
    best, bound = results.best_known(cell, number), results.bound(cell, number)
    for name in methods:
        if not results.entries(cell, name):
            continue
        _one_problem(one, results, cell, name, number)
        epochs, curves = results.curves(cell, name) or ((), np.empty((0, 0)))
        colour, mean = COLOURS[name], curves.mean(0)
        low, high = np.percentile(curves, _BAND, axis=0)
        every.fill_between(epochs, low, high, color=colour, alpha=0.15, linewidth=0)
        every.plot(epochs, mean, color=colour, label=f"{METHODS[name].label}, {len(curves)} runs")
    for name in levels:
        ratios = results.ratios(cell, name)
        if ratios is not None:
            label = f"best plan of: {METHODS[name].label}"
            every.axhline(ratios.mean, color=COLOURS[name], linestyle="--", linewidth=1, label=label)
    proven = bound is not None and bound <= best * (1 + 1e-9)
    one.axhline(best, color="black", linewidth=0.8, label="best, proven" if proven else "best known")
    if bound is not None and not proven:
        one.axhline(bound, color="black", linewidth=0.8, linestyle=":", label="no plan earns more")
    every.axhline(1.0, color="black", linewidth=0.8, label="best known")
    one.set(title=f"{cell}, problem {number}", xlabel="epoch or generation", ylabel="cumulative reward")
    every.set(title=f"{cell}, all problems", xlabel="epoch or generation", ylabel="share of the best known")
    put_legend(figure, (every, one))
    return figure


def put_legend(figure: Any, parts: Sequence[Any]) -> None:
    """Put one legend below the axes, every label once."""
    labelled: dict[str, Any] = {}
    for axes in parts:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            labelled.setdefault(label, handle)
    figure.legend(labelled.values(), labelled.keys(), loc="outside lower center", ncols=3)


def _one_problem(axes: Any, results: Results, cell: Cell, name: str, number: int) -> None:
    entries = [e for e in results.entries(cell, name) if e.run.problem == number]
    longest = max((e.epochs for e in entries), key=len)
    rows = np.array([[*e.curve, *[e.curve[-1]] * (len(longest) - len(e.curve))] for e in entries])
    axes.fill_between(longest, rows.min(0), rows.max(0), color=COLOURS[name], alpha=0.15, linewidth=0)
    axes.plot(longest, rows.mean(0), color=COLOURS[name])


def _grid(results: Results, cells: Sequence[Cell]) -> Any:
    """A group of bars a size: mean share of the best known, with the spread of the problems."""
    figure, axes = figure_of(1, 1, 10, 4.0)
    methods = [m for m in _GRID_METHODS if any(results.entries(cell, m) for cell in cells)]
    width = 0.85 / len(methods)
    for offset, name in enumerate(methods):
        at = [
            c + (offset + 0.5) * width - 0.425 for c, cell in enumerate(cells) if results.ratios(cell, name)
        ]
        found = [each for cell in cells if (each := results.ratios(cell, name)) is not None]
        axes.bar(
            at,
            [each.mean for each in found],
            width,
            yerr=[each.problems for each in found],
            color=COLOURS[name],
            label=METHODS[name].label,
            error_kw={"linewidth": 0.8, "alpha": 0.7},
        )
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set_xticks(range(len(cells)), [str(cell) for cell in cells])
    axes.set(xlabel="UAVs x areas", ylabel="share of the best known", ylim=(0, 1.1))
    put_legend(figure, [axes])
    return figure


def _dqn(results: Results) -> Any:
    """DQN and QMIX with the same epochs, by number of UAVs; the share of the best known."""
    figure, axes = figure_of(1, 1, 7, 3.4)
    cells = [cell for cell in (*SMALL, *GRID) if results.entries(cell, "dqn")]
    for name in ("dqn", "qmix-paper", "ga"):
        shown = [
            (c, each) for c, cell in enumerate(cells) if (each := results.ratios(cell, name)) is not None
        ]
        axes.errorbar(
            [c for c, _ in shown],
            [each.mean for _, each in shown],
            [each.problems for _, each in shown],
            color=COLOURS[name],
            marker="o",
            capsize=3,
            label=METHODS[name].label,
        )
    ticks = [f"{cell}\n{(cell.n + 1) ** cell.m:,} joint actions" for cell in cells]
    axes.set_xticks(range(len(cells)), ticks, fontsize=7)
    axes.set(ylabel="share of the best known")
    put_legend(figure, [axes])
    return figure


def _action_space() -> Any:
    """Joint actions by number of UAVs, and what QMIX compares instead."""
    figure, axes = figure_of(1, 1, 5, 3.4)
    swarm = range(1, 21)
    for n, shade in ((5, 0.35), (10, 0.55), (20, 0.75), (30, 1.0)):
        axes.semilogy(
            swarm, [float((n + 1) ** m) for m in swarm], color="#d55e00", alpha=shade, label=f"DQN, {n} areas"
        )
    axes.semilogy(swarm, [31.0 * m for m in swarm], color="#0072b2", label="QMIX, 30 areas: M(N+1)")
    axes.axhline(2e4, color="black", linewidth=0.8, linestyle=":", label="most that DQN is run with here")
    axes.set_xticks((1, 5, 10, 15, 20))
    axes.set(xlabel="UAVs, M", ylabel="values a step, (N+1)^M")
    axes.legend(loc="upper left")
    return figure


def _times(results: Results, cells: Sequence[Cell]) -> Any:
    """Seconds by size, a line a method."""
    figure, axes = figure_of(1, 1, 8, 4.4)
    for name, colour in COLOURS.items():
        shown = [(c, results.entries(cell, name)) for c, cell in enumerate(cells)]
        shown = [(c, entries) for c, entries in shown if entries]
        if shown and name != "dqn":
            seconds = [fmean(e.seconds for e in entries) for _, entries in shown]
            axes.semilogy([c for c, _ in shown], seconds, color=colour, marker="o", label=METHODS[name].label)
    axes.set_xticks(range(len(cells)), [str(cell) for cell in cells])
    axes.set(xlabel="UAVs x areas", ylabel="seconds")
    put_legend(figure, [axes])
    return figure


def _optimisers(results: Results, cells: Sequence[Cell]) -> Any:
    """Mean share of the best known by size, a line an optimiser, all within the same time."""
    figure, axes = figure_of(1, 1, 7.5, 3.4)
    names = [name for name, method in METHODS.items() if method.kind is Kind.TIMED]
    for name, marker in zip(names, "os^v", strict=True):
        shown = [
            (c, each) for c, cell in enumerate(cells) if (each := results.ratios(cell, name)) is not None
        ]
        if shown:
            at, means = [c for c, _ in shown], [each.mean for _, each in shown]
            axes.plot(at, means, marker=marker, label=METHODS[name].label)
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set_xticks(range(len(cells)), [str(cell) for cell in cells])
    axes.set(xlabel="UAVs x areas", ylabel="share of the best known")
    put_legend(figure, [axes])
    return figure
