"""The service with its workers on a Ray cluster answers as it does with workers of its own."""

import pytest
from pydantic import ValidationError
from ray_nodes import ray_is_installed

from app.settings import Settings


def test_workers_of_other_machines_need_a_database_that_they_can_reach():
    with pytest.raises(ValidationError, match="SQLite"):
        Settings(executor="ray", ray_address="head.example:6379")
    url = "postgresql://allocator@db.example/allocator"
    settings = Settings(executor="ray", ray_address="head.example:6379", database_url=url, threads_per_job=3)
    assert settings.worker_resources == {"CPU": 3.0}


def test_resources_are_a_json_object(monkeypatch):
    monkeypatch.setenv("ALLOCATOR_RAY_RESOURCES", '{"CPU": 1, "large": 0.5}')
    assert Settings().worker_resources == {"CPU": 1.0, "large": 0.5}


def test_answers_are_those_of_the_local_workers(client, start_service, problem):
    if not ray_is_installed():
        pytest.skip("no Ray: pip install '.[ray]'")
    on_ray = start_service(executor="ray", workers=1).await_ready().client
    for algorithm, parameters in (
        ("greedy", {}),
        ("ga", {"iteration": 20}),
        ("local_search", {"moves": 5000}),
        ("transfer_qmix", {"mode": "service", "n_epochs": 1}),
    ):
        request = {**problem, "algorithm": algorithm, "seed": 7, "parameters": parameters}
        here, there = (each.post("/allocate", json=request) for each in (client, on_ray))
        assert here.status_code == there.status_code == 200, there.text
        answers = [answer.json() for answer in (here, there)]
        for answer in answers:
            del answer["job_id"], answer["elapsed_s"]
        assert answers[0] == answers[1]
    assert on_ray.get("/readyz").json()["workers_ready"] == 1
