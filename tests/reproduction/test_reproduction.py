"""The command on a tiny grid: its numbers, its records, and that a second run writes the same bytes."""

import json
import shutil
from statistics import fmean
from types import SimpleNamespace

import pytest
from referee import replay

from app.domain.records import problem_to_record
from app.reproduction.command import reproduce, scale_of
from app.reproduction.grid import problem_of, runs_of
from app.reproduction.records import RecordStore
from app.reproduction.runner import do_runs

SCALE = {
    "problems": 1,
    "seeds": 2,
    "epochs": 110,
    "grid_epochs": 8,
    "service_epochs": 8,
    "reference_moves": 30_000,
    "nodes": 5,
    "timed_problems": 1,
    "seconds": 0.05,
}
CELLS = "2x5 5x10"
TIMED = ("timed", "timings", "library.sqlite3")
PAPER = ("paper",)


@pytest.fixture(scope="module")
def scale():
    return scale_of(True, SCALE, CELLS)


@pytest.fixture(scope="module")
def said():
    return []


@pytest.fixture(scope="module")
def out(scale, said, tmp_path_factory):
    """The folder after one run of the command, in two processes."""
    folder = tmp_path_factory.mktemp("first")
    assert reproduce(scale, folder, 2, None, lambda done, word: said.append((done, word)), PAPER)
    return folder


@pytest.fixture(scope="module")
def records(scale, out):
    store = RecordStore(out)
    return {run.id: (run, store.read(run)) for run in runs_of(scale)}


def rewards(records, method, cell="5x10"):
    """Rewards by problem."""
    found = {}
    for run, record in records.values():
        if run.method == method and str(run.cell) == cell:
            found.setdefault(run.problem, []).append(record["reward"])
    return found


def test_every_reward_is_what_the_referee_computes(records):
    assert len(records) > 20
    for run, record in records.values():
        checked = replay(problem_to_record(problem_of(run.cell, run.problem)), record["assignment"])
        assert record["legal"]
        for name in ("reward", "satisfaction", "distance"):
            assert record[name] == pytest.approx(checked[name], abs=1e-9)


def test_no_reward_is_above_a_proven_bound(records):
    bounds = {
        (run.cell, run.problem): record["bound"] for run, record in records.values() if run.method == "exact"
    }
    assert len(bounds) == 2
    for run, record in records.values():
        assert record["reward"] <= bounds[run.cell, run.problem] + 1e-9


def test_transfer_of_the_service_is_above_the_genetic_algorithm(records):
    ours, theirs = rewards(records, "transfer-service"), rewards(records, "ga")
    for number, found in ours.items():
        assert min(found) >= max(theirs[number])
    assert fmean(map(fmean, ours.values())) > fmean(map(fmean, theirs.values()))


def test_every_method_has_its_runs(records):
    at_size = {}
    for run, _ in records.values():
        at_size.setdefault((str(run.cell), run.method), []).append(run)
    assert len(at_size["5x10", "ga"]) == len(at_size["5x10", "transfer-paper"]) == 2
    assert len(at_size["5x10", "qmix-paper"]) == len(at_size["5x10", "transfer-near"]) == 1
    assert ("2x5", "dqn") in at_size
    assert ("5x10", "dqn") not in at_size, "161,051 joint actions"
    assert {m for c, m in at_size if c == "5x10"} >= {"timed-pyvrp", "timed-ortools", "timed-auto"}


def test_a_neighbours_policy_is_what_is_transferred(records):
    (found,) = [record for run, record in records.values() if run.method == "transfer-near"]
    assert found["source_policy"] == "neighbour"
    assert found["source_distance"] > 0


def test_progress_ends_with_all_runs(scale, out, said):
    assert said[0] == (0, "")
    assert said[-1][0] == len(runs_of(scale))
    assert [done for done, _ in said] == sorted(done for done, _ in said)


@pytest.fixture(scope="module")
def again(scale, out, tmp_path_factory):
    """A second run, in one process, in a folder that has the records of some runs.

    All but two of them are as they were: one is damaged, and one is of other parameters.
    """
    folder = tmp_path_factory.mktemp("second")
    there = [run for run in runs_of(scale) if run.method in ("ga", "greedy")][1:]
    for run in there:
        for inside in (f"runs/{run.id}.json", f"timings/{run.id}.json"):
            (folder / inside).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(out / inside, folder / inside)
    files = [folder / "runs" / f"{run.id}.json" for run in there]
    damaged, other, *kept = files
    damaged.write_text("{", encoding="utf-8")
    changed = json.loads(other.read_bytes())
    changed["run"]["parameters"] = {"iteration": 1}
    other.write_text(json.dumps(changed), encoding="utf-8")
    kept = {file: file.stat().st_mtime_ns for file in kept}
    told = []
    assert reproduce(scale, folder, 1, None, lambda done, word: told.append((done, word)), PAPER)
    return SimpleNamespace(folder=folder, there=there, kept=kept, told=told)


def test_a_second_run_writes_the_same_bytes(out, again):
    compared = 0
    for file in sorted(out.rglob("*")):
        inside = file.relative_to(out)
        if file.is_file() and inside.parts[0] not in TIMED:
            assert (again.folder / inside).read_bytes() == file.read_bytes(), inside
            compared += 1
    assert compared > 30
    assert {p.suffix for p in (out / "figures").iterdir()} == {".svg", ".png"}


def test_finished_runs_are_not_repeated(scale, again):
    runs = runs_of(scale)
    assert [done for done, _ in again.told] == list(range(len(again.kept), len(runs) + 1))
    kept = {run.id for run in again.there[2:]}
    assert {word for _, word in again.told[1:]} == {run.id for run in runs} - kept
    assert all(file.stat().st_mtime_ns == at for file, at in again.kept.items())
    assert [step.finished for step in do_runs(runs, again.folder, 1)] == [len(runs)]


def test_everything_says_where_it_comes_from(scale, out):
    described = "--quick"
    for file in [*out.glob("tables/*.md"), *out.glob("tables/*.csv"), *out.glob("timed/tables/*")]:
        text = file.read_text(encoding="utf-8")
        assert described in text, file
        assert "commit " in text
        assert "numpy " in text
        assert "seeds [2022, M, N, number]" in text
    for file in [*out.glob("figures/*.svg"), *out.glob("timed/figures/*.svg")]:
        assert described in file.read_text(encoding="utf-8"), file
    for file in [*out.glob("figures/*.png"), *out.glob("timed/figures/*.png")]:
        assert described.encode() in file.read_bytes(), file


def test_the_figures_and_tables_of_the_paper_are_there(out):
    figures = {file.stem for file in (out / "figures").glob("*.svg")}
    assert figures >= {
        "fig05_qmix_5x10",
        "fig06_ga_5x10",
        "fig07_transfer_5x10",
        "grid",
        "action_space",
        "dqn",
    }
    assert {file.stem for file in (out / "timed" / "tables").iterdir()} == {
        "running_times",
        "general_optimisers",
    }
    tables = {file.stem for file in (out / "tables").iterdir()}
    assert tables == {"overview", "grid", "references", "action_space", "runs", "claims"}
