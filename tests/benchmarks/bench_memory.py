"""What memory does the service take that waits for work, and what processor time did its start take?

    python tests/benchmarks/bench_memory.py [--workers 2]

The service is started with compiled code at hand, gives one answer of the default algorithm, and waits. Of
each of its processes is printed its own memory, its proportional share with what several have together (PSS),
and its processor time. Linux only.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import httpx

sys.path[:0] = [str(Path(__file__).parents[1] / "support")]

from live_service import ROOT, LiveService  # noqa: E402

SETTLED_S = 5.0
_MEMORY = re.compile(r"^(Pss|Private_Clean|Private_Dirty): +(\d+) kB$", re.MULTILINE)


def main() -> None:
    """Start the service, ask it once, and print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--workers", type=int, default=2)
    workers = parser.parse_args().workers
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=workers).start()
        try:
            service.await_ready(workers)
            problem = json.loads((ROOT / "app/examples/cyclone-idai.json").read_text(encoding="utf-8"))
            httpx.post(f"{service.url}/allocate", json=problem, timeout=600).raise_for_status()
            time.sleep(SETTLED_S)
            rows = [measured(process) for process in tree(service.pid)]
        finally:
            service.stop()
    print("| process | its own, MB | share, MB | processor, s |\n| --- | --- | --- | --- |")
    for row in rows:
        print("| {} | {:.0f} | {:.0f} | {:.1f} |".format(*row))
    print(f"| all | | {sum(row[2] for row in rows):.0f} | {sum(row[3] for row in rows):.1f} |")


def tree(process: int) -> Iterator[int]:
    """Return a process and all that descend from it."""
    yield process
    for task in Path(f"/proc/{process}/task").iterdir():
        for child in (task / "children").read_text().split():
            yield from tree(int(child))


def measured(process: int) -> tuple[str, float, float, float]:
    """Return what a process runs, its own memory and its share in MB, its processor time in seconds."""
    folder = Path(f"/proc/{process}")
    found = {name: int(kb) / 1024 for name, kb in _MEMORY.findall((folder / "smaps_rollup").read_text())}
    command = (folder / "cmdline").read_text().split("\0")
    what = next((word for word in command if "multiprocessing" in word), "server").partition(" import")[0]
    times = (folder / "stat").read_text().rsplit(")", 1)[1].split()[11:13]
    processor = sum(map(int, times)) / os.sysconf("SC_CLK_TCK")
    own = found["Private_Clean"] + found["Private_Dirty"]
    return what.removeprefix("from "), own, found["Pss"], processor


if __name__ == "__main__":
    main()
