"""Metrics: requests and jobs are counted where they belong, and nothing a client makes up becomes a label."""

from metric_samples import samples


def grown(before, after, name, **labels):
    key = (name, *sorted(labels.items()))
    return after[key] - before.get(key, 0)


def test_requests_are_counted_by_route_and_status(client):
    before = samples(client)
    client.get("/jobs/" + "0" * 32)
    client.get("/jobs/" + "1" * 32)
    client.get("/algorithms")
    client.request("BREW", "/coffee")
    client.get("/nothing-at-all")
    after = samples(client)

    requests = "allocator_http_requests_total"
    assert grown(before, after, requests, method="GET", route="/jobs/{job_id}", status="404") == 2
    assert grown(before, after, requests, method="GET", route="/algorithms", status="200") == 1
    assert grown(before, after, requests, method="GET", route="unmatched", status="404") == 1
    assert grown(before, after, requests, method="other", route="unmatched", status="404") == 1
    assert (
        grown(before, after, "allocator_http_response_seconds_count", method="GET", route="/algorithms") == 1
    )
    labels = {value for key in after for _, value in key[1:]}
    assert not any("coffee" in value or "nothing" in value or "0000" in value for value in labels)


def test_jobs_are_counted_by_end_wait_and_algorithm(client, problem):
    before = samples(client)
    client.post("/allocate", json={**problem, "algorithm": "greedy"}).raise_for_status()
    refused = client.post("/allocate", json={**problem, "algorithm": "dqn"})
    after = samples(client)

    assert refused.status_code == 422
    assert grown(before, after, "allocator_jobs_ended_total", kind="allocate", status="succeeded") == 1
    assert grown(before, after, "allocator_jobs_ended_total", kind="allocate", status="failed") == 1
    run = {"kind": "allocate", "algorithm": "greedy"}
    assert grown(before, after, "allocator_job_run_seconds_count", **run) == 1
    assert 0 < grown(before, after, "allocator_job_run_seconds_sum", **run) < 60
    assert grown(before, after, "allocator_job_wait_seconds_count", lane="interactive") == 2


def test_levels_are_those_of_this_moment(client):
    levels = samples(client)

    assert levels[("allocator_jobs_waiting", ("lane", "interactive"))] == 0
    assert levels[("allocator_jobs_running", ("lane", "training"))] == 0
    assert levels[("allocator_workers",)] == 2
    assert 1 <= levels[("allocator_workers_ready",)] <= 2
    assert levels[("allocator_library_policies",)] == client.get("/readyz").json()["policies"]
    assert levels[("allocator_database_bytes",)] >= 4096
    assert levels[("process_resident_memory_bytes",)] > 1e6
    assert client.get("/metrics").headers["content-type"].startswith("text/plain; version=0.0.4")
