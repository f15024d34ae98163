"""The command line: keys, what is served to whom, and what is logged of it."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import tomllib
import zipfile
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest
from live_service import ONE_WORKER
from sqlalchemy import text
from typer.testing import CliRunner

from app.api.access.keys import KeyStore, Role, recognise
from app.api.server import Server
from app.cli import application
from app.settings import Settings
from policy_store.database import Database

ROOT = Path(__file__).parents[1]
START_S = 120.0


@pytest.fixture
def invoke(tmp_path):
    return lambda *arguments: CliRunner().invoke(
        application, arguments if "--data-dir" in arguments else [*arguments, "--data-dir", str(tmp_path)]
    )


@pytest.fixture
def known(tmp_path):
    """Reads the keys by id."""

    def read():
        database = Database(f"sqlite:///{tmp_path / 'allocator.sqlite3'}")
        try:
            return {key.id: key for key in KeyStore(database).all()}
        finally:
            database.dispose()

    return read


def test_the_command_that_is_installed_is_the_same_command_line():
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    assert list(scripts) == ["uav-allocator"]
    installed = EntryPoint("uav-allocator", scripts["uav-allocator"], "console_scripts").load()
    shown = CliRunner().invoke(installed, ["serve", "--help"])
    assert shown.exit_code == 0
    assert "Start the service" in shown.stdout


def test_experiments_that_are_not_done_go_on_with_the_same_command(tmp_path):
    words = ["reproduce", "--quick", "--cells", "2x5", "--out", str(tmp_path), "--for-minutes", "0"]
    begun = CliRunner().invoke(application, words)
    assert begun.exit_code == 3
    assert "the same command goes on" in begun.stderr
    assert not (tmp_path / "tables").exists()
    refused = CliRunner().invoke(application, [*words, "--cells", "9x9"])
    assert refused.exit_code == 1
    assert "'9x9' is no size of the grid" in refused.stderr


def test_a_service_that_cannot_start_says_why_in_a_sentence(invoke, tmp_path):
    occupied = Database(f"sqlite:///{tmp_path / 'allocator.sqlite3'}")
    occupied.occupy()
    refused = invoke("serve")
    occupied.vacate()
    assert (refused.exit_code, refused.stdout) == (1, "")
    assert refused.stderr.startswith("the service cannot start: another service (process ")

    with occupied.write() as connection:
        connection.exec_driver_sql("CREATE TABLE alembic_version_jobs (version_num TEXT)")
        connection.exec_driver_sql("INSERT INTO alembic_version_jobs VALUES ('9999')")
    occupied.dispose()
    refused = invoke("serve")
    assert refused.exit_code == 1
    assert "newer version of this program" in refused.stderr
    assert refused.stderr.count("\n") == 1

    (tmp_path / "file").touch()
    refused = invoke("serve", "--data-dir", str(tmp_path / "file" / "folder"))
    assert refused.exit_code == 1
    assert "cannot be written" in refused.stderr


def test_a_key_is_made_shown_once_listed_and_revoked(invoke, known):
    made = invoke("keys", "create", "--role", "library", "--name", "trainer\u00e9")
    token = made.stdout.strip()
    key = recognise(token, known())
    assert key is not None
    assert (key.role, key.name) == (Role.LIBRARY, "trainer\u00e9")

    listed = invoke("keys", "list").stdout
    assert listed.split("\t")[:2] == [key.id, "library"]
    assert "in use" in listed
    assert token.partition(".")[2] not in listed + made.stderr

    assert invoke("keys", "revoke", key.id).exit_code == 0
    assert recognise(token, known()) is None
    assert "revoked" in invoke("keys", "list").stdout
    again = invoke("keys", "revoke", key.id)
    assert again.exit_code == 1
    assert key.id in again.stderr


def test_a_role_that_is_none_is_refused(invoke):
    refused = invoke("keys", "create", "--role", "admin", "--name", "x")

    assert refused.exit_code == 2
    assert invoke("keys", "list").stdout == ""


@pytest.mark.parametrize("revoked", [False, True])
def test_others_are_not_served_without_a_usable_key(invoke, revoked):
    if revoked:
        token = invoke("keys", "create", "--role", "allocate", "--name", "x").stdout
        invoke("keys", "revoke", token.partition(".")[0])
    refused = invoke("serve", "--host", "0.0.0.0", "--port", "0")

    assert refused.exit_code == 2
    assert "0.0.0.0" in refused.stderr
    assert "--no-keys" in refused.stderr


@contextlib.contextmanager
def serving(folder, **environment):
    """Start ``python -m app serve`` on a free port, its log in a file, and wait until it answers."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    log = folder / f"log-{port}"
    command = [sys.executable, "-m", "app", "serve", "--port", str(port), "--data-dir", str(folder)]
    with log.open("wb") as stderr:
        process = subprocess.Popen(
            command, stderr=stderr, cwd=ROOT, env=os.environ | ONE_WORKER | environment
        )
    with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=START_S) as client:
        deadline = time.monotonic() + START_S
        while True:
            with contextlib.suppress(httpx.TransportError):
                client.get("/healthz")
                break
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < deadline
            threading.Event().wait(0.05)
        try:
            yield client, process, log
        finally:
            process.kill()
            process.wait()


PROBLEM = json.loads((ROOT / "app/examples/paper-5x10.json").read_text("utf-8"))
GREEDY = {**PROBLEM, "algorithm": "greedy"}


@pytest.fixture(scope="module")
def life(tmp_path_factory):
    """A service with keys: what it was asked, a backup between two answers, its log when it has ended."""
    folder = tmp_path_factory.mktemp("life")
    copy = folder / "elsewhere" / "backup.sqlite3"
    copy.parent.mkdir()

    def invoke(*arguments):
        return CliRunner().invoke(application, [*arguments, "--data-dir", str(folder)])

    tokens = [
        invoke("keys", "create", "--role", role, "--name", "x").stdout.strip()
        for role in ("allocate", "library")
    ]
    with serving(folder, ALLOCATOR_LOG_LEVEL="debug") as (client, process, log):
        sent = {"Authorization": f"Bearer {tokens[0]}"}

        def ask(method, path, **options):
            return client.request(method, path, **options).headers["x-request-id"]

        asked = client.post("/allocate", json=GREEDY, headers=sent)
        ids = [
            asked.headers["x-request-id"],
            ask("GET", "/jobs", headers=sent),
            ask("DELETE", "/library/x", headers=sent),
            ask("GET", "/jobs", headers={"Authorization": f"Basic {tokens[1]}"}),
            ask("GET", "/jobs", params={"key": tokens[1], "cursor": tokens[0]}, headers=sent),
            ask("POST", "/allocate", json={"key": tokens[1]}, headers=sent),
            ask("GET", "/a%0Ab%1B[31m"),
        ]
        policies = client.get("/library", headers=sent).json()["policies"]
        backups = [invoke("backup", str(copy))]
        after = client.post("/allocate", json=GREEDY, headers=sent).json()
        backups.append(invoke("backup", str(copy)))
        process.send_signal(signal.SIGTERM)
        process.wait(START_S)
        text = log.read_text("utf-8")
    return SimpleNamespace(
        tokens=tokens, sent=sent, asked=asked, ids=ids, policies=policies, backups=backups, after=after,
        copy=copy, text=text,
    )  # fmt: skip


def test_the_log_tells_of_requests_and_jobs_and_never_of_keys(life):
    assert life.asked.status_code == 200, life.asked.text
    for token in life.tokens:
        assert token.partition(".")[2] not in life.text
    lines = [json.loads(line) for line in life.text.splitlines()]
    for line in lines:
        assert {"time", "level", "logger", "event"} <= line.keys()
    requests = {line["request_id"]: line for line in lines if line["event"] == "request"}
    assert [requests[given]["status"] for given in life.ids] == [200, 200, 403, 401, 422, 422, 401]
    assert requests[life.ids[-1]]["path"] == "/a\nb\x1b[31m"
    assert requests[life.ids[0]]["duration_ms"] > 0
    job_id = life.asked.json()["job_id"]
    told = [line["event"] for line in lines if line.get("job_id") == job_id]
    assert told == ["job taken in", "job ended"]
    assert life.ids[0] in {line.get("request_id") for line in lines if line.get("job_id") == job_id}


def test_a_backup_of_a_running_service_is_restored(life, tmp_path):
    made, again = life.backups
    assert made.exit_code == 0, made.stderr
    assert again.exit_code == 1
    before, policies = life.asked.json(), life.policies
    life.copy.rename(tmp_path / "allocator.sqlite3")
    with serving(tmp_path) as (restored, _, _):
        restored.headers.update(life.sent)
        assert restored.get(f"/jobs/{before['job_id']}").json()["result"] == before
        assert restored.get(f"/jobs/{life.after['job_id']}").status_code == 404
        assert restored.get("/library").json()["policies"] == policies
        for policy in policies[:3]:
            assert restored.get(f"/library/{policy['id']}/checkpoint").status_code == 200
        assert restored.post("/allocate", json=GREEDY).status_code == 200


def test_a_backup_of_nothing_is_refused_and_makes_nothing(invoke, tmp_path):
    refused = invoke("backup", str(tmp_path / "copy"))

    assert refused.exit_code == 1
    assert "allocator.sqlite3" in refused.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("proxies", "believed"), [("", []), ("192.0.2.1, 192.0.2.2", ["192.0.2.1", "192.0.2.2"])]
)
def test_only_a_proxy_that_was_named_says_who_the_client_is(tmp_path, monkeypatch, proxies, believed):
    monkeypatch.setenv("ALLOCATOR_TRUSTED_PROXIES", proxies)
    config = Server(Settings(data_dir=tmp_path)).config
    assert config.proxy_headers is bool(believed)
    assert config.forwarded_allow_ips == believed


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("[]", "the request: is a list, needs an object"),
        ("null", "the request: is null, needs an object"),
        ("7", "the request: is 7, needs an object"),
        ('"x"', "the request: is a text, needs an object"),
        ("", "Expecting value: line 1 column 1"),
        ("{uavs: 1}", "line 1 column 2"),
        ("[" * 100_000, "nested"),
        ('{"seed": 1, "seed": 2}', "'seed' is twice in one object"),
        ("{}", "/uavs: is missing"),
        ('{"uavs": [{"priority": 1}], "targets": [{}]}', "/uavs/0/priority: unknown field `priority`"),
        ("\u00ff".encode("latin-1"), "byte 0 is not UTF-8"),
        ("{" + ",".join(f'"f{number}": 1' for number in range(800)) + "}", "800 names"),
    ],
    ids=lambda each: str(each)[:20],
)
def test_a_request_that_is_none_is_refused_in_a_sentence(tmp_path, body, says):
    file = tmp_path / "request.json"
    file.write_bytes(body if isinstance(body, bytes) else body.encode())
    refused = CliRunner().invoke(application, ["allocate", str(file), "--data-dir", str(tmp_path)])
    assert refused.exit_code == 1
    assert says in refused.stderr
    assert isinstance(refused.exception, SystemExit)


def test_a_plan_is_evaluated_without_a_server(tmp_path):
    problem = json.loads((ROOT / "app/examples/paper-5x10.json").read_text())
    file, home = tmp_path / "request.json", len(problem["targets"])
    kept = {name: problem[name] for name in ("uavs", "targets", "objective") if name in problem}
    file.write_text(json.dumps({**kept, "assignment": [[home] * len(problem["uavs"])]}))
    told = CliRunner().invoke(application, ["evaluate", str(file), "--at", "0.5"])
    assert told.exit_code == 0
    answer = json.loads(told.stdout)
    assert (answer["satisfaction"], answer["distance"]) == (0.0, 0.0)
    assert answer["remaining"]["uavs"][0]["available_from"] == 0.5
    file.write_text(json.dumps({**kept, "assignment": [[0]]}))
    refused = CliRunner().invoke(application, ["evaluate", str(file)])
    assert refused.exit_code == 1
    assert "1 actions, but there are 5 UAVs" in refused.stderr


def test_flight_files_are_evaluated_without_a_server(tmp_path):
    place = {"x_s": 34, "y_s": -19, "speed": 60, "voyage": 300, "loadlist": [2]}
    near = {"x": 34.1, "y": -19, "level": 1, "loadlist": [2]}
    paid = {"distance_weight": 0.001}
    request = {"crs": "wgs84", "uavs": [place, place], "targets": [near], "objective": paid}
    file, flights = tmp_path / "request.json", tmp_path / "flights.zip"
    file.write_text(json.dumps(request))
    columns = [(0, 1, 0, 16, -19.0, 34.0), (1, 0, 3, 22, -19.0, 34.0), (2, 0, 3, 16, -19.0, 34.1)]
    lines = ["\t".join(map(str, (*each[:4], 0, 0, 0, 0, *each[4:], 50, 1))) for each in columns]
    with zipfile.ZipFile(flights, "w") as archive:
        archive.writestr("002-uav-2.waypoints", "QGC WPL 110\n" + "\n".join(lines) + "\n")
    told = CliRunner().invoke(application, ["evaluate", str(file), "--flights", str(flights)])
    assert told.exit_code == 0, told.stderr
    assert json.loads(told.stdout)["assignment"] == [[1, 0]]
    named = tmp_path / "mine.waypoints"
    named.write_text("QGC WPL 110\n")
    refused = CliRunner().invoke(application, ["evaluate", str(file), "--flights", str(named)])
    assert refused.exit_code == 1
    assert "mine.waypoints: its name does not begin with the UAV's number" in refused.stderr


@pytest.mark.parametrize("given", ["[1]", "7", "{", "null"])
def test_parameters_that_are_none_are_refused_in_a_sentence(tmp_path, given):
    problem = str(ROOT / "app/examples/paper-5x10.json")
    words = ["allocate", problem, "--data-dir", str(tmp_path), "--parameters", given]
    refused = CliRunner().invoke(application, words)
    assert refused.exit_code == 1
    assert isinstance(refused.exception, SystemExit)
    assert refused.stderr.strip()


@pytest.mark.parametrize("name", ["a\tb", "a\nb", "\x1b[31m", "\u2028", "", "x" * 257])
def test_names_of_keys_keep_to_their_line(invoke, name):
    refused = invoke("keys", "create", "--role", "allocate", "--name", name)
    assert refused.exit_code == 1
    assert "name" in refused.stderr
    assert invoke("keys", "list").stdout == ""


def test_a_name_that_an_earlier_version_let_in_breaks_no_list(invoke, tmp_path):
    assert invoke("keys", "create", "--role", "allocate", "--name", "x").exit_code == 0
    database = Database(f"sqlite:///{tmp_path / 'allocator.sqlite3'}")
    with database.write() as connection:
        connection.execute(text("UPDATE api_keys SET name = 'a' || char(9) || 'b' || char(10)"))
    database.dispose()
    listed = invoke("keys", "list").stdout
    assert listed.count("\n") == 1
    assert listed.count("\t") == 4


def test_a_variable_that_is_no_setting_is_told_of(invoke, monkeypatch):
    monkeypatch.setenv("ALLOCATOR_WORKRES", "3")
    told = invoke("keys", "list")
    assert told.exit_code == 0
    assert "ALLOCATOR_WORKRES is no setting, and is ignored; did you mean ALLOCATOR_WORKERS?" in told.stderr
