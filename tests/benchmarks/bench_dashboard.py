"""How long the dashboard takes to redraw: 100 UAVs by 300 areas, and 1000 by 2000, the service's most.

Run it with ``python tests/benchmarks/bench_dashboard.py``; ``CHROMIUM=/usr/bin/chromium`` takes the browser
with windows instead of the shell that the tests prefer. Compare figures of one browser only. It starts a
service and the browser, and at each size opens a problem, edits one area, allocates it greedily, goes through
the views and drags the map forty times. The UAVs start anywhere, or at three bases. A pan is measured from
each movement of the pointer until the frame with it has been drawn, all else from the call until the frame
after it. The limit is 50 ms for a pan; without a graphics card, the browser's own rasteriser is in the
figures. ``--pictures FOLDER`` keeps a picture of each.
"""

from __future__ import annotations

import argparse
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

SIZES = ((100, 300, None), (1000, 2000, None), (1000, 2000, 3))
"""UAVs, areas, and the places at which the UAVs start; None: anywhere."""
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


def problem(n_uavs: int, n_targets: int, n_places: int | None) -> dict:
    """Make a problem of a size in a square, areas anywhere, UAVs anywhere or at so many places."""
    rng = np.random.default_rng(SEED)
    starts = rng.random((n_places or n_uavs, 2)).round(4).tolist()
    return {
        "uavs": [
            {"id": f"uav-{i}", "x_s": x, "y_s": y, "speed": 1.0, "voyage": 3.0, "loadlist": [12.0, 12.0]}
            for i, (x, y) in enumerate((starts[i % len(starts)] for i in range(n_uavs)), 1)
        ],
        "targets": [
            {"id": f"area-{j}", "x": x, "y": y, "level": level, "loadlist": [4.0, 3.0]}
            for j, (x, y, level) in enumerate(rng.random((n_targets, 3)).round(4).tolist(), 1)
        ],
    }


def main() -> None:
    """Measure all sizes, print the times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=Path, help="folder for a picture of each size")
    pictures: Path | None = parser.parse_args().pictures
    with tempfile.TemporaryDirectory() as folder, browsing() as browser:
        service = LiveService(Path(folder), workers=1).start()
        try:
            service.await_ready()
            for size in SIZES:
                page = browser.new_page(viewport={"width": 1366, "height": 900})
                page.set_default_timeout(120_000)
                page.goto(service.url)
                ready(page)
                measure(page, service.url, *size)
                if pictures is not None:
                    page.screenshot(path=pictures / f"{'-'.join(map(str, size))}.png")
                page.close()
        finally:
            service.stop()


def measure(page: Page, url: str, n_uavs: int, n_targets: int, n_places: int | None) -> None:
    """Open, edit, allocate, look at the answer and drag the map, and print how long each took."""
    steps = [
        ("open", "open", problem(n_uavs, n_targets, n_places)),
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
    where = "anywhere" if n_places is None else f"at {n_places} places"
    print(f"{n_uavs} UAVs {where} x {n_targets} areas, {shapes} shapes, {len(pans)} redraws of a pan")
    print(
        f"  pan: median {statistics.median(pans):.1f} ms, 95th percentile {np.percentile(pans, 95):.1f} ms, "
        f"largest {max(pans):.1f} ms (limit {LIMIT_MS:g} ms)"
    )
    print("  " + ", ".join(f"{name} {time:.0f} ms" for name, time in times.items()), flush=True)


if __name__ == "__main__":
    main()
