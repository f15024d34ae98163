"""What UAVs do, and what events did, in words."""

import json

from page_modules import run_module

WORDS = """
    const { doing, stopsAhead, brought } = await load("missions/doing.js");
    const { happened, effectOf } = await load("missions/wording.js");
    const { state, plan } = given;
    return {
        doing: state.problem.uavs.map((uav, i) => doing(uav, plan.routes[i], state, (place) => place)),
        ahead: stopsAhead(state.problem, plan).map(({ uav, place, begin }) => [uav.id, place, begin]),
        brought: [...brought(plan)],
        said: given.told.map((each) => [happened(each), effectOf(each)]),
    };
"""


def test_what_uavs_do_and_what_events_did_in_words():
    at_home = {"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [1]}
    aloft = {**at_home, "x_c": 1, "y_c": 0, "dis": 1, "available_from": 5}
    uavs = [
        {**aloft, "id": "flies"},
        {**aloft, "id": "works", "available_from": 6},
        {**at_home, "id": "waits", "available_from": 5},
        {**aloft, "id": "gone"},
        {**aloft, "id": "back"},
        {**at_home, "id": "idle", "available_from": 5},
        {**at_home, "id": "late", "available_from": 7},
    ]
    visit = {"step": 1, "distance": 3, "delivered": [1]}
    at_8 = {**visit, "target_id": "a", "arrival_time": 8, "begin_time": 8, "departure_time": 8}
    at_9 = {**visit, "target_id": "b", "arrival_time": 8, "begin_time": 9, "departure_time": 9}
    stops = {"flies": [at_8], "waits": [at_9], "works": [{**at_9, "arrival_time": 9}]}
    routes = [
        {
            "uav_id": uav["id"],
            "stops": stops.get(uav["id"], []),
            "landing": {"time": 12 if uav["id"] == "back" else 5},
        }
        for uav in uavs
    ]
    problem = {"uavs": uavs, "targets": [{"id": "a", "loadlist": [2]}, {"id": "b", "loadlist": [2]}]}
    done = [{"uav_id": "works", "target_id": "a", "time": 4, "amounts": [1]}]
    broken = {"uav_id": "u", "target_id": "a", "says": "no range is left"}
    told = [
        {"type": "visit_done", "event": {"uav_id": "u", "target_id": "a", "delivered": [2]}},
        {"type": "uav_lost", "event": {"uav_id": "u"}, "effect": {"broken": [broken], "late": []}},
        {"type": "telemetry", "event": {"positions": [1, 2]}, "passed_over": 2},
    ]
    given = {
        "state": {"clock": 5, "problem": problem, "done": done, "lost": ["gone"]},
        "plan": {"routes": routes},
        "told": told,
    }
    found = run_module(WORDS, json.loads(json.dumps(given)))
    assert found["doing"] == [
        "to a, there at 8",
        "at a until 6",
        "takes off at 6 to b",
        "lost",
        "flies home, there at 12",
        "at its base",
        "waits until 7",
    ]
    assert found["ahead"] == [["flies", "a", 8], ["works", "b", 9], ["waits", "b", 9]]
    assert found["brought"] == [["a", [1]], ["b", [2]]]
    assert found["said"] == [
        ["u visited a, unloaded 2", ""],
        ["u is lost", "u does not stop at a: no range is left"],
        ["2 positions", "2 were older than what is known"],
    ]
