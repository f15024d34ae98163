"""What the repository keeps of the service's description is current."""

import json

import pytest

from app.api.published import description, published

ROOT_FILES = {"openapi.json", "types.py", "connection.py", "synchronous.py"}


@pytest.fixture(scope="module")
def texts():
    return published()


def test_every_file_is_as_it_would_be_written(texts):
    assert {file.name for file in texts} == ROOT_FILES
    for file, text in texts.items():
        assert file.read_text("utf-8") == text, f"{file.name}: run python -m app.api.published"


def test_the_environment_has_no_part_in_it(texts, monkeypatch):
    monkeypatch.setenv("ALLOCATOR_MAX_UAVS", "7")
    monkeypatch.setenv("ALLOCATOR_REQUIRE_KEYS", "true")
    (written,) = (text for file, text in texts.items() if file.name == "openapi.json")
    assert json.loads(written) == json.loads(json.dumps(description()))
