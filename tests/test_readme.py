"""Every command in README.md and the manuals, run as it stands against the service that `make run` starts.

Only the port is another one, so that a service on the default port is not in the way, and it has one worker
and small limits, with which it is ready sooner. `make run` is the fixture. Blocks of `console` are not run:
they take long, or need a container engine or another machine.
"""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from live_service import ONE_WORKER
from referee import replay

ROOT = Path(__file__).parents[1]
PAGES = (
    "README.md",
    "app/domain/README.md",
    "app/solvers/README.md",
    "app/solvers/markets/README.md",
    "app/api/README.md",
    "app/api/plan_formats/README.md",
    "app/library/README.md",
    "app/missions/README.md",
)
START_S = 300.0
COMMAND_S = 120.0


def blocks(page, language):
    """The blocks of a page that are in a language, without the command that is the fixture."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = re.findall(r"^```(\w+)\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)
    return [block for name, block in found if name == language and block.strip() != "make run"]


def blocks_of_pages(language):
    """A parameter for each block, with its page and its place among those of the page."""
    return [
        pytest.param(block, id=f"{page}-{number}")
        for page in PAGES
        for number, block in enumerate(blocks(page, language))
    ]


@pytest.fixture(scope="module")
def port(tmp_path_factory):
    """The port of a service started as the README says."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        free = probe.getsockname()[1]
    environment = os.environ | ONE_WORKER | {"ALLOCATOR_DATA_DIR": str(tmp_path_factory.mktemp("data"))}
    with subprocess.Popen(
        ["make", "run", f"PORT={free}"], cwd=ROOT, env=environment, start_new_session=True
    ) as process:
        wait_until_ready(process, f"http://127.0.0.1:{free}/readyz")
        yield free
        os.killpg(process.pid, signal.SIGTERM)


def wait_until_ready(process, url):
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline:
        try:
            with urllib.request.urlopen(url, timeout=5):
                return
        except (urllib.error.URLError, TimeoutError, ConnectionError):
            with contextlib.suppress(subprocess.TimeoutExpired):
                pytest.fail(f"make run has ended with {process.wait(0.2)}")
    pytest.fail(f"not ready after {START_S} s")


def run(command, port):
    """Run a block with the service's port in it, and return what it prints."""
    finished = subprocess.run(
        command,
        cwd=ROOT,
        input=None,
        capture_output=True,
        text=True,
        timeout=COMMAND_S,
        check=False,
    )
    assert finished.returncode == 0, f"{command}\n{finished.stdout}\n{finished.stderr}"
    return finished.stdout


def test_there_is_something_to_run():
    assert "```sh\nmake run\n```" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(blocks("README.md", "sh")) >= 2
    assert blocks("README.md", "python")
    assert blocks("README.md", "json")
    for page in PAGES:
        assert blocks(page, "sh"), page


@pytest.mark.parametrize("block", blocks_of_pages("sh"))
def test_shell_block(block, port):
    output = run(["bash", "-ec", block.replace(":8000", f":{port}")], port)
    assert '"title"' not in output, f"{block}\n{output}"


@pytest.mark.parametrize("block", blocks_of_pages("python"))
def test_python_block(block, port):
    assert "reward" in run([ROOT / ".venv/bin/python", "-c", block.replace(":8000", f":{port}")], port)


@pytest.mark.parametrize("algorithm", ["ga", "qmix", "transfer_qmix"])
def test_the_example_is_answered_by_the_papers_algorithms(algorithm, port):
    problem = json.loads((ROOT / "app/examples/cyclone-idai.json").read_text(encoding="utf-8"))
    request = {**problem, "algorithm": algorithm, "time_limit_s": 2}
    call = urllib.request.Request(
        f"http://127.0.0.1:{port}/allocate",
        json.dumps(request).encode(),
        {"Content-Type": "application/json"},
    )
    with urllib.request.urlopen(call, timeout=COMMAND_S) as response:
        answer = json.load(response)
    assert replay(problem, answer["assignment"])["reward"] == pytest.approx(answer["reward"], abs=1e-6)


def test_the_answer_that_is_shown_is_a_true_one():
    problem = json.loads((ROOT / "app/examples/cyclone-idai.json").read_text(encoding="utf-8"))
    shown = json.loads(re.sub(r",?\s*…", "", blocks("README.md", "json")[0]))
    expected = replay(problem, shown["assignment"])
    assert shown["reward"] == pytest.approx(expected["reward"], abs=1e-6)
    assert shown["satisfaction"] == pytest.approx(expected["satisfaction"], abs=1e-6)
    assert shown["distance"] == pytest.approx(expected["distance"], abs=1e-4)
