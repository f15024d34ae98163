"""A day of a medical network: bases with stock, hours at which hospitals take deliveries, and what happens.

    python medical_network.py http://127.0.0.1:8000

The hospitals and the distribution centre are those of the service's example `rwanda-floods`. Assumed here: a
second base at the referral hospital of Ruhengeri, the hours, and the events of the day. Needs the package
uav-allocator-client.
"""

import sys
import time

from uav_allocator_client import Client, types

SECOND_BASE = "ruhengeri"
MORNING_ONLY = {"nemba", "ruli"}
AFTERNOON_ONLY = {"kibuye"}


def network(service: Client) -> types.Problem:
    """Return the example's problem with another base, and hours for some hospitals."""
    problem = service.example("rwanda-floods")
    at = next(each for each in problem["targets"] if each["id"] == SECOND_BASE)
    problem["bases"].append(
        {"id": "north", "x": at["x"], "y": at["y"], "stock": [6, 4, 6], "turnaround": 0.25}
    )
    for hospital in problem["targets"]:
        if hospital["id"] in MORNING_ONLY:
            hospital["deadline"] = 1.5
        if hospital["id"] in AFTERNOON_ONLY:
            hospital["earliest"] = 1.0
    return problem


def accept_what_is_proposed(service: Client, mission_id: str, event_id: str) -> None:
    """Wait for the search that is under way, and accept the plan that it proposes, if it does."""
    while service.mission(mission_id)["searching"]:
        time.sleep(0.1)
    newest = service.proposals(mission_id)[:1]
    if newest and newest[0]["status"] == "open":
        proposal = newest[0]["number"]
        service.tell(mission_id, {"type": "proposal_accepted", "id": event_id, "proposal": proposal})
        print(f"plan {proposal} is in force, and earns {newest[0]['gained']:.3f} more")
    else:
        print("no better plan was found")


def main(url: str, key: str | None = None) -> None:
    """Begin the day, tell what happens, and say what was done at its end."""
    with Client(url, key) as service:
        mission_id = service.begin_mission(network(service), name="a day in the west", time_limit_s=1)["id"]
        accept_what_is_proposed(service, mission_id, "first plan")
        service.tell(mission_id, {"type": "clock", "id": "half past", "at": 0.5})
        told = service.tell(mission_id, {"type": "uav_lost", "id": "wing 6", "at": 0.6, "uav_id": "wing-6"})
        for broken in told["effect"]["broken"] if told["effect"] else ():
            print(f"cannot be made any more: {broken}")
        service.tell(
            mission_id,
            {
                "type": "stock_changed",
                "id": "resupply",
                "at": 0.7,
                "base_id": "muhanga",
                "stock": [30, 20, 30],
            },
        )
        accept_what_is_proposed(service, mission_id, "second plan")
        service.tell(mission_id, {"type": "clock", "id": "evening", "at": 3.5})
        state = service.mission_state(mission_id)["state"]
        visits = [done for done in state["done"] if "target_id" in done]
        print(f"{len(visits)} deliveries to {len({done['target_id'] for done in visits})} hospitals")
        for event in service.history(mission_id):
            print(f"{event['at']:.2f} h: {event['type']}")


if __name__ == "__main__":
    main(*sys.argv[1:])
