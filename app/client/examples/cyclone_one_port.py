"""A cyclone, and one port: plan what Cyclone Idai left to be done around Beira, and take the plan along.

    python cyclone_one_port.py http://127.0.0.1:8000 FOLDER

The search is followed while it runs, and ended when its plan is good enough. The folder gets the plan as a
table, as a map, as a page to print, and as flight files. Needs the package uav-allocator-client.
"""

import sys
from pathlib import Path

from uav_allocator_client import Client, types

GOOD_ENOUGH = 30.0
FILES: tuple[types.PlanFormat, ...] = ("csv", "geojson", "html", "qgc-plan")


def main(url: str, folder: Path, key: str | None = None) -> None:
    """Plan, tell what comes of it, and write the files."""
    with Client(url, key) as service:
        problem = service.example("cyclone-idai")
        job = service.submit(problem, algorithm="auto", time_limit_s=5)
        for event in service.follow(job["id"]):
            best = event.data["best_reward"]
            print(f"{event.name}: {event.data['fraction']:.0%}, best reward {best}")
            if best is not None and best >= GOOD_ENOUGH and event.name == "progress":
                service.cancel(job["id"])  # the best plan so far becomes the answer
                break
        answer = service.answer(job["id"])
        print(f"reward {answer['reward']:.3f}, {answer['distance']:.0f} km, found by {answer['answered_by']}")
        for route in answer["routes"]:
            places = [stop["target_id"] for stop in route["stops"] if "target_id" in stop]
            print(f"{route['uav_id']}: {' → '.join(places) or 'stays'}")
        for need in answer["unmet"]:
            print(f"{need['target_id']} lacks {need['remaining']}: {need['reason']}")
        folder.mkdir(parents=True, exist_ok=True)
        for format in FILES:
            file = service.export(job["id"], format)
            (folder / file.name).write_bytes(file.content)
            print(f"wrote {file.name}")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), *sys.argv[3:])
