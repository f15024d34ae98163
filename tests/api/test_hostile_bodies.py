"""One body takes neither the server's memory nor its loop: what is looked at and built is counted."""

import asyncio
import json
import threading
from types import SimpleNamespace

import pytest
from hostile_bodies import AREAS, hostile_bodies

from app.api import body_validation, json_body
from app.api.allocation_models import AllocationRequest
from app.api.batch_models import BatchRequest
from app.api.body_validation import BodyValidator
from app.api.errors import InvalidBody, RequestError
from app.api.json_structure import (
    DEEPEST,
    FEW_CONTAINERS,
    FEW_VALUES,
    MOST_NAMES,
    NestedTooDeep,
    UnlikelyShape,
    require_likely_shape,
)
from app.api.library_models import Registration, SimilarRequest
from app.domain.errors import AllocatorError, ProblemTooLarge
from app.settings import Settings

LARGE = 8_300_000
SETTINGS = Settings()
ROUTES = {
    "/allocate": AllocationRequest,
    "/allocate/batch": BatchRequest,
    "/library": Registration,
    "/library/similar": SimilarRequest,
}
LONGEST = json_body.longest_list(SETTINGS)


def containers_of(value):
    """Count the lists and objects of a parsed value."""
    if isinstance(value, dict):
        return 1 + sum(map(containers_of, value.values()))
    return 1 + sum(map(containers_of, value)) if isinstance(value, list) else 0


@pytest.fixture
def counted(monkeypatch):
    """What the reading of a body has built: parsed values, and errors of the validator."""
    seen = SimpleNamespace(values=[], errors=0)
    parse, add = json_body.parse_json, body_validation._Found.add

    def count_errors(found, at, error, model, known):
        seen.errors += error.error_count()
        add(found, at, error, model, known)

    def keep(body):
        seen.values.append(parse(body))
        return seen.values[-1]

    monkeypatch.setattr(json_body, "parse_json", keep)
    monkeypatch.setattr(body_validation._Found, "add", count_errors)
    return seen


@pytest.mark.parametrize("declared", ROUTES.values(), ids=ROUTES)
def test_little_is_built_of_a_body_that_no_route_takes(counted, declared):
    validator = BodyValidator(declared)
    for kind, body in hostile_bodies(LARGE):
        with pytest.raises((RequestError, AllocatorError)) as refused:
            json_body.read_body(body, validator, SETTINGS)
        assert refused.value.code in ("invalid-request", "malformed-json", "problem-too-large"), kind
        assert len(str(refused.value)) < 1000, kind
        assert len(getattr(refused.value, "errors", ())) <= 100, kind
        assert counted.errors < 500, kind
        # An object takes 64 bytes at least, one with names a few hundred.
        assert sum(map(containers_of, counted.values)) <= FEW_CONTAINERS, kind
        counted.errors, counted.values[:] = 0, []


@pytest.mark.parametrize("count", [66_000, 400_000, 2_780_000])
def test_the_body_that_killed_the_server_is_refused_at_its_beginning(count):
    body = ("{" + AREAS + ',"uavs":[' + ",".join(["{}"] * count) + "]}").encode()

    with pytest.raises(UnlikelyShape) as refused:
        require_likely_shape(body, LONGEST)

    assert refused.value.pointer == "/uavs"
    assert str(LONGEST) in refused.value.reason


def test_the_check_of_fields_ends_where_enough_is_wrong():
    body = {"uavs": [{}] * 1000, "targets": [{}] * 2000}

    with pytest.raises(InvalidBody) as refused:
        BodyValidator(AllocationRequest).validate(body, SETTINGS)

    assert len(refused.value.errors) == 100
    assert refused.value.built == 100
    assert "at least 99 more" in refused.value.detail


def test_lengths_are_looked_at_before_items():
    class Untouchable(dict):
        def __getitem__(self, _name):
            raise AssertionError("an item was looked at")

    body = {"uavs": [Untouchable()] * 1001, "targets": [Untouchable()]}

    with pytest.raises(ProblemTooLarge, match="1001 UAVs, at most 1000"):
        BodyValidator(AllocationRequest).validate(body, SETTINGS)


def test_the_largest_requests_are_taken():
    uav = {"x_s": 0.25, "y_s": 0.5, "speed": 1.5, "voyage": 3.75, "loadlist": [1.123456789012345] * 64}
    area = {"x": 0.125, "y": 0.5, "level": 1, "loadlist": [2.123456789012345] * 64}
    largest = json.dumps({"uavs": [uav] * 1000, "targets": [area] * 2000}).encode()

    made = json_body.read_body(largest, BodyValidator(AllocationRequest), SETTINGS)
    assert (len(made.uavs), len(made.targets)) == (1000, 2000)

    small = {
        "uavs": [{"x_s": 0, "y_s": 0, "speed": 1, "voyage": 1, "loadlist": [1] * 64}] * 16,
        "targets": [{"x": 0, "y": 0, "level": 1, "loadlist": [1] * 64, "id": "{[" * 50}],
    }
    batch = json.dumps({"problems": [small] * 1000}, separators=(",", ":")).encode()
    assert len(json_body.read_body(batch, BodyValidator(BatchRequest), SETTINGS).problems) == 1000


@pytest.mark.parametrize(
    ("text", "pointer"),
    [
        ('{"a":[' + "1," * LONGEST + "1]}", "/a"),
        ('{"a":[{"b":[{},' + "1," * LONGEST + "1]}]}", "/a/0/b"),
        ('{"a~/":[0,[' + "{}," * LONGEST + "1]]}", "/a~0~1/1"),
        ("{" + '"x":1,' * MOST_NAMES + '"x":1}', ""),
        ('{"x":"' + "\\n" * 1001 + '"}', "/x"),
        ('{"x":[' + ",".join(['{"y":[' + ",".join(["[]"] * 1900) + "]}"] * 20) + "]}", None),
        (",".join(["[" + "1," * 1999 + "1]"] * 130), ""),
    ],
)
def test_what_no_request_has_is_refused_where_it_is(text, pointer):
    padding = "[" + "{}," * FEW_CONTAINERS + "{}]"  # so that it is looked through at all
    with pytest.raises(UnlikelyShape) as refused:
        require_likely_shape((text + padding).encode(), LONGEST)
    if pointer is not None:
        assert refused.value.pointer == pointer


def test_nesting_is_bounded_in_a_body_that_is_looked_through():
    deep = "[" * (DEEPEST + 1) + "]" * (DEEPEST + 1)
    with pytest.raises(NestedTooDeep):
        require_likely_shape((deep + "," * 2 * FEW_VALUES).encode(), LONGEST)


def test_large_bodies_are_read_beside_the_event_loop(client, problem):
    """The loop's own thread reads small ones; the answers are the same."""
    small = {**problem, "algorithm": "greedy", "uavs": [{}] * 3}
    large = {**small, "objective": {"x" * 20_000: 1}}
    for body in (small, large):
        refused = client.post("/allocate", json=body)
        assert refused.status_code == 422
        assert refused.json()["errors"][0]["pointer"] == "/uavs/0/x_s"


def test_who_reads_large_bodies(monkeypatch):
    threads = []
    monkeypatch.setattr(json_body, "read_body", lambda *_: threads.append(threading.current_thread()))

    async def read(body):
        await json_body.read_in_turn(body, None, None)

    asyncio.run(read(b"x"))
    asyncio.run(read(b"x" * 100_000))
    assert [thread.name.startswith("read-body") for thread in threads] == [False, True]


def test_the_body_that_killed_the_server_is_answered(client):
    body = "{" + AREAS + ',"uavs":[' + ",".join(["{}"] * 60_000) + "]}"
    refused = client.post("/allocate", content=body, headers={"Content-Type": "application/json"})
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["pointer"] == "/uavs"


def test_a_body_may_begin_with_a_byte_order_mark(client, problem):
    text = b"\xef\xbb\xbf" + json.dumps({**problem, "algorithm": "greedy"}).encode()
    answer = client.post("/allocate", content=text, headers={"Content-Type": "application/json"})
    assert answer.status_code == 200, answer.text
