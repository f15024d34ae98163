"""Tables and figures of the race."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.reproduction.figures import Drawn, figure_of, put_legend, save_figures, styled
from app.reproduction.race.entrants import COMPARED, ENTRANTS, Budget
from app.reproduction.race.outcome import Outcome
from app.reproduction.race.places import Place
from app.reproduction.race.statistics import (
    CONFIDENCE,
    RESAMPLES,
    Floats,
    estimate,
    improvement,
    interquartile_mean,
    mean,
    share_above,
)
from app.reproduction.scale import RACE_FAMILIES, SHOWN
from app.reproduction.tables import Table, Value

_RIVAL = {Budget.EVALUATIONS: "ga", Budget.SECONDS: "timed-ga"}
"""The paper's own baseline, in either race."""

_THRESHOLDS = np.linspace(0.5, 1.0, 51)
_COLOURS = (
    "#d55e00", "#0072b2", "#009e73", "#56b4e9", "#cc79a7", "#8a6d3b", "#e69f00", "#999999", "#222222",
    "#7b3294", "#a6611a", "#01665e", "#b2182b", "#4d9221",
)  # fmt: skip
_REFERENCES = ("local-search", "exact")
"""Which are the best known themselves, so that there is nothing to draw."""


def write_race(outcome: Outcome, out: Path, provenance: str) -> None:
    """Write the race's tables and figures: what depends on seconds to ``timed/``."""
    for budget in (Budget.EVALUATIONS, Budget.SECONDS):
        for table in (_overall(outcome, budget), _by_place(outcome, budget)):
            table.write(out / ("timed" if table.timed else "") / "tables", provenance)
    with styled():
        save_figures(_figures(outcome), out / "figures", out / "timed" / "figures", provenance)


def _figures(outcome: Outcome) -> list[Drawn]:
    drawn = [
        Drawn("race_evaluations", _profiles(outcome, Budget.EVALUATIONS)),
        Drawn("race_seconds", _profiles(outcome, Budget.SECONDS), timed=True),
    ]
    for cell in SHOWN:
        place = Place(RACE_FAMILIES[0], cell)
        if place in outcome.places:
            drawn.append(Drawn(f"race_curves_{cell}", _curves(outcome, place)))
    return drawn


def _overall(outcome: Outcome, budget: Budget) -> Table:
    """A row an entrant, over all places."""
    rows: list[list[Value]] = []
    rival = _RIVAL[budget]
    for name in outcome.entrants(budget):
        strata = outcome.strata(name)
        if not strata:
            continue
        ours, theirs = _paired(outcome, name, rival)
        better = estimate(improvement(ours, theirs), mean) if ours and name != rival else None
        rows.append(
            [
                name,
                ENTRANTS[name].label,
                len(strata),
                sum(each.size for each in strata),
                outcome.refused(name),
                str(estimate(strata, interquartile_mean)),
                str(estimate(strata, mean)),
                min(float(each.min()) for each in strata),
                str(better) if better is not None else None,
            ]
        )
    columns = [
        "entrant",
        "algorithm",
        "places",
        "runs",
        "refused",
        "interquartile mean",
        "mean",
        "lowest",
        "ahead of the genetic algorithm",
    ]
    proven = sum(map(outcome.proven, outcome.places))
    problems = sum(len(outcome.solved("greedy", place)) for place in outcome.places)
    notes = (
        f"Shares of the best reward that is known without a time limit, with intervals of {CONFIDENCE:.0%} "
        f"by {RESAMPLES} bootstrap samples of the problems of every place; without an interval where a place "
        f"has one problem. The best known is proven to be the best on {proven} of {problems} problems. "
        "Ahead: the probability that a run earns more than one of the genetic algorithm on the same problem, "
        "ties by half. References have a budget of their own. Learners run at the paper's three sizes only."
    )
    title = f"The race with equal {budget}"
    return Table(f"race_{budget}", title, columns, rows, notes, timed=budget is Budget.SECONDS)


def _paired(outcome: Outcome, name: str, rival: str) -> tuple[list[Floats], list[Floats]]:
    ours, theirs = [], []
    for place in outcome.places:
        both = outcome.solved(name, place) & outcome.solved(rival, place)
        our, their = outcome.shares(name, place, both), outcome.shares(rival, place, both)
        if our is not None and their is not None:
            ours.append(our)
            theirs.append(their)
    return ours, theirs


def _by_place(outcome: Outcome, budget: Budget) -> Table:
    """A row a place, a column an entrant: mean shares."""
    names = outcome.entrants(budget)
    rows: list[list[Value]] = []
    for place in outcome.places:
        row: list[Value] = [str(place), len(outcome.solved("greedy", place)), outcome.proven(place)]
        for name in names:
            shares = outcome.shares(name, place)
            row.append(None if shares is None else float(shares.mean()))
        rows.append(row)
    columns = ["place", "problems", "proven", *names]
    title = f"The race with equal {budget}, by place: mean share of the best known"
    return Table(f"race_{budget}_places", title, columns, rows, timed=budget is Budget.SECONDS)


def _shown(outcome: Outcome, budget: Budget) -> list[str]:
    return [name for name in outcome.entrants(budget) if name not in _REFERENCES and outcome.strata(name)]


def _profiles(outcome: Outcome, budget: Budget) -> Any:
    """Performance profiles: which part of the runs reaches which share, with intervals."""
    figure, axes = figure_of(1, 1, 8.5, 5.0)
    for name, colour in zip(_shown(outcome, budget), _COLOURS, strict=False):
        strata = outcome.strata(name)
        found = np.array([estimate(strata, share_above(float(t))) for t in _THRESHOLDS])
        axes.fill_between(_THRESHOLDS, found[:, 1], found[:, 2], color=colour, alpha=0.08, linewidth=0)
        axes.plot(_THRESHOLDS, found[:, 0], color=colour, label=ENTRANTS[name].label)
    axes.set(xlabel="share of the best known reward", ylabel="part of the runs that reach it", ylim=(0, 1.02))
    axes.set_title(f"equal {budget}")
    put_legend(figure, [axes])
    return figure


def _curves(outcome: Outcome, place: Place) -> Any:
    """Convergence: the mean share of the best known by evaluations made."""
    figure, axes = figure_of(1, 1, 8.5, 4.6)
    names = [n for n in _shown(outcome, Budget.EVALUATIONS) if outcome.finishes(n, place) and n != "greedy"]
    for name, colour in zip(names, _COLOURS, strict=False):
        finishes = [f for f in outcome.finishes(name, place) if f.reward is not None and f.evaluations]
        if not finishes:
            continue
        last = max(f.evaluations[-1] for f in finishes)
        grid = np.unique(np.geomspace(1, max(2, last), 120).astype(np.int64))
        rows = [[outcome.share(f, value) for value in _at(grid, f.evaluations, f.curve)] for f in finishes]
        style = "-" if name in COMPARED or name == "ga" else "--"
        axes.semilogx(grid, np.mean(rows, axis=0), style, color=colour, label=ENTRANTS[name].label)
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set(xlabel="plans flown", ylabel="share of the best known", title=str(place), ylim=(-0.05, 1.05))
    put_legend(figure, [axes])
    return figure


def _at(grid: Any, evaluations: Sequence[int], curve: Sequence[float]) -> list[float]:
    """Return what a history had reached at numbers of evaluations."""
    places = np.clip(np.searchsorted(evaluations, grid, side="right") - 1, 0, len(curve) - 1)
    return [curve[int(place)] for place in places]
