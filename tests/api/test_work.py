"""What workers do, called as they call it: progress, stopping, checkpoints, a warm-up that leaves nothing."""

import base64
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from referee import replay

from app.allocation import tasks
from app.api.openapi_examples import example_problem
from app.api.problem_models import ProblemModel, to_problem
from app.domain.errors import InvalidCheckpoint
from app.domain.problem import Objective, Problem
from app.domain.records import problem_from_record, problem_to_record
from app.jobs.model import BEST_KNOWN
from app.jobs.worker import CANCEL, WorkContext, new_control
from app.learning.checkpoints.checkpoint import encode
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.parameters import QmixParameters
from app.library.entries import new_policy
from app.settings import Settings
from app.simulation.generator import generate
from policy_store.database import Database
from policy_store.library import PolicyLibrary

ROOT = Path(__file__).parents[2]
QMIX = {"n_epochs": 50, "buffer_size": 4, "batch_size": 4, "evaluate_per_epoch": 5}


def record(name="paper-5x10"):
    """An example as jobs get it."""
    return problem_to_record(to_problem(ProblemModel(**example_problem(name)), Settings()))


def payload(algorithm, parameters, problem=None):
    return {
        "problem": problem or record(),
        "algorithm": algorithm,
        "parameters": parameters,
        "seed": 1,
        "library_url": None,
    }


def test_result_is_json_and_progress_ends_at_its_plan():
    told = []
    context = WorkContext.in_process(told.append)

    done = tasks.allocate(payload("qmix", QMIX) | {"keep_checkpoint": True}, context)

    assert json.loads(json.dumps(done.result, allow_nan=False)) == json.loads(json.dumps(done.result))
    assert done.artifact
    assert told
    best = [progress.best_reward for progress in told]
    assert best == sorted(best)
    for progress in told:
        assert replay(record(), progress.assignment)["reward"] == pytest.approx(progress.best_reward)
    assert done.result["reward"] >= best[-1] - 1e-12


@pytest.mark.parametrize(
    ("algorithm", "parameters"), [("greedy", {}), ("ga", {}), ("qmix", QMIX), ("local_search", {})]
)
def test_stopped_before_it_began_there_is_still_a_plan(algorithm, parameters):
    control = new_control()
    control[CANCEL] = 1.0

    done = tasks.allocate(payload(algorithm, parameters), WorkContext(lambda _progress: None, control))

    assert done.result["reward"] == pytest.approx(replay(record(), done.result["assignment"])["reward"])
    assert done.result["reward"] >= 0


def test_time_that_is_up_stops_it():
    context = WorkContext.in_process(lambda _progress: None, time_limit_s=0.2)

    done = tasks.allocate(payload("qmix", {**QMIX, "n_epochs": 10_000_000}), context)

    assert done.result["history"]["epoch"][-1] < 10_000_000
    replay(record(), done.result["assignment"])


@pytest.mark.parametrize("algorithm", ["auto", "local_search", "transfer_qmix", "qmix", "ga"])
def test_where_nobody_has_the_range_staying_at_home_is_proven_without_a_search(algorithm):
    problem = record()
    problem["uavs"] = [{**uav, "voyage": 0.001} for uav in problem["uavs"]]
    told = []
    context = WorkContext.in_process(told.append, time_limit_s=60.0)

    done = tasks.allocate(payload(algorithm, {}, problem), context).result

    assert done["proof"] == {"bound": 0.0, "proven": True}
    assert [progress.fraction for progress in told] == [1.0]
    assert {unmet["code"] for unmet in done["unmet"]} == {"out_of_range"}


def best_plan():
    done = tasks.allocate(payload("local_search", {}), WorkContext.in_process(lambda _progress: None))
    return done.result


def known(assignment, answered_by="local_search"):
    return {BEST_KNOWN: {"assignment": assignment, "answered_by": answered_by, "best_reward": 1e9}}


@pytest.mark.parametrize("answers", [tasks.allocate, tasks.allocate_at_once])
def test_the_best_plan_of_an_earlier_attempt_is_the_least_that_is_answered(answers):
    best = best_plan()
    told = []
    context = WorkContext.in_process(told.append, time_limit_s=None)

    done = answers(payload("greedy", {}) | known(best["assignment"]), context).result

    assert done["reward"] == pytest.approx(best["reward"])
    assert done["reward"] == pytest.approx(replay(record(), done["assignment"])["reward"])
    assert (done["algorithm"], done["answered_by"]) == ("greedy", "local_search")
    assert done["history"]["reward"][-1] == pytest.approx(best["reward"])
    # Nor does the progress fall below it.
    assert {(each.best_reward, each.answered_by) for each in told} == {(done["reward"], "local_search")}


def test_a_worse_plan_of_an_earlier_attempt_is_not_answered():
    best, poor = best_plan(), payload("greedy", {})
    poor = tasks.allocate(poor, WorkContext.in_process(lambda _progress: None)).result["assignment"]
    context = WorkContext.in_process(lambda _progress: None)

    done = tasks.allocate(payload("local_search", {}) | known(poor, "greedy"), context).result

    assert (done["reward"], done["answered_by"]) == (best["reward"], "local_search")


@pytest.mark.parametrize(
    "assignment",
    [
        [],
        [[0, 0, 0, 0]],
        [[0, 0, 0, 0, 11]],
        [[0, 0, 0, 0, -1]],
        [[0, 0, 0, 0, 0.0]],
        [[0, 0, 0, 0, True]],
        [[10] * 5] * 6,
        [[10, 10, 10, 10, 10], [0, 0, 0, 0, 0]],
        "plan",
        None,
        7,
        [None],
    ],
)
def test_a_plan_that_is_none_is_not_answered(assignment):
    context = WorkContext.in_process(lambda _progress: None)

    done = tasks.allocate(payload("greedy", {}) | known(assignment), context).result

    assert done["answered_by"] == "greedy"
    replay(record(), done["assignment"])


def test_training_is_registered_by_its_checkpoint():
    paper = payload("qmix", {**QMIX, "mode": "paper"})
    trained = tasks.train(paper, WorkContext.in_process(lambda _progress: None))
    context = WorkContext.in_process(lambda _progress: None)
    text = base64.b64encode(trained.artifact).decode()
    done = tasks.register({"name": "x", "problem": record(), "checkpoint_base64": text}, context)

    assert done.artifact == trained.artifact
    with pytest.raises(InvalidCheckpoint, match="base64"):
        tasks.register({"name": "x", "problem": record(), "checkpoint_base64": text[:-1]}, context)
    with pytest.raises(InvalidCheckpoint):
        tasks.register({"name": "x", "problem": record("cyclone-idai"), "checkpoint_base64": text}, context)


@pytest.fixture
def library_url(tmp_path):
    """A library with a policy for every size."""
    config = PairwiseConfig(width=8, layers=1, qmix_hidden_dim=4)
    task = problem_from_record(record())
    checkpoint = encode(
        PairwisePolicy.of_seed(config, 1),
        config=config,
        task=task,
        algorithm="qmix",
        seed=1,
        parameters=QmixParameters(),
        metrics={},
    )
    database = Database(f"sqlite:///{tmp_path / 'library.sqlite3'}")
    library = PolicyLibrary(database)
    library.migrate()
    library.add(new_policy("every size", task, checkpoint))
    database.dispose()
    return database.url


def test_after_the_warm_up_nothing_is_compiled_and_the_compiler_of_torch_is_not_even_loaded(library_url):
    program = """
import gc, json, sys
from numba.core.dispatcher import Dispatcher
from app.allocation import tasks
from app.allocation.warm_up import warm_up
from app.jobs.worker import WorkContext

def compiled():
    found = [each for each in gc.get_objects() if isinstance(each, Dispatcher)]
    return {
        f"{type(each).__name__} {each.py_func.__module__}.{each.py_func.__name__}": len(each.overloads)
        for each in found
    }

warm_up()
before = compiled()
for payload in json.load(sys.stdin):
    tasks.allocate(payload, WorkContext.in_process(lambda progress: None))
loaded = [name for name in ("torch", "torch._dynamo", "sympy") if name in sys.modules]
print(json.dumps([before, compiled(), loaded]))
"""
    problem = problem_from_record(record())
    changed = Problem(
        problem.uavs, problem.targets, 3, objective=Objective(None, return_to_base=False, charge_return=True)
    )
    payloads = [
        payload(algorithm, parameters, each)
        for each in (record(), record("cyclone-idai"), problem_to_record(changed))
        for algorithm, parameters in (
            ("greedy", {}),
            ("ga", {"iteration": 3}),
            ("qmix", QMIX),
            ("local_search", {"moves": 5000}),
            ("transfer_qmix", {"samples": 3, "n_epochs": 1, "polish_moves": 5000}),
            ("particle_swarm", {"evaluations": 100}),
            ("ant_colony", {"evaluations": 100}),
            ("contract_net", {"evaluations": 100}),
            ("bundles", {"evaluations": 100}),
            ("semi_random_q", {"evaluations": 100}),
        )
    ]
    few = Problem(problem.uavs[:2], problem.targets[:4])
    payloads.append(payload("dqn", QMIX, problem_to_record(few)))
    planned = replace(problem, objective=Objective(unloading="planned"))
    payloads.append(payload("greedy", {}, problem_to_record(planned)))
    plenty = [replace(uav, loadlist=tuple(1000.0 for _ in uav.loadlist)) for uav in problem.uavs]
    combined = Problem(tuple(plenty), problem.targets)
    payloads.append(payload("local_search", {"moves": 60_000, "restarts": 2}, problem_to_record(combined)))
    large = problem_to_record(generate("uniform", 40, 80, 3, np.random.default_rng(1)))
    payloads.append(payload("local_search", {"moves": 1000}, large) | {"threads": 2})
    for each in payloads:
        each["library_url"] = library_url

    done = subprocess.run(
        [sys.executable, "-c", program],
        input=json.dumps(payloads),
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        timeout=240,
    )

    before, after, loaded = json.loads(done.stdout)
    assert before
    assert after == before
    assert loaded == ["torch"]
