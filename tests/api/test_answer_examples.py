"""The description shows what the service answers: examples are recorded again, on the tests' service."""

import json
import re

import pytest
from recorded_answers import FOLDER, PROBLEM, record

from app.api.problem_types import PROBLEM_TYPES

EXACT = ("allocate", "evaluate", "get_job_problem", "get_mission_plan", "compare_mission_plans", "get_plan")
"""Operations whose answers are the same but for ids and times."""

CANNOT_BE_TYPED = {"application/zip", "application/octet-stream"}
TIME = re.compile(r'"elapsed_s": [\d.e-]+|\d{4}-\d\d-\d\dT[\d:.]+Z')
ID = re.compile(r"\b[0-9a-f]{8}(?:[0-9a-f]{24})?\b")


@pytest.fixture(scope="module")
def recorded(service):
    return record(service.client)


@pytest.fixture(scope="module")
def shown():
    return {file.stem: json.loads(file.read_text("utf-8")) for file in FOLDER.glob("*.json")}


@pytest.fixture(scope="module")
def description(service):
    return service.client.get("/openapi.json").json()


def shape(value):
    """What is where in a value: names, and types; of a list its first item."""
    if isinstance(value, dict):
        return {name: shape(each) for name, each in value.items()}
    if isinstance(value, list):
        return [shape(value[0])] if value else []
    return type(value).__name__ if not isinstance(value, int | float) else "number"


def masked(value):
    return TIME.sub("TIME", ID.sub("ID", json.dumps(value)))


def test_every_operation_is_recorded_as_it_is_shown(recorded, shown):
    answers, _ = recorded
    assert answers.keys() == shown.keys() - {"problems"}
    for operation, by_status in answers.items():
        names = {s: {m: list(each) for m, each in media.items()} for s, media in by_status.items()}
        kept = {s: {m: list(each) for m, each in media.items()} for s, media in shown[operation].items()}
        assert names == kept, operation


@pytest.mark.parametrize("operation", EXACT)
def test_plans_are_shown_as_they_are(operation, recorded, shown):
    assert masked(recorded[0][operation]) == masked(shown[operation])


def test_other_answers_have_the_members_that_are_shown(recorded, shown):
    for operation, by_status in recorded[0].items():
        if operation not in EXACT:
            assert shape(by_status).keys() == shape(shown[operation]).keys()
            for status, media in by_status.items():
                for kind, examples in media.items():
                    for name, value in examples.items():
                        like = shown[operation][status][kind][name]
                        assert type(value) is type(like), (operation, name)
                        if isinstance(value, dict):
                            assert value.keys() == like.keys(), (operation, name)


def test_problems_are_shown_as_they_are(recorded, shown):
    _, problems = recorded
    assert problems.keys() == shown["problems"].keys()
    for code, problem in problems.items():
        like = shown["problems"][code]
        assert problem.keys() == like.keys(), code
        assert (problem["type"], problem["status"]) == (like["type"], PROBLEM_TYPES[code].status)
        assert [each["pointer"] for each in problem.get("errors", [])] == [
            each["pointer"] for each in like.get("errors", [])
        ]


def test_every_answer_and_every_event_has_an_example(description, shown):
    for path, operations in description["paths"].items():
        for operation in operations.values():
            for status, response in operation["responses"].items():
                for media, content in response.get("content", {}).items():
                    if media not in CANNOT_BE_TYPED:
                        assert content["examples"], (operation["operationId"], status, media)
                    if media == PROBLEM:
                        for example in content["examples"].values():
                            assert "{" not in example["value"]["instance"]
                            assert len(example["value"]["instance"]) >= len(path.partition("{")[0])
    stream = description["paths"]["/jobs/{job_id}/events"]["get"]["responses"]["200"]["content"]
    assert "event: end" in stream["text/event-stream"]["examples"]["beira"]["value"]
