"""Pictures of every view of the dashboard: `python tests/dashboard/screenshots.py [--out FOLDER]`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support"), str(Path(__file__).parent)]

from conftest import browsing  # noqa: E402 - tests are no package
from dashboard_steps import go, ready, show_answer  # noqa: E402 - tests are no package
from live_service import LiveService  # noqa: E402 - tests are no package
from playwright.sync_api import Page, expect  # noqa: E402 - tests are no package

OUT = ROOT / "app" / "dashboard" / "screenshots"
SIZE = {"width": 1280, "height": 800}
LIMIT_BYTES = 150_000
PROPOSED = """async () => {
    const { get } = await import("/dashboard/js/state.js");
    const { events, proposals } = get().openMission;
    const lost = events.find(({ type }) => type === "uav_lost");
    return lost && proposals.some(({ status, of_number: of }) => status === "open" && of >= lost.number);
}"""
"""Whether a plan was found for what is left after a UAV was lost."""


def main() -> None:
    """Take every picture, and say how large it is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the pictures")
    out: Path = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, browsing() as browser:
        service = LiveService(Path(folder), workers=1).start()
        try:
            service.await_ready()
            context = browser.new_context(viewport=SIZE, reduced_motion="reduce", color_scheme="light")
            page = context.new_page()
            page.goto(service.url)
            take_all(page, service.url, out)
            context.close()
        finally:
            service.stop()
    for file in sorted(out.glob("*.png")):
        size = file.stat().st_size
        print(f"{file.name}: {size / 1000:.0f} kB{' (too large)' if size > LIMIT_BYTES else ''}")


def take_all(page: Page, url: str, out: Path) -> None:
    """Go through the views as a dispatcher would."""

    def take(name: str) -> None:
        page.locator(".notice").evaluate_all("(notices) => notices.forEach((notice) => notice.remove())")
        page.screenshot(path=out / f"{name}.png")

    ready(page)
    page.wait_for_load_state("networkidle")
    take("problem")
    show_answer(page, url, algorithm="transfer_qmix", time_limit_s=2)
    go(page, "allocate")
    take("allocate")
    go(page, "answer")
    take("answer")
    go(page, "compare")
    page.locator("#compare-limit").fill("1")
    page.locator("#view-compare button[type=submit]").click()
    expect(page.get_by_test_id("compare-status")).to_contain_text("have a plan", timeout=60_000)
    take("compare")
    take_mission(page)
    take("missions")
    go(page, "library")
    expect(page.locator("article.policy").first).to_be_visible()
    take("library")
    go(page, "take-away")
    take("take-away")
    page.set_viewport_size({"width": 820, "height": 1180})
    go(page, "answer")
    take("tablet")


def take_mission(page: Page) -> None:
    """Begin a mission with the plan on screen, and lose a UAV half an hour later."""
    go(page, "missions")
    page.locator("#mission-form input[name=name]").fill("First day")
    page.get_by_role("button", name="Begin the mission").click()
    expect(page.get_by_test_id("mission-UAVs")).to_be_visible(timeout=60_000)
    page.locator("#mission-time").fill("0.3")
    page.locator("#mission-time").press("Tab")
    page.get_by_role("button", name="Move the clock here").click()
    expect(page.locator("[data-testid=mission-log] li[data-type=clock]")).to_be_attached()
    page.locator("[data-testid=mission-UAVs] tr[data-uav=mid-2] button").click()
    page.locator("#mission-acts button[data-type=uav_lost]").click()
    page.get_by_test_id("mission-happened").get_by_role("button", name="Tell").click()
    page.wait_for_function(PROPOSED, timeout=60_000)
    expect(page.get_by_role("button", name="Accept")).to_be_visible()
    page.evaluate("async () => (await import('/dashboard/js/state.js')).select(null)")
    page.locator("#panel").evaluate("(panel) => panel.scrollTo(0, 0)")


if __name__ == "__main__":
    main()
