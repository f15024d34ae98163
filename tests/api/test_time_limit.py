"""However short its time and whoever has the workers: an allocation with a time limit gets a plan."""

import json
import time

import numpy as np
import pytest
from answers import but_for_reasons
from referee import replay

from app.api.openapi_examples import example_problem
from app.domain.records import problem_to_record
from app.simulation.generator import generate
from app.solvers.registry import ALGORITHMS

ENDLESS = {"algorithm": "qmix", "parameters": {"n_epochs": 10_000_000}}


def sound(problem, answer):
    replayed = replay(problem, answer["assignment"])
    assert answer["reward"] == pytest.approx(replayed["reward"])
    return replayed["reward"]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("unloading", ["greedy", "planned"])
def test_a_time_that_is_up_at_once_gives_a_legal_plan(client, algorithm, unloading):
    problem = problem_to_record(generate("uniform", 3, 5, 2, np.random.default_rng(3)))
    problem["objective"]["unloading"] = unloading
    request = {**problem, "algorithm": algorithm, "time_limit_s": 1e-9, "bound": True}

    answer = client.post("/allocate", json=request)

    assert answer.status_code == 200, answer.text
    told = answer.json()
    assert (told["algorithm"], told["answered_by"]) == (algorithm, "greedy")
    assert told["reward"] > 0
    assert told["bound"] >= told["reward"]
    if unloading == "greedy":
        sound(problem, told)
        greedy = client.post("/allocate", json={**problem, "algorithm": "greedy"}).json()
        assert told["reward"] == pytest.approx(greedy["reward"])


def test_whoever_waits_is_answered_when_the_time_is_up(narrow, problem):
    client = narrow.await_ready().client
    holder = client.post("/allocate", json=problem | ENDLESS, headers={"Prefer": "respond-async"}).json()
    request = problem | {"algorithm": "local_search", "time_limit_s": 0.3}
    later = client.post("/allocate", json=request, headers={"Prefer": "respond-async"}).json()

    answer = client.post("/allocate", json=request)

    assert answer.status_code == 200
    told = answer.json()
    assert sound(problem, told) > 0
    assert (told["algorithm"], told["answered_by"]) == ("local_search", "greedy")
    assert told["reasons"] == "pending"
    with client.stream("GET", f"/jobs/{later['id']}/events") as events:
        last = [json.loads(line[5:]) for line in events.iter_lines() if line.startswith("data:")][-1]
    assert last["status"] == "succeeded"
    assert client.get(f"/jobs/{holder['id']}").json()["status"] == "running"
    assert client.get(f"/jobs/{told['job_id']}").json()["result"]["reasons"] == "pending"
    # As soon as no worker is busy the reasons are found, and readable at the job.
    assert client.delete(f"/jobs/{holder['id']}").status_code == 202
    completed = told
    end = time.monotonic() + 60
    while completed["reasons"] == "pending":
        assert time.monotonic() < end
        completed = client.get(f"/jobs/{told['job_id']}").json()["result"]
    assert completed["reasons"] == "complete"
    assert but_for_reasons(completed) == but_for_reasons(told)
    assert [area["target_id"] for area in completed["unmet"]] == [a["target_id"] for a in told["unmet"]]
    assert all(area["verified"] for area in completed["unmet"])


@pytest.mark.parametrize("algorithm", ["auto", "local_search", "exact"])
def test_within_a_limit_reasons_are_verified_and_the_algorithm_is_named(client, algorithm):
    problem = example_problem("cyclone-idai")
    for seed in range(2):
        request = {**problem, "algorithm": algorithm, "seed": seed, "time_limit_s": 1.0}
        told = client.post("/allocate", json=request).json()
        assert told["answered_by"] == algorithm
        assert told["reasons"] == "complete"
        assert told["unmet"]
        assert all(area["verified"] for area in told["unmet"])
