"""A service that asks for keys and names a tile server: what the page asks, shows and keeps to itself."""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import httpx
import pytest
from dashboard_steps import PATIENCE_MS
from live_service import SMALL, LiveService
from playwright.sync_api import expect

from app.api.access.keys import KeyStore, Role
from policy_store.database import Database

PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c6360f8cfc0000003010100"
    "c9fe92ef0000000049454e44ae426082"
)
WRONG = "f" * 12 + "." + "A" * 43


class Tiles(BaseHTTPRequestHandler):
    """Every tile is one pixel; which were asked for is kept."""

    asked: list[tuple[str, dict]]

    def do_GET(self):
        self.server.asked.append((self.path, dict(self.headers)))
        self.send_response(200)
        self.send_header("Content-Type", "image/png")
        self.end_headers()
        self.wfile.write(PIXEL)

    def log_message(self, *_):
        """Nothing to say."""


@pytest.fixture(scope="module")
def tiles():
    server = ThreadingHTTPServer(("127.0.0.1", 0), Tiles)
    server.asked = []
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="module")
def guarded(tmp_path_factory, tiles):
    """A service with a key of the role `allocate`, and with a tile server."""
    folder = tmp_path_factory.mktemp("guarded")
    service = LiveService(
        folder,
        workers=1,
        **SMALL,
        tile_url=f"http://127.0.0.1:{tiles.server_port}/{{z}}/{{x}}/{{y}}.png",
        tile_attribution="<b>Tiles</b> & co",
    )
    database = Database(f"sqlite:///{service.database}")
    keys = KeyStore(database)
    keys.migrate()
    key, service.token = keys.create("test", Role.ALLOCATE)
    service.key_id = key.id
    database.dispose()
    try:
        yield service.start().await_ready()
    finally:
        service.stop()


@pytest.fixture
def visit(browser, guarded):
    """Opens the dashboard of that service; keeps the addresses it asks for, and what its console says."""
    contexts = []

    def opened():
        context = browser.new_context(viewport={"width": 1366, "height": 900})
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        page = context.new_page()
        page.said, page.asked = [], []
        page.on("console", lambda said: page.said.append(said.text))
        page.on("pageerror", lambda error: page.said.append(str(error)))
        page.on("request", lambda request: page.asked.append(request.url))
        page.goto(guarded.url)
        return page

    yield opened
    for context in contexts:
        context.close()


def give(page, key):
    page.fill("#key-input", key)
    page.press("#key-input", "Enter")


def test_a_key_is_asked_for_kept_in_the_tab_and_told_to_nobody(visit, guarded):
    page = visit()
    expect(page.locator("#key-dialog")).to_be_visible()
    expect(page.locator("#key-why")).to_be_hidden()
    give(page, WRONG)
    expect(page.locator("#key-why")).to_have_text("This API key is unknown, or was revoked.")
    give(page, guarded.token)
    expect(page.locator("#key-dialog")).to_be_hidden()
    page.wait_for_selector("html[data-ready]")
    expect(page.locator("[data-example=paper-5x10]")).to_be_visible()

    page.reload()
    page.wait_for_selector("html[data-ready]")
    expect(page.locator("[data-example=paper-5x10]")).to_be_visible()
    stored = page.evaluate("[{ ...sessionStorage }, Object.values(localStorage), document.cookie]")
    assert [name for name, value in stored[0].items() if guarded.token in value] == ["allocator-key"]
    assert stored[1:] == [[], ""]
    kept = page.evaluate(
        """async () => {
            const { keptProblem, keptProblems } = await import("/dashboard/js/keep.js");
            const all = await keptProblems();
            return JSON.stringify([all, ...(await Promise.all(all.map(({ id }) => keptProblem(id))))]);
        }"""
    )
    assert "cyclone-idai" in kept
    assert guarded.token not in kept
    for secret in (guarded.token, WRONG):
        assert not [url for url in page.asked if secret in url]
        assert not [text for text in page.said if secret in text]
        assert secret not in page.content()
        assert secret not in guarded.log.read_text()
    other = visit()
    expect(other.locator("#key-dialog")).to_be_visible()


def test_without_a_key_the_page_works_as_far_as_it_can_and_goes_on_with_one(visit, guarded):
    page = visit()
    page.click("#key-cancel")
    page.wait_for_selector("html[data-ready]")
    expect(page.locator("#alerts .notice")).to_contain_text("this service needs an API key")
    page.click("#tab-allocate")
    expect(page.locator("#view-allocate")).to_contain_text("has not said yet")

    page.click("#key")
    give(page, guarded.token)
    expect(page.locator("#problem-title")).to_contain_text("cyclone-idai")
    page.click("#advanced > summary")
    page.select_option("select[name=algorithm]", "greedy")
    page.click("#start")
    page.wait_for_selector("#figures")

    page.click("#key")
    page.click("#key-forget")
    assert page.evaluate("Object.keys(sessionStorage)") == ["dispatch-mission"]


def test_a_key_of_the_wrong_role_is_told_which_it_needs(visit, guarded):
    page = visit()
    give(page, guarded.token)
    page.wait_for_selector("html[data-ready]")
    page.click("#tab-library")
    page.locator("article.policy").first.wait_for()
    page.click("#view-library button:has-text('Train')")

    expect(page.locator("#alerts .notice")).to_contain_text(
        f"this needs a key of the role library, key {guarded.key_id} has the role allocate"
    )


def test_a_plan_is_printed_with_a_key_too(visit, guarded):
    page = visit()
    give(page, guarded.token)
    page.wait_for_selector("html[data-ready]")
    page.click("#tab-allocate")
    page.click("#advanced > summary")
    page.select_option("select[name=algorithm]", "greedy")
    page.click("#start")
    page.wait_for_selector("#figures")
    page.click("#tab-take-away")
    expect(page.get_by_test_id("print")).to_be_hidden()
    with page.expect_download() as saved:
        page.click("[data-format=html]")
    assert "<svg" in saved.value.path().read_text(encoding="utf-8")


def test_the_map_asks_the_named_tile_server_and_the_policy_allows_only_it(visit, guarded, tiles):
    origin = f"http://127.0.0.1:{tiles.server_port}"
    policy = httpx.get(guarded.url).headers["content-security-policy"]
    assert f"img-src 'self' data: blob: {origin};" in policy
    assert policy.count("http") == 1

    page = visit()
    give(page, guarded.token)
    page.wait_for_selector("html[data-ready]")
    page.wait_for_selector("img.leaflet-tile-loaded")
    expect(page.locator(".leaflet-control-attribution")).to_contain_text("<b>Tiles</b> & co")
    elsewhere = {url for url in page.asked if not url.startswith((guarded.url, "data:", "blob:"))}
    assert elsewhere
    assert all(url.startswith(origin) for url in elsewhere)
    for _, headers in tiles.asked:
        assert not {name.lower() for name in headers} & {"authorization", "cookie", "referer"}

    blocked = page.evaluate(
        "(url) => new Promise((resolve) => { const image = new Image();"
        " document.addEventListener('securitypolicyviolation', (event) => resolve(event.violatedDirective));"
        " image.onload = () => resolve('loaded'); image.src = url; })",
        f"http://localhost:{tiles.server_port}/0/0/0.png",
    )
    assert blocked == "img-src"


def test_a_job_is_followed_over_a_restart_of_the_service(visit, guarded):
    page = visit()
    give(page, guarded.token)
    page.wait_for_selector("html[data-ready]")
    page.click("#tab-allocate")
    page.click("#advanced > summary")
    page.select_option("select[name=algorithm]", "ga")
    page.fill("input[name=time_limit_s]", "")
    page.locator("#parameters").evaluate("details => { details.open = true; }")
    page.fill("#parameters input[name=iteration]", "1000000")
    page.click("#start")
    expect(page.locator("#job-status")).to_have_text("running")
    page.wait_for_selector("path.route")
    guarded.kill_all()
    expect(page.locator("#job-status")).to_have_text("reconnecting")
    guarded.start().await_ready()
    expect(page.locator("#job-status")).to_have_text("running")
    page.click("#cancel")
    page.wait_for_selector("#figures")
    assert not [text for text in page.said if "Uncaught" in text]
