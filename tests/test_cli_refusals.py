"""What the command line says where a setting, a file or its output does not serve."""

import json
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import application

ROOT = Path(__file__).parents[1]


@pytest.fixture
def invoke(tmp_path):
    return lambda *arguments: CliRunner().invoke(application, [*arguments, "--data-dir", str(tmp_path)])


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("ALLOCATOR_WORKERS", "0", "ALLOCATOR_WORKERS: is 0, must be at least 1"),
        ("ALLOCATOR_RAY_RESOURCES", "{", "ALLOCATOR_RAY_RESOURCES: is no JSON"),
        ("ALLOCATOR_RAY_RESOURCES", '{"CPU": -1}', "ALLOCATOR_RAY_RESOURCES/CPU: is -1, must be more than 0"),
    ],
)
def test_a_setting_that_is_none_is_named_with_its_value(invoke, monkeypatch, name, value, says):
    monkeypatch.setenv(name, value)
    refused = invoke("keys", "list")
    assert refused.exit_code == 2
    assert refused.stderr.startswith(says)


def test_settings_that_exclude_each_other_are_named(invoke, monkeypatch):
    monkeypatch.setenv("ALLOCATOR_NO_KEYS", "1")
    monkeypatch.setenv("ALLOCATOR_REQUIRE_KEYS", "1")
    assert invoke("keys", "list").stderr == (
        "ALLOCATOR_NO_KEYS and ALLOCATOR_REQUIRE_KEYS exclude each other\n"
    )


def test_an_option_that_is_none_is_named_as_it_was_given(invoke):
    assert invoke("serve", "--port", "65536").stderr == "--port: is 65536, must be at most 65535\n"


@pytest.mark.parametrize("words", [["serve"], ["keys", "list"], ["keys", "revoke", "x"]])
def test_a_file_that_is_no_database_is_named(invoke, tmp_path, words):
    (tmp_path / "allocator.sqlite3").write_bytes(bytes(range(256)) * 20)
    refused = invoke(*words)
    assert refused.exit_code == 1
    assert refused.stderr.endswith(f"{tmp_path}/allocator.sqlite3: file is not a database\n")
    assert refused.stderr.count("\n") == 1


@pytest.mark.parametrize("what", ["folder", "missing"])
def test_an_overlay_that_cannot_be_read_is_a_sentence(invoke, monkeypatch, tmp_path, what):
    overlay = tmp_path / what
    if what == "folder":
        overlay.mkdir()
    monkeypatch.setenv("ALLOCATOR_OVERLAY_FILE", str(overlay))
    refused = invoke("serve")
    assert refused.exit_code == 1
    assert refused.stderr.startswith(
        f"the service cannot start: ALLOCATOR_OVERLAY_FILE ({overlay}) cannot be"
    )


@pytest.mark.parametrize("output", ["/dev/full", None])
def test_an_output_that_takes_nothing_is_a_sentence(tmp_path, output):
    command = [sys.executable, "-m", "app", "evaluate", str(tmp_path / "request.json")]
    place = {"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [1]}
    area = {"x": 1, "y": 0, "level": 1, "loadlist": [1]}
    (tmp_path / "request.json").write_text(
        json.dumps({"uavs": [place], "targets": [area], "assignment": [[0]]})
    )
    closing = " >&-" if output is None else f" >{output}"
    run = subprocess.run(
        ["/bin/sh", "-c", shlex.join(command) + closing],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 1
    assert run.stderr.startswith("standard output cannot be written: ")
    assert run.stderr.count("\n") == 1
