from dataclasses import replace

import numpy as np
import pytest
import torch
from referee import replay
from stopping import at_once

from app.domain.errors import InvalidParameters, NoCompatibleSource
from app.domain.records import problem_to_record
from app.learning.checkpoints.checkpoint import decode
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import Actor
from app.learning.parameters import QmixParameters, TransferQmixParameters
from app.learning.qmix import Qmix
from app.learning.transfer import TransferQmix
from app.library.description import task_description
from app.library.entries import new_policy
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.stop import never
from policy_store.database import Database
from policy_store.library import PolicyLibrary


def task(seed, sizes=(3, 5, 2)):
    return generate("uniform", *sizes, np.random.default_rng(seed))


def trained(problem, seed=0, **parameters):
    defaults = {
        "mode": "paper",
        "n_epochs": 40,
        "learning_starts": 10,
        "drqn_hidden_dim": 16,
        "qmix_hidden_dim": 8,
    }
    solver = Qmix(QmixParameters(**{**defaults, **parameters}), SolverContext())
    return solver.solve(problem, seed, never, lambda progress: None).checkpoint


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    url = f"sqlite:///{tmp_path_factory.mktemp('store') / 'library.db'}"
    database = Database(url)
    library = PolicyLibrary(database)
    library.migrate()
    for seed in range(6):
        library.add(new_policy(f"small {seed}", task(seed), trained(task(seed), seed), policy_id=f"s{seed}"))
    other = task(9, (2, 4, 1))
    library.add(new_policy("other size", other, trained(other), policy_id="other"))
    # As near as can be to the task of seed 50, but with other networks.
    wide = trained(task(50), drqn_hidden_dim=20)
    library.add(new_policy("other hidden units", task(50), wide, policy_id="wide"))
    yield url, library
    database.dispose()


def transfer(store, problem, *, seed=1, stop=never, **parameters):
    defaults = {"mode": "paper", "drqn_hidden_dim": 16, "qmix_hidden_dim": 8}
    solver = TransferQmix(TransferQmixParameters(**{**defaults, **parameters}), SolverContext(store[0]))
    return solver.solve(problem, seed, stop, lambda progress: None)


@pytest.mark.parametrize("seed", range(40, 46))
def test_nearest_source_of_the_same_size_is_taken(store, seed):
    problem = task(seed)
    query = task_description(problem).astype(np.float32).astype(np.float64)
    totals = {}
    for source in range(6):
        description = task_description(task(source)).astype(np.float32).astype(np.float64)
        totals[f"s{source}"] = float(((description - query) ** 2).sum())
    nearest = min(totals, key=totals.get)
    source = transfer(store, problem, n_epochs=0).source_policy
    assert (source.id, source.name) == (nearest, f"small {nearest[1:]}")
    assert source.distance == pytest.approx(totals[nearest])


def test_source_with_other_hidden_units_is_passed_over(store):
    assert transfer(store, task(50), n_epochs=0).source_policy.id != "wide"
    source = transfer(store, task(50), n_epochs=0, drqn_hidden_dim=20).source_policy
    assert (source.id, source.distance) == ("wide", 0.0)


def test_begins_with_exactly_the_sources_parameters(store):
    problem = task(41)
    solution = transfer(store, problem, n_epochs=0)
    source = decode(store[1].checkpoint(solution.source_policy.id)).network
    result = decode(solution.checkpoint).network
    for (name, before), after in zip(source.state_dict().items(), result.state_dict().values(), strict=True):
        assert torch.equal(before, after), name
    record = Actor(SwarmEnvironment(problem), source).play_greedily()
    assert solution.history.epoch == [0]
    assert solution.history.reward == [record.reward]


def test_fine_tuning_changes_agent_and_mixer_and_keeps_the_best(store):
    problem = task(42)
    solution = transfer(store, problem, n_epochs=60, learning_starts=10)
    assert solution.history.epoch == list(range(61))
    source = decode(store[1].checkpoint(solution.source_policy.id)).network.state_dict()
    result = decode(solution.checkpoint).network.state_dict()
    assert not any(torch.equal(source[name], result[name]) for name in source)
    rows = [list(row) for row in solution.plan.assignment]
    assert replay(problem_to_record(problem), rows)["reward"] >= max(solution.history.reward) - 1e-9


def test_what_was_learned_can_be_a_source(store):
    problem = task(43)
    solution = transfer(store, problem, n_epochs=5)
    policy = new_policy("learned", problem, solution.checkpoint)
    assert (policy.architecture, policy.algorithm) == ("qmix-paper-1", "transfer_qmix")


def test_same_seed_same_answer(store):
    answers = [transfer(store, task(44), seed=seed, n_epochs=50, learning_starts=10) for seed in (1, 1, 2)]
    assert answers[0] == answers[1]
    assert answers[0].checkpoint != answers[2].checkpoint


def test_stop_from_the_beginning_returns_the_sources_plan(store):
    solution = transfer(store, task(45), stop=at_once())
    assert solution.history.epoch == [0]
    rows = [list(row) for row in solution.plan.assignment]
    earned = replay(problem_to_record(task(45)), rows)["reward"]
    assert earned == pytest.approx(max(0.0, solution.history.reward[0]))


def test_source_asked_for_is_taken(store):
    solution = transfer(store, task(46), n_epochs=0, source="s3")
    description = task_description(task(3)).astype(np.float32).astype(np.float64)
    query = task_description(task(46)).astype(np.float32).astype(np.float64)
    assert solution.source_policy.id == "s3"
    assert solution.source_policy.distance == pytest.approx(float(((description - query) ** 2).sum()))


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("nobody", "no policy 'nobody'"),
        ("other", "'other' .*does not fit"),
        ("wide", "'wide' .*does not fit"),
    ],
)
def test_source_that_does_not_exist_or_fit_is_refused(store, source, reason):
    with pytest.raises(InvalidParameters, match=reason) as caught:
        transfer(store, task(46), source=source)
    assert [violation.pointer for violation in caught.value.violations] == ["/parameters/source"]


def test_no_source_of_the_size_is_refused_with_the_sizes_there_are(store):
    with pytest.raises(NoCompatibleSource, match="no source policy for 4x5x2") as caught:
        transfer(store, task(0, (4, 5, 2)))
    assert caught.value.details == {"sizes": [[2, 4, 1], [3, 5, 2]]}


def test_no_source_of_the_hidden_units_is_refused(store):
    with pytest.raises(NoCompatibleSource, match="none has 64 and 32 hidden units"):
        transfer(store, task(0), drqn_hidden_dim=64, qmix_hidden_dim=32)


def test_no_library_is_refused():
    solver = TransferQmix(TransferQmixParameters(mode="paper"), SolverContext())
    with pytest.raises(NoCompatibleSource, match="there is no library") as caught:
        solver.solve(task(0), 1, never, lambda progress: None)
    assert caught.value.details == {"sizes": []}


def test_a_policy_trained_on_a_like_task_is_a_better_beginning_than_none():
    source = task(0)
    lighter = tuple(replace(u, loadlist=tuple(0.9 * amount for amount in u.loadlist)) for u in source.uavs)
    problem = replace(source, uavs=lighter)
    first_sight = {}
    for epochs in (0, 600):
        checkpoint = trained(source, n_epochs=epochs, epsilon_anneal_steps=1000, lr=1e-3)
        network = decode(checkpoint).network
        first_sight[epochs] = Actor(SwarmEnvironment(problem), network).play_greedily().reward
    assert first_sight[600] > first_sight[0] + 0.5
