"""Mutated bodies against everything that takes one: a small part of what `bench_mutations.py` sends."""

from mutation_trial import MutationTrial

BODIES = 500


def test_every_mutated_body_gets_its_documented_answer(client):
    described = client.get("/openapi.json").json()["paths"]
    paths = sorted(path for path, methods in described.items() if "requestBody" in methods.get("post", {}))
    trial = MutationTrial(client.base_url.host, client.base_url.port, seed=1, paths=paths)
    trial.run(BODIES, connections=8)
    assert trial.faults == []
    assert trial.answers.total() == BODIES
    assert trial.answers["/allocate 200"] > 0
    assert "allocator_worker_restarts_total 0.0" in client.get("/metrics").text
