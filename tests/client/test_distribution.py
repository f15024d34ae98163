"""The client as a distribution of its own: installed without the service, typed, and run by the examples."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import app
import app.client

ROOT = Path(__file__).parents[2]
CLIENT = ROOT / "app/client"
EXAMPLES = sorted((CLIENT / "examples").glob("*.py"))
RUN_S = 150


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder where the client is installed, from a copy, so that nothing is built in the repository."""
    folder = tmp_path_factory.mktemp("client")
    shutil.copytree(CLIENT, folder / "source", ignore=shutil.ignore_patterns("__pycache__"))
    arguments = ["--no-deps", "--no-build-isolation", "--no-index", "--target", str(folder / "installed")]
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", *arguments, str(folder / "source")],
        check=True,
        timeout=RUN_S,
    )
    return folder / "installed"


def run(installed, cwd, *arguments):
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=RUN_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def test_it_needs_nothing_of_the_service(installed, tmp_path):
    program = (
        "import sys, uav_allocator_client as client; client.Client('http://127.0.0.1:1').close();"
        "print(sorted({name.partition('.')[0] for name in sys.modules} - set(sys.stdlib_module_names)))"
    )
    loaded = set(eval(run(installed, tmp_path, "-c", program)))
    assert "httpx" in loaded
    assert not loaded & {"app", "policy_store", "fastapi", "starlette", "pydantic", "numpy", "torch", "numba"}


def test_it_has_the_version_of_the_service(installed):
    assert app.client.__version__ == app.__version__
    (metadata,) = installed.glob("uav_allocator_client-*.dist-info/METADATA")
    text = metadata.read_text("utf-8")
    assert f"\nVersion: {app.__version__}\n" in text
    assert [line for line in text.splitlines() if line.startswith("Requires-Dist")] == [
        "Requires-Dist: httpx<1,>=0.27"
    ]
    assert (installed / "uav_allocator_client/py.typed").is_file()
    assert not (installed / "uav_allocator_client/examples").exists()


def test_the_examples_keep_to_its_types(installed, tmp_path):
    names = [str(example) for example in EXAMPLES]
    command = ["--strict", "--cache-dir", str(tmp_path / "cache"), "--config-file", os.devnull]
    environment = {**os.environ, "MYPYPATH": str(installed)}
    for name in names:
        done = subprocess.run(
            [sys.executable, "-m", "mypy", *command, name],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=RUN_S,
            check=False,
        )
        assert done.returncode == 0, done.stdout


def test_cyclone_with_one_port(installed, service, tmp_path):
    script, folder = CLIENT / "examples/cyclone_one_port.py", tmp_path / "plans"
    said = run(installed, tmp_path, str(script), service.url, str(folder), service.key)
    assert "long-1: site-" in said
    assert {file.suffix for file in folder.iterdir()} == {".csv", ".geojson", ".html", ".zip"}


def test_medical_network(installed, service, tmp_path):
    said = run(installed, tmp_path, str(CLIENT / "examples/medical_network.py"), service.url, service.key)
    assert "plan 2 is in force" in said
    assert "3.50 h: clock" in said
    assert "0.60 h: uav_lost" in said


def test_comparison(installed, service, tmp_path):
    said = run(installed, tmp_path, str(CLIENT / "examples/comparison.py"), service.url, service.key)
    rows = {tuple(line.split()[:2]): list(map(float, line.split()[2:])) for line in said.splitlines()[1:]}
    assert len(rows) == 8
    for (problem, _), (mean, worst, best) in rows.items():
        assert worst <= mean <= best
        assert mean >= rows[problem, "greedy"][0] - 1e-3


def test_the_page_shows_what_works(installed, service, tmp_path):
    page = (CLIENT / "README.md").read_text("utf-8")
    (shown,) = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    there = shown.replace("http://127.0.0.1:8000", service.url).replace("key=None", f"key={service.key!r}")
    assert "'long-1'" in run(installed, tmp_path, "-c", there)


def test_every_example_is_run():
    ran = Path(__file__).read_text("utf-8")
    assert all(f'examples/{example.name}"' in ran for example in EXAMPLES)
