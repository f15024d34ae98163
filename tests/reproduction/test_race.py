"""The race: its runs, its statistics on numbers whose answer is known, and its files."""

import numpy as np
import pytest
from referee import replay

from app.domain.records import problem_to_record
from app.reproduction.command import count_runs, reproduce, scale_of
from app.reproduction.errors import ImpossibleScale
from app.reproduction.race.entrants import COMPARED, ENTRANTS, Budget
from app.reproduction.race.outcome import Outcome
from app.reproduction.race.places import PLACES, Place
from app.reproduction.race.runs import race_runs
from app.reproduction.race.statistics import estimate, improvement, interquartile_mean, mean, share_above
from app.reproduction.records import RecordStore
from app.reproduction.scale import RACE_PLACES, Cell
from app.solvers.registry import ALGORITHMS

SCALE = {
    "race_problems": 2,
    "race_seeds": 1,
    "race_evaluations": 60,
    "learning_problems": 1,
    "learning_seeds": 1,
    "reference_moves": 20_000,
    "nodes": 2,
    "seconds": 0.05,
}


@pytest.fixture(scope="module")
def scale():
    return scale_of(True, SCALE, None, "uniform-5x10 drawn")


@pytest.fixture(scope="module")
def out(scale, tmp_path_factory):
    """The folder after one run of the race, which was interrupted once."""
    folder = tmp_path_factory.mktemp("race")
    assert not reproduce(scale, folder, 1, 0.0, lambda done, word: None, ("race",))
    assert reproduce(scale, folder, 1, None, lambda done, word: None, ("race",))
    return folder


def test_places_are_named_as_the_scale_names_them():
    assert tuple(map(str, PLACES)) == RACE_PLACES
    assert Place.parse("clustered-5x10") == Place("clustered", Cell(5, 10))
    assert [Place.parse(text) for text in RACE_PLACES] == list(PLACES)
    with pytest.raises(ImpossibleScale, match="'clustered-7x7' is no place"):
        Place.parse("clustered-7x7")


def test_a_number_is_the_same_problem_always_and_families_differ():
    for place in (PLACES[0], PLACES[13], PLACES[-1]):
        assert place.problem(3) == place.problem(3)
        assert place.problem(3) != place.problem(4)
    assert Place.parse("scarce-5x10").problem(0) != Place.parse("deadline-5x10").problem(0)


def test_every_algorithm_for_comparison_runs_in_both_races():
    ran = {entrant.algorithm for entrant in ENTRANTS.values() if entrant.budget is Budget.EVALUATIONS}
    assert {name for name, each in ALGORITHMS.items() if each.comparison} - ran <= {"dqn"}
    timed = {entrant.algorithm for entrant in ENTRANTS.values() if entrant.budget is Budget.SECONDS}
    assert {*COMPARED, "ga", "qmix", "transfer_qmix", "auto", "pyvrp", "ortools"} == timed


def test_each_gets_the_same_evaluations(scale, out):
    store = RecordStore(out)
    for run in race_runs(scale):
        record = store.read(run)
        if run.how.budget is Budget.EVALUATIONS and not run.how.learns:
            spent = run.how.evaluations(record["history"]["epoch"][-1])
            # A market ends after the bids of all UAVs that it has asked for.
            late = 300 if run.method in ("contract_net", "bundles") else 0
            assert 60 <= spent <= 60 + late, run.id


def test_every_reward_is_what_the_referee_computes(scale, out):
    store = RecordStore(out)
    for run in race_runs(scale):
        record, problem = store.read(run), run.place.problem(run.problem)
        if problem.objective.unloading == "planned" or "refused" in record:
            continue
        checked = replay(problem_to_record(problem), record["assignment"])
        assert record["reward"] == pytest.approx(checked["reward"], abs=1e-9), run.id


def test_no_share_without_a_limit_is_above_one(scale, out):
    runs = race_runs(scale)
    outcome = Outcome(runs, RecordStore(out))
    for name in outcome.entrants(Budget.EVALUATIONS):
        for stratum in outcome.strata(name):
            assert stratum.max() <= 1.0 + 1e-9
    assert len(runs) == count_runs(scale, ("race",))


def test_tables_and_figures_are_there_and_say_where_they_come_from(out):
    tables = {file.stem for file in (out / "tables").glob("*.md")}
    assert tables == {"race_evaluations", "race_evaluations_places"}
    timed = {file.stem for file in (out / "timed" / "tables").glob("*.md")}
    assert timed == {"race_seconds", "race_seconds_places"}
    for file in out.rglob("*.md"):
        assert "--race-evaluations 60" in file.read_text(encoding="utf-8")
    assert {file.stem for file in (out / "figures").glob("*.svg")} == {"race_evaluations", "race_curves_5x10"}
    assert (out / "timed" / "figures" / "race_seconds.png").exists()
    assert "race_evaluations.md" in (out / "SHA256SUMS").read_text(encoding="utf-8")


def test_the_interquartile_mean_is_that_of_the_middle_half():
    values = np.array([9.0, 1.0, 2.0, 3.0, 4.0, -50.0, 5.0, 100.0])
    assert interquartile_mean(values) == pytest.approx((2 + 3 + 4 + 5) / 4)
    # Of six values the middle half begins in the midst of the second.
    assert interquartile_mean(np.arange(6.0)) == pytest.approx((0.5 * 1 + 2 + 3 + 0.5 * 4) / 3)


def test_intervals_hold_the_value_and_shrink_with_more_problems():
    rng = np.random.default_rng(1)
    few, many = ([rng.normal(0.8, 0.1, (count, 3)) for _ in range(2)] for count in (4, 100))
    for strata in (few, many):
        found = estimate(strata, mean)
        assert found.low < found.value < found.high
        assert found.value == pytest.approx(np.concatenate([each.ravel() for each in strata]).mean())
    widths = [estimate(strata, mean).high - estimate(strata, mean).low for strata in (few, many)]
    assert widths[0] > 2 * widths[1]
    assert estimate(few, mean) == estimate(few, mean)


def test_a_spread_between_problems_is_not_hidden_by_seeds():
    """Ten seeds of one value each: the interval is that of the three problems."""
    problems = np.repeat(np.array([[0.2], [0.5], [0.8]]), 10, axis=1)
    found = estimate([problems], mean)
    assert (found.low, found.high) == pytest.approx((0.2, 0.8), abs=0.11)


def test_with_one_problem_there_is_no_interval():
    assert estimate([np.array([[0.5, 0.7]])], mean) == pytest.approx((0.6, 0.6, 0.6))


def test_profiles_count_runs_and_ties_count_half():
    shares = [np.array([[0.5, 0.9], [0.9, 1.0]])]
    assert estimate(shares, share_above(0.9)).value == 0.75
    theirs = [np.array([[0.5, 0.5], [0.95, 1.0]])]
    (ahead,) = improvement(shares, theirs)
    assert ahead.ravel() == pytest.approx([(0.5 + 0.5 + 1 + 1) / 4, (0 + 0 + 1 + 0.5) / 4])
