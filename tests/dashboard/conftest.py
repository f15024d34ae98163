"""A browser on the dashboard of a real service, which has a folder and a port of its own."""

import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from dashboard_steps import ADVANCED, PATIENCE_MS
from live_service import LiveService
from page_files import read_files
from playwright.sync_api import Browser, Page, expect, sync_playwright

from app.api.application import create_application
from app.settings import Settings

CHROMIUM = (
    os.environ.get("CHROMIUM")
    or shutil.which("chromium-headless-shell")
    or shutil.which("chromium")
    or "/usr/bin/chromium"
)
"""The shell is the same browser without windows, and opens a page in half of the time."""

ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--no-first-run",
    "--disable-component-update",
    "--disable-sync",
)
HOW_TO_GET_ONE = (
    f"no Chromium at {CHROMIUM}: 'apt-get install chromium-headless-shell', or its path in the variable "
    "CHROMIUM (REQUIRE_BROWSER=1 makes this a failure)"
)

HERE = Path(__file__).parent
_running = ExitStack()
"""What has to end with the last test of this folder."""

expect.set_options(timeout=PATIENCE_MS)


def pytest_collection_modifyitems(items):
    if Path(CHROMIUM).exists() or os.environ.get("REQUIRE_BROWSER") == "1":
        return
    for item in items:
        if HERE in item.path.parents and "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.skip(reason=HOW_TO_GET_ONE))


@contextmanager
def browsing() -> Iterator[Browser]:
    """Start Debian's Chromium, with nothing of it that calls home."""
    if not Path(CHROMIUM).exists():
        raise FileNotFoundError(HOW_TO_GET_ONE)
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        try:
            yield started
        finally:
            started.close()


@pytest.fixture(scope="session")
def service(tmp_path_factory) -> Iterator[LiveService]:
    """One with limits as low as these tests allow: a worker tries the largest problem before it is ready."""
    limits = {"max_uavs": 220, "max_targets": 300}
    running = LiveService(tmp_path_factory.mktemp("dashboard"), workers=1, **limits).start()
    try:
        yield running.await_ready()
    finally:
        running.stop()


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    yield _running.enter_context(browsing())
    _running.close()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item, nextitem):
    """End the browser after the last test of this folder.

    Playwright keeps an event loop running in the main thread, where tests of other folders that come next in
    the same process run loops of their own.
    """
    if nextitem is None or HERE not in nextitem.path.parents:
        _running.close()


@contextmanager
def _dashboard(browser: Browser, url: str) -> Iterator[Page]:
    """Open the dashboard; at the end nothing may have gone wrong in it, and nothing left the machine."""
    context = browser.new_context(viewport={"width": 1366, "height": 900}, accept_downloads=True)
    context.set_default_timeout(PATIENCE_MS)
    context.add_init_script(ADVANCED)
    opened = context.new_page()
    troubles = []
    opened.on("console", lambda said: troubles.append(said.text) if said.type == "error" else None)
    opened.on("pageerror", lambda error: troubles.append(str(error)))
    asked = []
    opened.on("request", lambda request: asked.append(request.url))
    opened.expected_troubles = []
    opened.goto(url)
    yield opened
    context.close()
    unexpected = [text for text in troubles if not any(known in text for known in opened.expected_troubles)]
    assert unexpected == []
    elsewhere = [asked_for for asked_for in asked if not asked_for.startswith((url, "data:", "blob:"))]
    assert elsewhere == []


@pytest.fixture
def page(browser, service) -> Iterator[Page]:
    """The dashboard, opened for one test."""
    with _dashboard(browser, service.url) as opened:
        yield opened


@pytest.fixture(scope="module")
def shared_page(browser, service) -> Iterator[Page]:
    """The dashboard, opened for all tests of a module that only look, or begin by replacing what is there.

    A page takes two seconds of a core to open.
    """
    with _dashboard(browser, service.url) as opened:
        yield opened


@pytest.fixture(scope="session")
def openapi(tmp_path_factory) -> dict:
    """The description of the service, from which the page knows all fields."""
    return create_application(Settings(data_dir=tmp_path_factory.mktemp("described"))).openapi()


@pytest.fixture
def read(openapi):
    """Reads files as the page does; several at once where there are several."""

    def reading(*files):
        found = read_files(openapi, files)
        return found[0] if len(files) == 1 else found

    return reading
