"""How long a pan of the dashboard's map takes to redraw: 100 UAVs by 300 areas with a plan on it.

Run it with ``python tests/benchmarks/bench_dashboard.py``. It starts a service and Debian's Chromium, drags
the map forty times, and measures from each movement of the pointer until the frame with it has been drawn.
The limit is 50 ms; without a graphics card, the browser's own rasteriser is in the figures.
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
from dashboard_steps import open_problem, ready, show_answer  # noqa: E402 - tests are no package
from live_service import LiveService  # noqa: E402 - tests are no package

N_UAVS, N_TARGETS, SEED, MOVES, LIMIT_MS = 100, 300, 7, 40, 50.0
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


def problem() -> dict:
    """Make a problem of the size in question, areas and UAVs anywhere in a square."""
    rng = np.random.default_rng(SEED)
    return {
        "uavs": [
            {"id": f"uav-{i}", "x_s": x, "y_s": y, "speed": 1.0, "voyage": 3.0, "loadlist": [12.0, 12.0]}
            for i, (x, y) in enumerate(rng.random((N_UAVS, 2)).round(4).tolist(), 1)
        ],
        "targets": [
            {"id": f"area-{j}", "x": x, "y": y, "level": level, "loadlist": [4.0, 3.0]}
            for j, (x, y, level) in enumerate(rng.random((N_TARGETS, 3)).round(4).tolist(), 1)
        ],
    }


def main() -> None:
    """Drag the map, print the times."""
    with tempfile.TemporaryDirectory() as folder, browsing() as browser:
        service = LiveService(Path(folder), workers=1).start()
        try:
            service.await_ready()
            page = browser.new_page(viewport={"width": 1366, "height": 900})
            page.goto(service.url)
            ready(page)
            open_problem(page, problem(), "100 x 300")
            show_answer(page, service.url, algorithm="greedy")
            shapes = page.evaluate(_WATCH)
            box = page.locator("#map").bounding_box()
            x, y = box["x"] + box["width"] * 0.4, box["y"] + box["height"] * 0.4
            page.mouse.move(x, y)
            page.mouse.down()
            for move in range(MOVES):
                page.mouse.move(x + 5 * move, y + 3 * move)
            page.mouse.up()
            times = page.evaluate("window.redraws")[1:]
        finally:
            service.stop()
    print(f"{N_UAVS} UAVs x {N_TARGETS} areas, {shapes} shapes, {len(times)} redraws of a pan")
    print(
        f"median {statistics.median(times):.1f} ms, 95th percentile {np.percentile(times, 95):.1f} ms, "
        f"largest {max(times):.1f} ms (limit {LIMIT_MS:g} ms)"
    )


if __name__ == "__main__":
    main()
