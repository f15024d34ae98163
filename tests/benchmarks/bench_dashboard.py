"""How long the dashboard takes to redraw, at 100 UAVs by 300 areas and at the service's most, 1000 by 2000.

Run it with ``CHROMIUM=/usr/bin/chromium python tests/benchmarks/bench_dashboard.py``: the browser with
windows, not the shell that the tests prefer. It starts a service and the browser, and at each size opens a
problem, edits one area, allocates it greedily, goes through the views and drags the map forty times. A pan
is measured from each movement of the pointer until the frame with it has been drawn, all else from the call
until the frame after it. The limit is 50 ms for a pan at 100 by 300; without a graphics card, the browser's
own rasteriser is in the figures.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support"), str(ROOT / "tests" / "dashboard")]

from conftest import browsing  # noqa: E402 - tests are no package
from dashboard_steps import ready, show_answer  # noqa: E402 - tests are no package
from live_service import LiveService  # noqa: E402 - tests are no package
from playwright.sync_api import Page  # noqa: E402 - tests are no package

SIZES = ((100, 300), (1000, 2000))
SEED, MOVES, LIMIT_MS = 7, 40, 50.0
_WATCH = """() => {
  window.redraws = [];
  const map = document.getElementById("map");
  document.addEventListener("mousemove", () => {
    const began = performance.now();
    requestAnimationFrame(() => {
      const channel = new MessageChannel();
      channel.port1.onmessage = () => window.redraws.push(performance.now() - began);
      channel.port2.postMessage(null);
    });
  }, { capture: true });
  return map.querySelectorAll("path, .leaflet-marker-icon").length;
}"""


_TIMED = """async ([change, argument]) => {
  const began = performance.now();
  const steps = {
    open: async (problem) => (await import("/dashboard/js/problem.js")).open(problem, "a large one"),
    edit: async () => (await import("/dashboard/js/problem.js")).update("targets", "area-7", { level: 0.4 }),
    select: async () => (await import("/dashboard/js/state.js")).select({ kind: "targets", id: "area-299" }),
    show: async (view) => (await import("/dashboard/js/state.js")).set({ view }),
  };
  await steps[change](argument);
  await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
  return performance.now() - began;
}"""


def problem(n_uavs: int, n_targets: int) -> dict:
    """Make a problem of a size, areas and UAVs anywhere in a square."""
    rng = np.random.default_rng(SEED)
    return {
        "uavs": [
            {"id": f"uav-{i}", "x_s": x, "y_s": y, "speed": 1.0, "voyage": 3.0, "loadlist": [12.0, 12.0]}
            for i, (x, y) in enumerate(rng.random((n_uavs, 2)).round(4).tolist(), 1)
        ],
        "targets": [
            {"id": f"area-{j}", "x": x, "y": y, "level": level, "loadlist": [4.0, 3.0]}
            for j, (x, y, level) in enumerate(rng.random((n_targets, 3)).round(4).tolist(), 1)
        ],
    }


def main() -> None:
    """Measure both sizes, print the times."""
    with tempfile.TemporaryDirectory() as folder, browsing() as browser:
        service = LiveService(Path(folder), workers=1).start()
        try:
            service.await_ready()
            for n_uavs, n_targets in SIZES:
                page = browser.new_page(viewport={"width": 1366, "height": 900})
                page.set_default_timeout(120_000)
                page.goto(service.url)
                ready(page)
                measure(page, service.url, n_uavs, n_targets)
                page.close()
        finally:
            service.stop()


def measure(page: Page, url: str, n_uavs: int, n_targets: int) -> None:
    """Open, edit, allocate, look at the answer and drag the map, and print how long each took."""
    steps = [
        ("open", "open", problem(n_uavs, n_targets)),
        ("edit one area", "edit", None),
        ("select", "select", None),
    ]
    times = {name: page.evaluate(_TIMED, [step, argument]) for name, step, argument in steps}
    show_answer(page, url, algorithm="greedy")
    for view in ("answer", "missions", "problem"):
        times[f"view {view}"] = page.evaluate(_TIMED, ["show", view])
    shapes = page.evaluate(_WATCH)
    box = page.locator("#map").bounding_box()
    x, y = box["x"] + box["width"] * 0.4, box["y"] + 30
    page.mouse.move(x, y)
    page.mouse.down()
    for move in range(MOVES):
        page.mouse.move(x + 5 * move, y + 3 * move)
    page.mouse.up()
    pans = page.evaluate("window.redraws")[1:]
    print(f"{n_uavs} UAVs x {n_targets} areas, {shapes} shapes, {len(pans)} redraws of a pan")
    print(
        f"  pan: median {statistics.median(pans):.1f} ms, 95th percentile {np.percentile(pans, 95):.1f} ms, "
        f"largest {max(pans):.1f} ms (limit at 100 x 300: {LIMIT_MS:g} ms)"
    )
    print("  " + ", ".join(f"{name} {time:.0f} ms" for name, time in times.items()), flush=True)


if __name__ == "__main__":
    main()
