"""Statistics, claims and tables from records written by hand."""

import csv

import pytest

from app.reproduction.claims import claims
from app.reproduction.command import scale_of
from app.reproduction.errors import ImpossibleScale
from app.reproduction.grid import Run
from app.reproduction.records import RecordStore
from app.reproduction.report import command_line, describe
from app.reproduction.results import Results, spread
from app.reproduction.scale import SHOWN, Cell, Scale
from app.reproduction.tables import action_space, grid, overview, running_times

CELL = Cell(5, 10)


def results_of(folder, rewards, curves=None, bounds=None, seconds=1.0):
    """Records of given rewards, by cell, method, problem and seed."""
    store, runs = RecordStore(folder), []
    for (cell, method, problem, seed), reward in rewards.items():
        run = Run(cell, problem, method, seed, {})
        curve = (curves or {}).get(method, [reward])
        record = {
            "reward": reward,
            "legal": True,
            "history": {"epoch": list(range(len(curve))), "reward": curve},
            "bound": (bounds or {}).get(problem) if method == "exact" else None,
            "proven": False,
        }
        store.write(
            run, record, {"seconds": seconds, "commit": "c0ffee", "machine": "abacus", "versions": "v1"}
        )
        runs.append(run)
    return Results(runs, store)


def test_spread_of_problems_and_of_seeds():
    found = spread([(0, 1.0), (0, 3.0), (1, 5.0), (1, 5.0)])
    assert (found.mean, found.lowest, found.count) == (3.5, 1.0, 4)
    assert found.problems == pytest.approx(1.5), "the means are 2 and 5"
    assert found.seeds == pytest.approx(0.5**0.5), "1 and 0, root mean square"
    assert spread([]) is None


def test_best_known_is_the_best_run_without_a_time_limit(tmp_path):
    results = results_of(
        tmp_path,
        {
            (CELL, "ga", 0, 123): 1.0,
            (CELL, "ga", 0, 124): 3.0,
            (CELL, "exact", 0, 123): 4.0,
            (CELL, "timed-auto", 0, 123): 5.0,
        },
        bounds={0: 4.5},
    )
    assert results.best_known(CELL, 0) == 4.0
    assert results.bound(CELL, 0) == 4.5
    assert results.ratios(CELL, "ga").mean == pytest.approx(0.5)
    assert results.ratios(CELL, "timed-auto").mean == pytest.approx(1.25)
    assert results.ratios(CELL, "auto") is None


def test_a_quotient_is_the_mean_of_the_problems_quotients(tmp_path):
    results = results_of(
        tmp_path,
        {
            (CELL, "ga", 0, 123): 1.0,
            (CELL, "ga", 0, 124): 3.0,
            (CELL, "ga", 1, 123): 4.0,
            (CELL, "qmix-paper", 0, 123): 3.0,
        },
    )
    assert results.quotient(CELL, "qmix-paper", "ga") == [1.5], "problem 1 was not solved by both"


@pytest.mark.parametrize(
    ("qmix", "verdict"), [((2.0, 2.0, 2.0), "yes"), ((2.0, 0.5, 2.0), "in part"), ((0.5, 0.5, 0.5), "no")]
)
def test_a_claim_holds_where_it_holds_at_every_size(tmp_path, qmix, verdict):
    rewards = {(cell, "ga", 0, 123): 1.0 for cell in SHOWN}
    rewards |= {(cell, "qmix-paper", 0, 123): reward for cell, reward in zip(SHOWN, qmix, strict=True)}
    found = claims(results_of(tmp_path, rewards))
    assert found[0].text == "QMIX's reward is above the GA's"
    assert found[0].holds == verdict
    assert f"5x10: {qmix[0]:.2f}" in found[0].measured
    assert next(c for c in found if c.text.startswith("Transfer's reward")).holds == "not measured"


def test_when_a_curve_has_converged(tmp_path):
    curve = [0.0] * 40 + [2.0] * 60
    found = claims(results_of(tmp_path, {(CELL, "qmix-paper", 0, 123): 2.0}, {"qmix-paper": curve}))
    assert [c.measured for c in found if c.text.startswith("QMIX converges")] == ["5x10: epoch 40 of 99"]


def test_whether_a_transferred_policy_falls_first(tmp_path):
    curve = [1.0] + [0.2] * 20 + [0.5] * 180
    found = claims(results_of(tmp_path, {(CELL, "transfer-paper", 0, 123): 1.0}, {"transfer-paper": curve}))
    falls = next(c for c in found if "falls sharply" in c.text)
    assert falls.holds == "yes"
    assert falls.measured == "5x10: 1.00 at epoch 0, 0.20 in epochs 1 to 20"


def test_tables_are_markdown_and_csv(tmp_path):
    results = results_of(tmp_path, {(CELL, "ga", 0, 123): 1.0, (CELL, "auto", 0, 123): 2.0})
    overview(results).write(tmp_path, "from somewhere")
    lines = (tmp_path / "overview.md").read_text(encoding="utf-8").splitlines()
    assert lines[2].startswith("| size | ga |")
    assert lines[4].startswith("| 5x10 | 0.500 | – |")
    assert lines[-1] == "from somewhere"
    first, header, row = csv.reader((tmp_path / "overview.csv").read_text(encoding="utf-8").splitlines())
    assert first == ["# from somewhere"]
    assert dict(zip(header, row, strict=True))["auto"] == "1.000"


def test_the_grid_has_a_row_a_size_and_method(tmp_path):
    results = results_of(
        tmp_path, {(CELL, "ga", 0, 123): 1.0, (CELL, "ga", 0, 124): 2.0, (CELL, "auto", 0, 123): 2.0}
    )
    row = dict(zip(grid(results).columns, grid(results).rows[0], strict=True))
    assert (row["size"], row["method"], row["runs"], row["mean reward"]) == ("5x10", "ga", 2, 1.5)
    assert row["runs that found the best known"] == 1


def test_joint_actions_are_counted_with_home():
    rows = {row[0]: row for row in action_space().rows}
    assert rows["5x5"][1:4] == ["7,776", "3,125", 30]
    assert rows["5x10"][-1] == "no"
    assert rows["20x30"][1] == "6.7e29"


def test_running_times_are_compared_with_the_genetic_algorithm(tmp_path):
    results = results_of(
        tmp_path, {(CELL, "ga", 0, 123): 1.0, (CELL, "qmix-paper", 0, 123): 1.0}, seconds=3.0
    )
    rows = {row[1]: row for row in running_times(results).rows}
    assert rows["qmix-paper"][4:] == [3.0, 1.0, 120]


def test_the_command_that_is_recorded_runs_the_same_scale(tmp_path):
    assert command_line(Scale()) == "python -m app reproduce"
    given = {"problems": 3, "epochs": 900}
    scale = scale_of(False, given, "5x5 10x5")
    assert scale.learning_problems == scale.timed_problems == 3
    assert command_line(scale) == (
        "python -m app reproduce --problems 3 --learning-problems 3 --epochs 900 --timed-problems 3 "
        "--cells '5x5 10x5'"
    )
    assert command_line(scale_of(True, {}, None)) == "python -m app reproduce --quick"
    results = results_of(tmp_path, {(CELL, "ga", 0, 123): 1.0})
    assert "commit c0ffee, abacus, v1" in describe(command_line(scale), "ten problems", results.sources)


def test_experiments_that_do_not_exist_are_refused():
    with pytest.raises(ImpossibleScale, match="9x9"):
        scale_of(False, {}, "9x9")
    with pytest.raises(ImpossibleScale, match="not among"):
        scale_of(False, {"problems": 2, "learning_problems": 3}, None)
