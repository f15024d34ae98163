"""The library over HTTP: three ways in, pages, similar tasks, checkpoints, and what transfer finds there."""

import base64
import hashlib
import json
import re

import pytest
from referee import replay
from safetensors.numpy import load, save

TASK = {
    "uavs": [
        {"x_s": 0.1, "y_s": 0.2, "speed": 1.0, "voyage": 3.0, "loadlist": [5, 2]},
        {"x_s": 0.8, "y_s": 0.4, "speed": 1.2, "voyage": 2.5, "loadlist": [3, 6]},
    ],
    "targets": [
        {"x": 0.3, "y": 0.9, "level": 1.0, "loadlist": [2, 1]},
        {"x": 0.6, "y": 0.1, "level": 0.4, "loadlist": [1, 3]},
        {"x": 0.9, "y": 0.7, "level": 0.8, "loadlist": [4, 2]},
    ],
    "objective": {"distance_weight": 1.0},
}
QUICK = {"mode": "paper", "n_epochs": 12, "buffer_size": 4, "batch_size": 4, "evaluate_per_epoch": 4}
ASYNC = {"Prefer": "respond-async"}


def moved(task, by):
    """The same task with its first target somewhere else."""
    first, *others = task["targets"]
    return {**task, "targets": [{**first, "x": first["x"] + by}, *others]}


def learned(client, task=TASK, seed=123, **parameters):
    """The id of a job that has learned a task."""
    body = {**task, "algorithm": "qmix", "parameters": {**QUICK, **parameters}, "seed": seed}
    body["keep_checkpoint"] = True
    answer = client.post("/allocate", json=body)
    assert answer.status_code == 200, answer.text
    return answer.json()["job_id"]


@pytest.fixture
def policy(client):
    """A registered policy of TASK, deleted afterwards."""
    response = client.post("/library", json={"name": "a town", "job_id": learned(client)})
    assert response.status_code == 201, response.text
    entry = response.json()
    assert response.headers["location"] == f"/library/{entry['id']}"
    yield entry
    client.delete(f"/library/{entry['id']}")


def test_what_a_job_learned_is_registered_with_its_own_problem(client, policy):
    assert policy["name"] == "a town"
    assert (policy["n_uavs"], policy["n_targets"], policy["n_materials"]) == (2, 3, 2)
    assert policy["algorithm"] == "qmix"
    assert policy["seed"] == 123
    assert policy["task"]["uavs"][0]["id"] == "uav-1"
    assert policy["task"]["targets"][2]["loadlist"] == [4, 2]
    assert policy["metrics"]["epochs"] == QUICK["n_epochs"]
    assert client.get(f"/library/{policy['id']}").json() == policy


def test_job_can_be_registered_for_another_task_of_its_size(client):
    body = {"name": "elsewhere", "job_id": learned(client), "task": moved(TASK, 0.05)}

    entry = client.post("/library", json=body).json()

    assert entry["task"]["targets"][0]["x"] == pytest.approx(0.35)
    client.delete(f"/library/{entry['id']}")


def test_training_registers_at_its_end(client, follow):
    body = {"name": "trained", "task": TASK, "train": {"parameters": QUICK, "seed": 5}}

    response = client.post("/library", json=body)
    job = follow(response.json()["id"])

    assert response.status_code == 202
    assert response.headers["location"] == f"/jobs/{job['id']}"
    assert (job["kind"], job["status"]) == ("train", "succeeded")
    entry = client.get(f"/library/{job['result']['policy_id']}").json()
    assert (entry["name"], entry["algorithm"], entry["seed"]) == ("trained", "qmix", 5)
    assert job["result"]["reward"] == pytest.approx(replay(TASK, job["result"]["assignment"])["reward"])
    client.delete(f"/library/{entry['id']}")


def test_checkpoint_goes_out_and_comes_in_again_byte_for_byte(client, policy):
    data = client.get(f"/library/{policy['id']}/checkpoint").content
    body = {"name": "a copy", "task": TASK, "checkpoint": base64.b64encode(data).decode()}

    entry = client.post("/library", json=body).json()

    assert entry["id"] != policy["id"]
    assert entry["checkpoint"] == policy["checkpoint"]
    assert client.get(f"/library/{entry['id']}/checkpoint").content == data
    client.delete(f"/library/{entry['id']}")
    assert client.get(f"/library/{policy['id']}/checkpoint").content == data


def test_checkpoint_has_its_digest_as_etag(client, policy):
    path = f"/library/{policy['id']}/checkpoint"
    response = client.get(path)
    digest = hashlib.sha256(response.content).hexdigest()

    assert response.headers["content-type"] == "application/octet-stream"
    assert policy["checkpoint"] == {"sha256": digest, "size": len(response.content)}
    assert response.headers["etag"] == f'"{digest}"'
    for known in (f'"{digest}"', f'W/"{digest}"', f'"other", "{digest}"', "*"):
        again = client.get(path, headers={"If-None-Match": known})
        assert (again.status_code, again.content) == (304, b"")
        assert again.headers["etag"] == f'"{digest}"'
    assert client.get(path, headers={"If-None-Match": '"other"'}).status_code == 200


def test_nearest_source_task_is_first_and_is_transferred(client, policy):
    other = client.post("/library", json={"name": "far", "job_id": learned(client, moved(TASK, 0.3))}).json()
    near = moved(TASK, 0.01)

    asked = {"task": near, "similarity": "paper"}
    similar = client.post("/library/similar", json={**asked, "k": 2}).json()["similar"]
    body = {**near, "algorithm": "transfer_qmix", "parameters": {"mode": "paper", "n_epochs": 3}}
    answer = client.post("/allocate", json=body).json()

    assert [item["policy"]["id"] for item in similar] == [policy["id"], other["id"]]
    assert 0 < similar[0]["distance"] < similar[1]["distance"]
    assert answer["source_policy"]["id"] == policy["id"]
    assert answer["source_policy"]["name"] == "a town"
    assert answer["source_policy"]["distance"] == pytest.approx(similar[0]["distance"])
    assert answer["reward"] == pytest.approx(replay(near, answer["assignment"])["reward"])
    only_one = client.post("/library/similar", json={**asked, "k": 1}).json()["similar"]
    assert only_one == similar[:1]
    client.delete(f"/library/{other['id']}")


def test_similar_tasks_are_found_whatever_their_size(client, policy):
    three = {**TASK, "uavs": [*TASK["uavs"], {**TASK["uavs"][0], "x_s": 0.15}]}

    by_summary = client.post("/library/similar", json={"task": three, "k": 100}).json()["similar"]
    by_numbers = client.post("/library/similar", json={"task": three, "similarity": "paper"}).json()[
        "similar"
    ]

    distances = {item["policy"]["id"]: item["distance"] for item in by_summary}
    assert 0 < distances[policy["id"]] < 0.2
    assert list(distances.values()) == sorted(distances.values())
    assert policy["id"] not in [item["policy"]["id"] for item in by_numbers]
    wrong = client.post("/library/similar", json={"task": three, "similarity": "fast"})
    assert wrong.status_code == 422


def test_policies_that_cannot_serve_a_task_are_not_offered(client, policy):
    """One for one size is offered to a task with wind, and to none with a zone."""

    def offered(similarity, **world):
        asked = {"task": {**TASK, **world}, "k": 100, "similarity": similarity}
        found = client.post("/library/similar", json=asked).json()["similar"]
        return {item["policy"]["id"]: item["policy"]["architecture"] for item in found}

    zone = [{"polygon": [[0.4, 0.4], [0.5, 0.4], [0.45, 0.5]]}]
    for similarity in ("summary", "paper"):
        assert policy["id"] in offered(similarity, wind={"speed": 0.1, "towards": 90})
        assert policy["id"] not in offered(similarity, no_fly_zones=zone)
    assert set(offered("summary", no_fly_zones=zone).values()) == {"qmix-universal-2"}
    body = {
        **TASK,
        "no_fly_zones": zone,
        "algorithm": "transfer_qmix",
        "parameters": {"source": policy["id"]},
    }
    refused = client.post("/allocate", json=body)
    assert (refused.status_code, refused.json()["type"]) == (422, "/docs/errors#invalid-parameters")
    assert refused.json()["errors"][0]["pointer"] == "/parameters/source"


def test_transfer_by_the_paper_needs_the_same_size(client, policy):
    three = {**TASK, "uavs": [*TASK["uavs"], TASK["uavs"][0]]}

    response = client.post(
        "/allocate", json={**three, "algorithm": "transfer_qmix", "parameters": {"mode": "paper"}}
    )

    assert response.status_code == 409
    assert response.json()["type"] == "/docs/errors#no-compatible-source"
    assert [2, 3, 2] in response.json()["sizes"]


def test_source_that_does_not_exist(client):
    body = {**TASK, "algorithm": "transfer_qmix", "parameters": {"source": "nothing"}}

    response = client.post("/allocate", json=body)

    assert response.status_code == 422
    assert response.json()["type"] == "/docs/errors#invalid-parameters"
    assert response.json()["errors"][0]["pointer"] == "/parameters/source"


def test_deleted_policy_is_gone(client, policy):
    assert client.delete(f"/library/{policy['id']}").status_code == 204
    for path in (f"/library/{policy['id']}", f"/library/{policy['id']}/checkpoint"):
        assert client.get(path).status_code == 404
    similar = client.post("/library/similar", json={"task": TASK}).json()["similar"]
    assert policy["id"] not in [item["policy"]["id"] for item in similar]


def test_pages_list_every_policy_once(client):
    job_id = learned(client)
    new = [client.post("/library", json={"name": f"n{i}", "job_id": job_id}).json()["id"] for i in range(3)]

    listed, cursor = [], None
    while True:
        page = client.get("/library", params={"limit": 2, **({"cursor": cursor} if cursor else {})}).json()
        listed += [policy["id"] for policy in page["policies"]]
        cursor = page["next_cursor"]
        if cursor is None:
            break

    assert listed[:3] == new[::-1]
    assert len(listed) == len(set(listed))
    for identifier in new:
        client.delete(f"/library/{identifier}")


def test_registration_can_be_retried(client):
    body, key = {"name": "once", "job_id": learned(client)}, {"Idempotency-Key": "register-1"}

    first, again = (client.post("/library", json=body, headers=key) for _ in range(2))

    assert first.status_code == again.status_code == 201
    assert first.json() == again.json()
    client.delete(f"/library/{first.json()['id']}")


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"name": "x", "task": TASK}, ""),
        ({"name": "x", "task": TASK, "job_id": "0" * 32, "train": {}}, ""),
        ({"task": TASK, "train": {}}, "/name"),
        ({"name": "", "task": TASK, "train": {}}, "/name"),
        ({"name": "a\0b", "task": TASK, "train": {}}, "/name"),
        ({"name": "x", "train": {}}, "/task"),
        ({"name": "x", "task": {**TASK, "uavs": []}, "train": {}}, "/task/uavs"),
        ({"name": "x", "task": {**TASK, "crs": "wgs84", "max_steps": 5}, "job_id": "X"}, "/job_id"),
        ({"name": "x", "task": TASK, "train": {"algorithm": "ga"}}, "/train/algorithm"),
        ({"name": "x", "task": TASK, "train": {"algorithm": "magic"}}, "/train/algorithm"),
        ({"name": "x", "task": TASK, "train": {"parameters": {"n_epoch": 1}}}, "/train/parameters/n_epoch"),
        ({"name": "x", "task": TASK, "train": {"seed": 0.5}}, "/train/seed"),
        ({"name": "x", "task": TASK, "checkpoint": "not base64!"}, "/checkpoint"),
        ({"name": "x", "task": TASK, "checkpoint": "AgAAAAAAAAB7fQ=="}, "/checkpoint"),
        ({"name": "x", "task": TASK, "checkpoint": "A" * 200_004}, "/checkpoint"),
        ({"name": "x", "task": TASK, "checkpoint": "AgAAAAAAAAB7fQé="}, "/checkpoint"),
    ],
)
def test_registration_that_is_refused(client, body, pointer):
    response = client.post("/library", json=body)

    assert response.status_code == 422, response.text
    assert pointer in [error["pointer"] for error in response.json()["errors"]]


def test_ragged_task_is_refused_where_it_is(client):
    ragged = {**TASK, "targets": [{**TASK["targets"][0], "loadlist": [1]}]}
    for path, body in (
        ("/library", {"name": "x", "task": ragged, "train": {}}),
        ("/library/similar", {"task": ragged}),
    ):
        response = client.post(path, json=body)
        assert response.status_code == 422
        assert response.json()["errors"][0]["pointer"] == "/task/targets/0/loadlist"


def test_job_that_learned_nothing_is_not_registered(client):
    job_id = client.post("/allocate", json={**TASK, "algorithm": "greedy"}).json()["job_id"]

    response = client.post("/library", json={"name": "x", "job_id": job_id})
    unknown = client.post("/library", json={"name": "x", "job_id": "0" * 32})

    assert (response.status_code, response.json()["type"]) == (409, "/docs/errors#job-without-checkpoint")
    assert (unknown.status_code, unknown.json()["type"]) == (404, "/docs/errors#job-not-found")


def test_what_an_allocation_learns_is_kept_only_where_that_is_asked_for(client):
    body = {**TASK, "algorithm": "qmix", "parameters": QUICK}
    job_id = client.post("/allocate", json=body).json()["job_id"]

    refused = client.post("/library", json={"name": "x", "job_id": job_id})

    assert (refused.status_code, refused.json()["type"]) == (409, "/docs/errors#job-without-checkpoint")
    assert '"keep_checkpoint": true' in refused.json()["detail"]


def damaged(data, change):
    """A checkpoint with its tensors or its metadata changed."""
    length = int.from_bytes(data[:8], "little")
    metadata = json.loads(data[8 : 8 + length])["__metadata__"]
    tensors = dict(load(data))
    change(tensors, metadata)
    return save(tensors, metadata)


def _not_a_number(tensors, metadata):
    name = sorted(tensors)[0]
    tensors[name] = tensors[name].copy()
    tensors[name].flat[0] = float("nan")


def _missing(tensors, metadata):
    del tensors[sorted(tensors)[0]]


def _reshaped(tensors, metadata):
    name = sorted(tensors)[0]
    tensors[name] = tensors[name].reshape(-1, 1)


def _another_architecture(tensors, metadata):
    metadata["checkpoint"] = re.sub(
        r'"architecture":\s*"[^"]*"', '"architecture":"x"', metadata["checkpoint"]
    )


def _no_metadata(tensors, metadata):
    metadata.clear()
    metadata["format"] = "pt"


@pytest.mark.parametrize("change", [_not_a_number, _missing, _reshaped, _another_architecture, _no_metadata])
def test_damaged_checkpoint_is_refused(client, policy, change):
    data = damaged(client.get(f"/library/{policy['id']}/checkpoint").content, change)
    body = {"name": "x", "task": TASK, "checkpoint": base64.b64encode(data).decode()}

    response = client.post("/library", json=body)

    assert response.status_code == 422
    refused = response.json()
    assert refused["type"] == "/docs/errors#invalid-checkpoint"
    assert refused["errors"][0]["pointer"] == "/checkpoint"
    assert refused["sentence"] == refused["errors"][0]["sentence"]
    assert refused["values"]


def test_checkpoint_of_another_size_is_refused(client, policy):
    data = client.get(f"/library/{policy['id']}/checkpoint").content
    task = {**TASK, "targets": TASK["targets"][:2]}

    response = client.post(
        "/library", json={"name": "x", "task": task, "checkpoint": base64.b64encode(data).decode()}
    )

    assert response.status_code == 422
    assert response.json()["type"] == "/docs/errors#invalid-checkpoint"
