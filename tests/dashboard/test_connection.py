"""A link that goes silent, a service that is away, a tab that nobody sees."""

import pytest
from dashboard_steps import go, ready
from page_modules import run_module
from playwright.sync_api import expect

SILENT = """
    // A first stream that says one thing and then nothing, and a second one that ends.
    globalThis.sessionStorage = { getItem: () => null };
    globalThis.document = { baseURI: "http://service/" };
    const timers = [];
    globalThis.setTimeout = (act, wait) => timers.push({ act, wait }) && timers.length;
    globalThis.clearTimeout = (timer) => { if (timer) timers[timer - 1].act = null; };
    const event = (id, name, data) =>
        new TextEncoder().encode(`id: ${id}\\nevent: ${name}\\ndata: ${JSON.stringify(data)}\\n\\n`);
    let left = false;
    const cancel = () => { left = true; };
    const silent = new ReadableStream({ start: (to) => to.enqueue(event(1, "progress", { n: 1 })), cancel });
    const end = (to) => { to.enqueue(event(2, "end", { n: 2 })); to.close(); };
    const ending = new ReadableStream({ start: end });
    const asked = [];
    globalThis.fetch = async (url, { headers }) => {
        asked.push([url, headers["Last-Event-ID"] ?? null]);
        if (!url.endsWith("/events")) return Response.json({ id: "j", status: "succeeded" });
        return new Response(asked.length === 1 ? silent : ending);
    };
    const { follow } = await load("api.js");
    const heard = [];
    let lost = 0;
    const job = follow("j", (data) => heard.push(data.n), () => { lost += 1; });
    const turn = () => new Promise((done) => setImmediate(done));
    for (let n = 0; n < 20; n += 1) await turn();
    const before = { heard: [...heard], waiting: timers.filter(({ act }) => act).map(({ wait }) => wait) };
    for (let rounds = 0; rounds < 20; rounds += 1) {
        for (const timer of timers.splice(0)) timer.act?.();
        for (let n = 0; n < 20; n += 1) await turn();
        if (heard.length > 1) break;
    }
    return { before, job: await job, heard, lost, left, asked };
"""


def test_a_stream_that_goes_silent_is_asked_for_again():
    found = run_module(SILENT)
    assert found["before"] == {"heard": [1], "waiting": [40_000]}
    assert found["heard"] == [1, 2]
    assert found["asked"][:2] == [
        ["http://service/jobs/j/events", None],
        ["http://service/jobs/j/events", "1"],
    ]
    assert (found["lost"], found["left"], found["job"]["status"]) == (1, True, "succeeded")


@pytest.fixture
def away(browser, service):
    """The page in a browser that can lose the service; every error that nobody has caught is kept."""
    context = browser.new_context()
    page = context.new_page()
    page.uncaught = []
    page.on("pageerror", lambda error: page.uncaught.append(str(error)))
    yield page
    context.close()


def test_what_is_asked_while_the_service_is_away_says_so(away, service):
    page = away
    page.goto(service.url)
    ready(page)
    page.wait_for_selector("[data-example=paper-5x10]")
    page.context.set_offline(True)
    page.click("[data-example=paper-5x10]")
    expect(page.locator("#alerts .notice")).to_contain_text("The service cannot be reached")
    for view in ("allocate", "library", "recent"):
        go(page, view)
    page.click("#tab-allocate")
    page.click("#start")
    expect(page.locator("#job-error")).to_contain_text("The service cannot be reached")
    assert page.uncaught == []


def test_a_page_whose_service_answers_nothing_yet_fills_itself_later(away, service):
    page = away
    blocked = ("**/settings.json", "**/openapi.json", "**/algorithms", "**/examples", "**/readyz")
    for path in blocked:
        page.route(path, lambda route: route.abort())
    page.clock.install()
    page.goto(service.url)
    ready(page)
    expect(page.locator("#service")).to_have_text("Not reachable")
    for path in blocked:
        page.unroute(path)
    page.clock.run_for(11_000)
    expect(page.locator("[data-example=paper-5x10]")).to_be_visible()
    expect(page.locator("#problem-title")).to_contain_text("cyclone-idai")
    assert page.uncaught == []


def test_a_tab_that_nobody_sees_asks_nothing(away, service):
    page = away
    asked = []
    page.on("request", lambda request: asked.append(request.url) if request.url.endswith("readyz") else None)
    page.clock.install()
    page.goto(service.url)
    ready(page)
    expect(page.locator("#service")).to_have_text("Ready")
    hide = """(hidden) => {
        Object.defineProperty(document, "hidden", { configurable: true, get: () => hidden });
        document.dispatchEvent(new Event("visibilitychange"));
    }"""
    page.evaluate(hide, True)
    before = len(asked)
    page.clock.run_for(60_000)
    assert len(asked) == before
    with page.expect_request("**/readyz"):
        page.evaluate(hide, False)
