"""The paper's claims, each with what was measured here; what is not measured is not judged."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import NamedTuple

import numpy as np

from app.reproduction.results import Results
from app.reproduction.scale import GRID, SHOWN, Cell
from app.reproduction.tables import Table

GA, QMIX, TRANSFER, NEAR = "ga", "qmix-paper", "transfer-paper", "transfer-near"

_CONVERGED = 0.95
"""Share of the level of the last evaluations at which a curve is said to have converged."""

_LAST_SHARE = 0.2
"""Of the evaluations, the last ones that make that level."""


class Claim(NamedTuple):
    """A claim.

    Attributes
    ----------
    where, text
        In the paper.
    paper, measured
        Figures.
    holds
        "yes", "no", "in part", or "not measured".
    """

    where: str
    text: str
    paper: str
    measured: str
    holds: str


def claims_table(results: Results) -> Table:
    """Return the claims as a table."""
    columns = ["where", "claim", "the paper's figures", "measured here", "holds here"]
    notes = (
        "Quotients are means over problems of (one method's mean reward / the other's), from the best plans "
        "that each saw. The paper's instances are pictures: its rewards cannot be compared with ours, "
        "quotients and the shapes of curves can."
    )
    return Table("claims", "The paper's claims", columns, claims(results), notes)


def claims(results: Results) -> list[Claim]:
    """Judge every claim that the runs speak of."""
    return [
        _above(
            results, SHOWN, QMIX, GA, "5.2.2, Figs. 5, 6; 5.2.4, Figs. 8, 10",
            "QMIX's reward is above the GA's",
            "2.443 / 1.589 = 1.54",
        ),
        _above(results, GRID, QMIX, GA, "4.3", "So it is at every size", "not printed"),
        _above(
            results, SHOWN, TRANSFER, GA, "5.2.3, Fig. 7; 5.2.4, Figs. 9, 11",
            "Transfer's reward is above the GA's",
            "2.828 / 1.589 = 1.78",
        ),
        _above(results, GRID, TRANSFER, GA, "5.2.4", "So it is at every size", "not printed"),
        _above(
            results, SHOWN, NEAR, GA, "5.2.3", "So it is from a source trained on a neighbouring task",
            "not printed",
        ),
        _above(
            results, SHOWN, TRANSFER, QMIX, "5.2.1, 5.2.3", "Transfer ends above QMIX from scratch",
            "2.828 / 2.443 = 1.16",
        ),
        _converges(results),
        _falls_first(results),
        _converges_quickly(results),
        _stuck(results, GA, "5.2.2", "The GA falls into local optima", wanted=True),
        _stuck(results, QMIX, "1, 4.1", "QMIX avoids them", wanted=False),
        _above(
            results, GRID, "transfer-service", GA, "not in the paper",
            "The service's own transfer_qmix is above the GA", "",
        ),
    ]  # fmt: skip


def _verdict(held: Sequence[bool]) -> str:
    if not held:
        return "not measured"
    return "yes" if all(held) else "in part" if any(held) else "no"


def _above(
    results: Results, cells: Sequence[Cell], method: str, other: str, where: str, text: str, paper: str
) -> Claim:
    found = {cell: results.quotient(cell, method, other) for cell in cells}
    means = {cell: fmean(each) for cell, each in found.items() if each}
    held = [mean > 1 for mean in means.values()]
    if len(means) > len(SHOWN):
        least, most = min(means.values()), max(means.values())
        measured = f"above in {sum(held)} of {len(means)} sizes; {least:.2f} to {most:.2f}"
    else:
        measured = ", ".join(
            f"{cell}: {mean:.2f} ({sum(q > 1 for q in found[cell])} of {len(found[cell])} problems)"
            for cell, mean in means.items()
        )
    return Claim(where, text, paper, measured, _verdict(held))


def _converges(results: Results) -> Claim:
    parts, held = [], []
    for cell in SHOWN:
        found = results.curves(cell, QMIX)
        if found is None:
            continue
        epochs, curves = found
        level, mean = _level(curves), curves.mean(0)
        first = epochs[int(np.argmax(mean >= _CONVERGED * level))]
        parts.append(f"{cell}: epoch {first:,} of {epochs[-1]:,}")
        held.append(first <= 0.9 * epochs[-1])
    text = f"QMIX converges: {_CONVERGED:.0%} of its last level"
    return Claim("5.2.1, Fig. 5", text, "after about 7,700 of 50,000", ", ".join(parts), _verdict(held))


def _level(curves: np.ndarray) -> float:
    last = max(1, round(_LAST_SHARE * curves.shape[1]))
    return float(curves[:, -last:].mean())


def _falls_first(results: Results) -> Claim:
    parts, held = [], []
    for cell in SHOWN:
        found = results.curves(cell, TRANSFER)
        if found is None or len(found[0]) < 100:
            continue
        mean = found[1].mean(0)
        parts.append(f"{cell}: {mean[0]:.2f} at epoch 0, {mean[1:21].mean():.2f} in epochs 1 to 20")
        held.append(bool(mean[1:21].mean() < mean[0] - 1e-9))
    text = "The transferred policy's reward falls sharply in the first 20 epochs"
    return Claim("5.2.3, Fig. 7", text, "read from the figure", ", ".join(parts), _verdict(held))


def _converges_quickly(results: Results) -> Claim:
    parts, held = [], []
    for cell in SHOWN:
        found = results.curves(cell, TRANSFER)
        if found is None or len(found[0]) < 200:
            continue
        mean = found[1].mean(0)
        before, after = float(mean[:100].mean()), float(mean[160:].mean())
        parts.append(f"{cell}: {before:.2f} in epochs 0 to 99, {after:.2f} after epoch 160")
        held.append(after > before + 0.01)
    text = "Fine-tuning for 200 epochs raises the transferred policy's reward"
    return Claim("5.2.3, Fig. 7", text, "converges at 160, to 2.828", ", ".join(parts), _verdict(held))


def _stuck(results: Results, method: str, where: str, text: str, *, wanted: bool) -> Claim:
    parts, held = [], []
    for cell in SHOWN:
        entries, ratios = results.entries(cell, method), results.ratios(cell, method)
        if ratios is None:
            continue
        found = sum(map(results.is_best, entries))
        parts.append(f"{cell}: {ratios.mean:.2f} of the best known, found by {found} of {len(entries)} runs")
        held.append((found < 0.5 * len(entries)) == wanted)
    return Claim(where, text, "", ", ".join(parts), _verdict(held))
