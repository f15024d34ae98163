"""The service as a whole: health, request ids, its description, what its process does not load."""

import json
import re
import signal
import subprocess
import sys
from html import escape
from pathlib import Path

import pytest

from app.api.openapi_examples import (
    ALLOCATION_EXAMPLES,
    REGISTRATION_EXAMPLES,
    SIMILAR_EXAMPLES,
)
from app.api.problem_types import PROBLEM_TYPES

ROOT = Path(__file__).parents[2]
ASYNC = {"Prefer": "respond-async"}
# A clean end is followed by the signal that asked for it, as a shell expects.
ENDED = (0, -signal.SIGTERM)
LONG = {"algorithm": "qmix", "parameters": {"n_epochs": 10_000_000}}


def test_alive_and_ready(client):
    assert client.get("/healthz").json()["status"] == "ok"
    ready = client.get("/readyz").json()
    assert ready["status"] == "ready"
    assert ready["workers"] == 2
    assert 1 <= ready["workers_ready"] <= 2


@pytest.mark.parametrize("path", ["/healthz", "/nothing", "/allocate", "/openapi.json", "/jobs", "/docs"])
def test_every_response_has_a_request_id(client, path):
    given = client.get(path, headers={"X-Request-ID": "trace-7f"})
    made = client.get(path)
    hostile = client.get(path, headers={"X-Request-ID": "a b<script>"})

    assert given.headers["x-request-id"] == "trace-7f"
    assert re.fullmatch("[0-9a-f]{32}", made.headers["x-request-id"])
    assert re.fullmatch("[0-9a-f]{32}", hostile.headers["x-request-id"])


def test_web_process_loads_neither_torch_nor_compiled_code():
    program = (
        "import sys, json, app.api.application as a, app.settings as s\n"
        "a.create_application(s.Settings()).openapi()\n"
        "from app.solvers.registry import ALGORITHMS, parse_parameters\n"
        "[parse_parameters(name, {}) for name in ALGORITHMS]\n"
        "print(json.dumps(sorted({name.partition('.')[0] for name in sys.modules})))"
    )

    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT, timeout=60
    )

    loaded = set(json.loads(done.stdout))
    assert {"fastapi", "sqlalchemy", "numpy"} <= loaded
    assert not {"torch", "numba", "llvmlite"} & loaded


def test_description_is_complete(client):
    description = client.get("/openapi.json").json()
    expected = {
        "allocate": ("post", "/allocate"),
        "list_algorithms": ("get", "/algorithms"),
        "register_policy": ("post", "/library"),
        "list_policies": ("get", "/library"),
        "find_similar": ("post", "/library/similar"),
        "get_policy": ("get", "/library/{policy_id}"),
        "get_checkpoint": ("get", "/library/{policy_id}/checkpoint"),
        "delete_policy": ("delete", "/library/{policy_id}"),
        "list_jobs": ("get", "/jobs"),
        "get_job": ("get", "/jobs/{job_id}"),
        "get_job_events": ("get", "/jobs/{job_id}/events"),
        "cancel_job": ("delete", "/jobs/{job_id}"),
        "get_health": ("get", "/healthz"),
        "get_readiness": ("get", "/readyz"),
        "list_examples": ("get", "/examples"),
        "get_example": ("get", "/examples/{name}"),
    }
    operations = {
        operation["operationId"]: (method, path)
        for path, methods in description["paths"].items()
        for method, operation in methods.items()
    }
    assert expected.items() <= operations.items()
    for methods in description["paths"].values():
        for operation in methods.values():
            assert operation["summary"]
            assert operation["description"]
            for status, response in operation["responses"].items():
                assert response["description"]
                if int(status) >= 400:
                    assert list(response["content"]) == ["application/problem+json"], operation["operationId"]
    assert "HTTPValidationError" not in json.dumps(description)
    references = set(re.findall(r'"#/components/schemas/([^"]+)"', json.dumps(description)))
    assert references <= set(description["components"]["schemas"])
    assert "ProblemDetails" in references


def test_description_has_an_example_for_each_algorithm(client):
    description = client.get("/openapi.json").json()
    algorithms = {item["name"] for item in client.get("/algorithms").json()["algorithms"]}

    def examples(path):
        return description["paths"][path]["post"]["requestBody"]["content"]["application/json"]["examples"]

    others = {"cyclone-idai", "cyclone-freddy", "rwanda-floods", "planned-unloading"}
    others |= {"planned-loading", "mid-mission"}
    assert set(examples("/allocate")) == algorithms | others
    assert set(examples("/allocate")) == set(ALLOCATION_EXAMPLES)
    assert set(examples("/library")) == {"checkpoint", "train", "job_id"} == set(REGISTRATION_EXAMPLES)
    similar = client.post("/library/similar", json=SIMILAR_EXAMPLES["paper"]["value"])
    assert similar.status_code == 200


def test_documentation_page_loads_nothing_from_elsewhere(client):
    page = client.get("/docs").text
    loaded = re.findall(r'(?:src|href)="([^"]+)"', page)

    assert len(loaded) == 3
    for place in loaded:
        assert place.startswith("/docs/assets/")
        assert client.get(place).status_code == 200
    assert "/openapi.json" in page


def test_every_type_of_error_has_a_meaning_and_an_example(client):
    page = client.get("/docs/errors").text
    assert re.findall(r'<tr id="([^"]+)"', page) == list(PROBLEM_TYPES)
    plain = re.sub("</?code>", "", page)
    for each in PROBLEM_TYPES.values():
        assert plain.count(f"<td>{escape(each.meaning).replace('`', '')}</td>") == 1
        assert f"<td>{escape(each.remedy).replace('`', '')}</td>" in plain
    assert not re.findall(r'(?:src|href)="', page)
    shown = set()
    for operations in client.get("/openapi.json").json()["paths"].values():
        for operation in operations.values():
            for status, response in operation["responses"].items():
                content = response.get("content", {}).get("application/problem+json", {})
                for code, example in content.get("examples", {}).items():
                    place, _, name = example["value"]["type"].partition("#")
                    assert (place, name) == ("/docs/errors", code)
                    assert str(example["value"]["status"]) == status
                    shown.add(code)
    assert {"invalid-request", "unauthenticated", "no-compatible-source", "queue-full"} <= shown


def test_large_answers_are_compressed_and_streams_are_not(client, problem):
    def encoding(path):
        return client.get(path, headers={"Accept-Encoding": "gzip"}).headers.get("content-encoding")

    assert encoding("/openapi.json") == encoding("/dashboard/js/map.js") == "gzip"
    assert encoding("/healthz") is None
    assert client.get("/openapi.json", headers={"Accept-Encoding": "identity"}).json()["openapi"]
    policy = client.get("/library").json()["policies"][0]["id"]
    assert encoding(f"/library/{policy}/checkpoint") is None
    body = {"problems": [{**problem, "algorithm": "greedy"}] * 10}
    with client.stream("POST", "/allocate/batch", json=body) as stream:
        assert "content-encoding" not in stream.headers
        assert len(list(stream.iter_lines())) == 10
    job = client.post("/allocate", json={**problem, "algorithm": "greedy"}).json()["job_id"]
    with client.stream("GET", f"/jobs/{job}/events") as stream:
        assert "content-encoding" not in stream.headers
