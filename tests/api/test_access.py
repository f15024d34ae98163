"""API keys: who gets in, with what answer, and that a service others can reach is never open by accident."""

import asyncio
import base64
import hashlib
import re

import httpx
import pytest

from app.api.access import guard
from app.api.access.guard import needed_role
from app.api.access.keys import KeyStore, Role, metadata, recognise
from app.api.application import create_application
from app.api.batch import Batches
from app.api.job_kinds import BATCH
from app.api.metrics import Metrics
from app.api.services import Services
from app.jobs import events
from app.jobs.local import LocalExecutor
from app.jobs.model import JobKind
from app.jobs.service import JobService
from app.jobs.store import JobStore
from app.missions.judge import Judge
from app.missions.service import MissionService
from app.missions.store import MissionStore
from app.settings import Settings
from policy_store.database import Database
from policy_store.library import PolicyLibrary

UNKNOWN = "f" * 12 + "." + "A" * 43


@pytest.fixture
def keys(tmp_path):
    database = Database(f"sqlite:///{tmp_path / 'allocator.sqlite3'}")
    store = KeyStore(database)
    store.migrate()
    yield store
    database.dispose()


class Caller:
    """Calls an application in this process that has its database, and no workers."""

    def __init__(self, settings, database):
        self.app = create_application(settings)
        jobs = JobService(database, [], LocalExecutor(1))
        self.app.state.services = Services(
            settings,
            database,
            PolicyLibrary(database),
            jobs,
            Batches(jobs, BATCH),
            MissionService(MissionStore(database), jobs, Judge(LocalExecutor(1)), {}, {}),
            KeyStore(database),
            Metrics(),
        )

    def request(self, method, path, **options):
        async def call():
            transport = httpx.ASGITransport(self.app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
                return await client.request(method, path, **options)

        return asyncio.run(call())

    def get(self, path, **options):
        return self.request("GET", path, **options)

    def post(self, path, **options):
        return self.request("POST", path, **options)

    def delete(self, path, **options):
        return self.request("DELETE", path, **options)


@pytest.fixture
def start(tmp_path):
    """Makes applications on one data folder."""
    database = Database(f"sqlite:///{tmp_path / 'allocator.sqlite3'}")
    KeyStore(database).migrate()
    PolicyLibrary(database).migrate()
    JobStore(database, "host:1:1:me", 1).migrate()
    yield lambda **settings: Caller(Settings(data_dir=tmp_path, **settings), database)
    database.dispose()


def bearer(token):
    return {"Authorization": f"Bearer {token}"}


def test_the_table_is_what_the_migration_makes(keys, tmp_path):
    database = Database(f"sqlite:///{tmp_path / 'allocator.sqlite3'}")
    with database.read() as connection:
        columns = connection.exec_driver_sql("PRAGMA table_info(api_keys)").all()
    database.dispose()
    assert [row[1] for row in columns] == [column.name for column in metadata.tables["api_keys"].columns]


def test_a_key_is_kept_as_the_digest_of_32_random_bytes(keys, tmp_path):
    key, token = keys.create("ambulance", Role.ALLOCATE)
    _, other = keys.create("ambulance", Role.ALLOCATE)
    key_id, _, secret = token.partition(".")

    assert key_id == key.id
    assert len(base64.urlsafe_b64decode(secret + "=")) == 32
    assert token != other
    assert keys.all()[0] == key
    assert key.digest == hashlib.sha256(secret.encode()).digest()
    for file in tmp_path.iterdir():
        assert secret.encode() not in file.read_bytes()


def test_only_the_whole_key_is_recognised(keys):
    key, token = keys.create("ambulance", Role.ALLOCATE)
    known = {key.id: key}

    assert recognise(token, known) == key
    for wrong in (
        "",
        ".",
        key.id,
        key.id + ".",
        token[:-1],
        token + "A",
        "." + token,
        token.swapcase(),
        UNKNOWN,
    ):
        assert recognise(wrong, known) is None
    assert keys.revoke(key.id)
    assert not keys.revoke(key.id)
    assert recognise(token, {each.id: each for each in keys.all()}) is None


@pytest.mark.parametrize(
    ("method", "path", "role"),
    [
        ("GET", "/healthz", None),
        ("GET", "/readyz", None),
        ("GET", "/", None),
        ("GET", "/dashboard/js/main.js", None),
        ("GET", "/docs", None),
        ("GET", "/docs/assets/swagger-ui.css", None),
        ("GET", "/metrics", Role.ALLOCATE),
        ("POST", "/allocate", Role.ALLOCATE),
        ("DELETE", "/jobs/0", Role.ALLOCATE),
        ("GET", "/library", Role.ALLOCATE),
        ("HEAD", "/library", Role.ALLOCATE),
        ("GET", "/library/x/checkpoint", Role.ALLOCATE),
        ("POST", "/library/similar", Role.ALLOCATE),
        ("POST", "/library", Role.LIBRARY),
        ("POST", "/library/", Role.LIBRARY),
        ("DELETE", "/library/similarly-named", Role.LIBRARY),
        ("PATCH", "/library/x", Role.LIBRARY),
        ("GET", "/a-route-of-tomorrow", Role.ALLOCATE),
    ],
)
def test_what_needs_which_role(method, path, role):
    assert needed_role(method, path) is role


def test_roles_are_held(keys, start):
    _, allocate = keys.create("dispatcher", Role.ALLOCATE)
    _, library = keys.create("trainer", Role.LIBRARY)
    client = start()

    for open_path in ("/healthz", "/docs", "/openapi.json"):
        assert client.get(open_path).status_code == 200
    for headers in ({}, {"Authorization": allocate}, {"Authorization": f"Basic {allocate}"}):
        answer = client.post("/allocate", content=b"not read", headers=headers)
        assert (answer.status_code, answer.json()["type"]) == (401, "/docs/errors#unauthenticated")
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.headers["www-authenticate"] == 'Bearer realm="uav-allocator"'
        assert answer.headers["x-request-id"]
    answer = client.get("/jobs", headers=bearer(UNKNOWN))
    assert answer.status_code == 401
    assert 'error="invalid_token"' in answer.headers["www-authenticate"]

    assert client.get("/jobs", headers=bearer(allocate)).status_code == 200
    assert client.get("/jobs", headers={"Authorization": f"bearer   {library}"}).status_code == 200
    refused = client.delete("/library/nobody", headers=bearer(allocate))
    assert (refused.status_code, refused.json()["type"]) == (403, "/docs/errors#forbidden")
    assert 'scope="library"' in refused.headers["www-authenticate"]
    assert client.delete("/library/nobody", headers=bearer(library)).status_code == 404
    assert client.post("/library", json={}, headers=bearer(library)).status_code == 422


def test_the_first_key_closes_a_running_service_and_revoking_it_does_not_open_it(keys, start, monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("app.api.access.guard.time.monotonic", lambda: now[0])
    client = start()
    assert client.get("/jobs").status_code == 200

    key, token = keys.create("first", Role.ALLOCATE)
    now[0] += 1.1
    assert client.get("/jobs").status_code == 401
    assert client.get("/jobs", headers=bearer(token)).status_code == 200

    keys.revoke(key.id)
    now[0] += 1.1
    assert client.get("/jobs", headers=bearer(token)).status_code == 401
    assert client.get("/jobs").status_code == 401


def test_a_stream_that_goes_on_ends_when_its_key_is_revoked(keys, start, monkeypatch):
    monkeypatch.setattr(guard, "_REMEMBERED_S", 0.0)
    monkeypatch.setattr(events, "_ASK_AGAIN_S", 0.01)
    key, token = keys.create("dispatch", Role.ALLOCATE)
    service = start()
    services = service.app.state.services
    store = JobStore(services.database, "me", 3)
    kind = JobKind("solve", "nowhere:solve", "interactive")
    waits, _ = store.insert(kind, {}, run_now=False, places=1)
    path = f"/jobs/{waits.id}/events"

    async def scenario():
        transport = httpx.ASGITransport(service.app)
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            listening_to = asyncio.create_task(client.get(path, headers=bearer(token)))
            while not services.jobs._events.listeners:
                await asyncio.sleep(0.001)
            assert await asyncio.to_thread(keys.revoke, key.id)
            return await asyncio.wait_for(listening_to, 60)

    answer = asyncio.run(scenario())
    assert (answer.status_code, answer.content) == (200, b"")
    assert service.get(path, headers=bearer(token)).status_code == 401


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "dispatch.example"])
def test_where_others_can_come_a_key_is_needed_before_there_is_one(start, host):
    assert start(host=host).get("/jobs").status_code == 401
    assert start(host=host, no_keys=True).get("/jobs").status_code == 200


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "localhost"])
def test_the_loopback_is_recognised(host):
    assert not Settings(host=host).always_needs_keys


def test_keys_are_in_the_description(start):
    def operation(client, method, path):
        return client.get("/openapi.json").json()["paths"][path][method]

    local, public = start(), start(host="0.0.0.0")
    schemes = public.get("/openapi.json").json()["components"]["securitySchemes"]

    assert schemes["ApiKey"]["scheme"] == "bearer"
    assert operation(public, "post", "/allocate")["security"] == [{"ApiKey": []}]
    assert operation(local, "post", "/allocate")["security"] == [{}, {"ApiKey": []}]
    assert {"401", "403"} <= operation(public, "post", "/library")["responses"].keys()
    assert "401" in operation(public, "get", "/jobs")["responses"]
    assert "security" not in operation(public, "get", "/healthz")


@pytest.mark.parametrize(
    "path", ["/healthz", "/docs", "/docs/assets/swagger-ui.css", "/nothing", "/openapi.json"]
)
def test_every_response_has_security_headers(client, path):
    headers = client.get(path).headers

    assert headers["x-content-type-options"] == "nosniff"
    assert headers["x-frame-options"] == "DENY"
    assert headers["referrer-policy"] == "no-referrer"
    assert "frame-ancestors 'none'" in headers["content-security-policy"]


def test_a_defect_is_answered_with_security_headers(start):
    client = start()
    client.app.state.services = None
    answer = client.get("/jobs")

    assert answer.status_code == 500
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert re.fullmatch("[0-9a-f]{32}", answer.headers["x-request-id"])


def test_the_documentation_page_may_run_its_script_and_no_other(client):
    page = client.get("/docs")
    policy = page.headers["content-security-policy"]
    inline = re.findall(r"<script>(.*?)</script>", page.text, re.DOTALL)
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in inline]

    assert len(inline) == 1
    assert re.search("script-src ([^;]*);", policy)[1].split() == ["'self'", f"'sha256-{hashes[0]}'"]
    assert not re.search(r"\son\w+=", page.text)


def test_pages_of_other_origins_may_call_only_where_that_is_set(client, start):
    asked = {
        "Origin": "https://dispatch.example",
        "Access-Control-Request-Method": "POST",
        "Access-Control-Request-Headers": "authorization,content-type",
    }
    assert "access-control-allow-origin" not in client.get("/healthz", headers=asked).headers
    open_to_one = start(cors_origins="https://dispatch.example, https://other.example", host="0.0.0.0")

    preflight = open_to_one.request("OPTIONS", "/allocate", headers=asked)
    assert preflight.status_code == 200
    assert preflight.headers["access-control-allow-origin"] == "https://dispatch.example"
    refused = open_to_one.post("/allocate", headers={"Origin": "https://dispatch.example"})
    assert refused.status_code == 401
    assert refused.headers["access-control-allow-origin"] == "https://dispatch.example"
    stranger = open_to_one.get("/healthz", headers={"Origin": "https://stranger.example"})
    assert "access-control-allow-origin" not in stranger.headers


def test_origins_come_from_the_environment_with_commas(monkeypatch):
    monkeypatch.setenv("ALLOCATOR_CORS_ORIGINS", "https://a.example,https://b.example")

    assert Settings().cors_origins == ("https://a.example", "https://b.example")


REBOUND = {"Host": "attacker.example"}


def test_while_no_key_is_needed_the_host_has_to_be_one_of_this_machine(start, keys):
    service = start()
    for method, path in (
        ("GET", "/jobs"),
        ("DELETE", "/library/x"),
        ("POST", "/allocate"),
        ("GET", "/metrics"),
    ):
        refused = service.request(method, path, headers=REBOUND)
        assert (refused.status_code, refused.json()["type"]) == (421, "/docs/errors#host-not-allowed")
    for host in ("localhost", "LOCALHOST:8000", "127.0.0.1:80", "[::1]:8000", "192.0.2.7"):
        assert service.get("/jobs", headers={"Host": host}).status_code == 200
    for host in (
        "",
        "127.0.0.1.attacker.example",
        "localhost.attacker.example",
        "127.0.0.1@attacker.example",
    ):
        assert service.get("/jobs", headers={"Host": host}).status_code == 421

    _, token = keys.create("x", Role.ALLOCATE)
    service = start()
    sent = REBOUND | {"Authorization": f"Bearer {token}"}
    assert service.get("/jobs", headers=REBOUND).status_code == 401
    assert service.get("/jobs", headers=sent).status_code == 200
    assert start(allowed_hosts=("plans.example",)).get("/jobs", headers=sent).status_code == 421


def test_names_that_an_operator_allows_are_taken(start):
    service = start(allowed_hosts=("plans.example",))
    assert service.get("/jobs", headers={"Host": "plans.example:443"}).status_code == 200
    assert service.get("/healthz", headers=REBOUND).status_code == 421
    assert start(allowed_hosts=("*",)).get("/jobs", headers=REBOUND).status_code == 200
    assert start(host="0.0.0.0", no_keys=True).get("/jobs", headers=REBOUND).status_code == 421


def test_a_service_behind_a_proxy_can_need_keys_from_the_first_request(start):
    assert start(require_keys=True).get("/jobs").status_code == 401
    with pytest.raises(ValueError, match="exclude each other"):
        Settings(require_keys=True, no_keys=True)


def test_the_guard_judges_by_the_path_below_the_root_path(start, keys):
    _, token = keys.create("x", Role.ALLOCATE)
    service = start()

    async def call(method, path):
        transport = httpx.ASGITransport(service.app, root_path="/uav")
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.request(method, path, headers={"Authorization": f"Bearer {token}"})

    assert asyncio.run(call("DELETE", "/uav/library/x")).status_code == 403
    assert asyncio.run(call("GET", "/uav/jobs")).status_code == 200
    assert asyncio.run(call("GET", "/uav/healthz")).status_code == 200


def test_only_asking_for_similar_tasks_is_reading():
    assert needed_role("POST", "/library/similar") is Role.ALLOCATE
    for method in ("DELETE", "PUT", "PATCH"):
        assert needed_role(method, "/library/similar") is Role.LIBRARY


@pytest.mark.parametrize("path", ["/dashboard", "/docs/assets", "/jobs/"])
def test_a_place_is_named_by_its_path_and_not_by_the_header_host(start, path):
    answer = start(allowed_hosts=("*",)).get(path, headers=REBOUND)
    assert answer.status_code == 307
    assert answer.headers["location"].startswith("/")
    assert "attacker" not in answer.headers["location"]
