"""What ways of replanning earn on days drawn from seeds, held against hindsight.

    python tests/benchmarks/bench_days.py RECORDS [--seeds 20] [--first 0] [--kinds areas slow] [--arms none]
    python tests/benchmarks/bench_days.py RECORDS --prices [--seeds 4] [--kinds areas all]
    python tests/benchmarks/bench_days.py RECORDS --tables [--figures FOLDER]

RECORDS is a file of JSON lines, one for every day and way of replanning; what is there is not done again.
One process; times are those of the processor, so other work on the machine changes nothing but how long it
all takes. `--policies FOLDER` takes the policies for every size from a folder of checkpoints instead of the
shipped ones. `--prices` flies the days with prices on change, and `--tables` prints what the records come
to.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]

from library_on_trial import library_of, policies_for_every_size  # noqa: E402

from app.missions.days.arms import PRICES, arms_of, priced, solved  # noqa: E402
from app.missions.days.flying_a_day import fly_day  # noqa: E402
from app.missions.days.hindsight import in_hindsight  # noqa: E402
from app.missions.days.kinds import KINDS, draw  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402

HINDSIGHT = "hindsight"
HINDSIGHT_S = {kind: 4.0 if of.bases else 1.0 for kind, of in KINDS.items()}
"""Processor seconds of its search; with reloads one is not enough."""

PLAIN = "auto 0.25 s"
"""The arm that the prices on change begin from."""

Records = dict[tuple[str, int, str], dict[str, Any]]


def main() -> None:
    """Fly the days that are missing, or print what there is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("records", type=Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=list(KINDS))
    parser.add_argument("--arms", nargs="+", default=None)
    parser.add_argument("--prices", action="store_true")
    parser.add_argument("--policies", type=Path, default=None)
    parser.add_argument("--tables", action="store_true")
    parser.add_argument("--figures", type=Path, default=None)
    given = parser.parse_args()
    if not given.tables:
        with library_of(policies_for_every_size(given.policies)) as url:
            fly(given, url)
        return
    records = read(given.records)
    for line in [*table(records), "", *details(records), "", *prices(records)]:
        print(line)
    if given.figures is not None:
        draw_figures(records, given.figures)


def read(file: Path) -> Records:
    """Read records; a line that was cut off is passed over."""
    found: Records = {}
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        try:
            record = json.loads(line)
        except ValueError:
            continue
        found[record["kind"], record["seed"], record["arm"]] = record
    return found


def fly(given: argparse.Namespace, url: str) -> None:
    """Fly the days that are missing, and write a line for each."""
    known = read(given.records)
    auto = create_solver("auto", parse_parameters("auto", {}), SolverContext(url))
    warm(url)
    for seed in range(given.first, given.first + given.seeds):
        for kind in given.kinds:
            arms = priced(url) if given.prices else arms_of(url, kind)
            day = draw(kind, seed)
            for name in [HINDSIGHT, *(given.arms or arms)]:
                if (kind, seed, name) in known:
                    continue
                if name == HINDSIGHT:
                    whole = in_hindsight(day)
                    result = {"reward": reward_of(whole, solved(auto, whole, HINDSIGHT_S[kind], seed))}
                else:
                    flown = fly_day(day, arms[name], seed)
                    result = {
                        "reward": flown.reward,
                        "satisfaction": flown.satisfaction,
                        "distance": flown.distance,
                        "decisions": [
                            [round(d.at, 4), round(d.seconds, 4), d.changed, d.left_out]
                            for d in flown.decisions
                        ],
                    }
                with given.records.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"kind": kind, "seed": seed, "arm": name, **result}) + "\n")
                print(kind, seed, name, round(result["reward"], 3), flush=True)


def warm(url: str) -> None:
    """Load and compile what the arms need, so that no decision of a record does."""
    arms = arms_of(url, "all")
    for name in (PLAIN, "policy", "auto over futures"):
        fly_day(draw("failures", 1000), arms[name], 0)


def ratios(records: Records, arm: str, kinds: list[str] | None = None) -> list[float]:
    """Return what an arm has earned over hindsight, a number a day."""
    return [
        record["reward"] / records[kind, seed, HINDSIGHT]["reward"]
        for (kind, seed, name), record in records.items()
        if name == arm and (kinds is None or kind in kinds) and (kind, seed, HINDSIGHT) in records
    ]


def arms_in(records: Records) -> list[str]:
    """Return the arms that there are records of, without those with prices."""
    return [
        name
        for name in dict.fromkeys(name for _, _, name in records)
        if name != HINDSIGHT and not name.startswith("price")
    ]


def table(records: Records) -> Iterator[str]:
    """Yield the table of rewards over hindsight: mean, standard deviation over days, days."""
    kinds = [kind for kind in KINDS if any(of == kind for of, _, _ in records)]
    yield f"| | {' | '.join(kinds)} | all kinds |"
    yield "| --- " * (len(kinds) + 2) + "|"
    for arm in arms_in(records):
        cells = [ratios(records, arm, [kind]) for kind in kinds]
        means = [fmean(cell) for cell in cells if cell]
        whole = f"{fmean(means):.3f}" if len(means) == len(kinds) else ""
        yield f"| {arm} | {' | '.join(map(cell_of, cells))} | {whole} |"
    above = sum(ratio > 1.0 for arm in arms_in(records) for ratio in ratios(records, arm))
    highest = max((ratio for arm in arms_in(records) for ratio in ratios(records, arm)), default=0.0)
    yield ""
    yield f"Days that earn more than hindsight: {above}; the highest ratio is {highest:.4f}."


def cell_of(values: list[float]) -> str:
    """Return mean, standard deviation and number of some values."""
    if not values:
        return ""
    spread = stdev(values) if len(values) > 1 else 0.0
    return f"{fmean(values):.3f} ± {spread:.3f} ({len(values)})"


def details(records: Records) -> Iterator[str]:
    """Yield how long decisions take, and what they change."""
    yield "| | decisions a day | s a decision, mean | longest | visits changed a day | left out a day |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for arm in arms_in(records):
        days = [record["decisions"] for (_, _, name), record in records.items() if name == arm]
        seconds = [each[1] for day in days for each in day]
        counts = [len(day) for day in days]
        changed, left = ([sum(each[k] for each in day[1:]) for day in days] for k in (2, 3))
        yield (
            f"| {arm} | {fmean(counts):.1f} | {fmean(seconds):.3f} | {max(seconds):.2f} "
            f"| {fmean(changed):.1f} | {fmean(left):.1f} |"
        )


def price_rows(records: Records) -> Iterator[tuple[str, float, float, float, int]]:
    """Yield price, reward over hindsight, visits left out and changed a day, days; of days that all have."""
    names = [PLAIN, *(f"price {price:g}" for price in PRICES)]
    days = set.intersection(
        *({(kind, seed) for kind, seed, name in records if name == each} for each in (*names, HINDSIGHT))
    )
    for name in names if days else ():
        of = [(records[kind, seed, name], records[kind, seed, HINDSIGHT]) for kind, seed in sorted(days)]
        reward = fmean(record["reward"] / best["reward"] for record, best in of)
        left, changed = (
            fmean(sum(d[k] for d in record["decisions"][1:]) for record, _ in of) for k in (3, 2)
        )
        yield "0" if name == PLAIN else name.removeprefix("price "), reward, left, changed, len(of)


def prices(records: Records) -> Iterator[str]:
    """Yield the table of `change_weight`."""
    yield "| `change_weight` | reward over hindsight | visits left out a day | visits changed a day | days |"
    yield "| --- | --- | --- | --- | --- |"
    for price, reward, left, changed, days in price_rows(records):
        yield f"| {price} | {reward:.3f} | {left:.1f} | {changed:.1f} | {days} |"


def draw_figures(records: Records, folder: Path) -> None:
    """Draw the rewards by kind, and the curve of the price on change, as SVG."""
    import matplotlib as mpl  # noqa: PLC0415 - an extra
    from matplotlib.figure import Figure  # noqa: PLC0415 - an extra

    from app.reproduction.figures import STYLE  # noqa: PLC0415 - for figures only

    kinds = [kind for kind in KINDS if any(of == kind for of, _, _ in records)]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.8), layout="constrained")
        axes = figure.subplots()
        for arm, marker in zip(arms_in(records), "xs^ov*DP", strict=False):
            cells = [ratios(records, arm, [kind]) for kind in kinds]
            means = [fmean(cell) if cell else float("nan") for cell in cells]
            axes.plot(range(len(kinds)), means, marker=marker, label=arm, linewidth=1, markersize=5)
        axes.set(ylabel="reward over hindsight", ylim=(None, 1.0))
        axes.set_xticks(range(len(kinds)), kinds)
        figure.legend(loc="outside right upper")
        save(figure, folder / "arms.svg")
        rows = list(price_rows(records))
        if rows:
            figure = Figure(figsize=(5.5, 3.6), layout="constrained")
            axes = figure.subplots()
            axes.plot([row[2] for row in rows], [1.0 - row[1] for row in rows], marker="o")
            for price, reward, left, _, _ in rows:
                axes.annotate(f" {price}", (left, 1.0 - reward), fontsize=8)
            axes.set(
                xlabel="visits of the plan in force left out, a day", ylabel="reward given up, of hindsight"
            )
            save(figure, folder / "change_weight.svg")


def save(figure: Any, file: Path) -> None:
    """Write a figure; the same records make the same bytes."""
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, metadata={"Date": None, "Creator": "uav-allocator"})


if __name__ == "__main__":
    main()
