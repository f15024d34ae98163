"""Random days: after every event the plan in force is legal by the referee, and earns what it says."""

from dataclasses import replace

import numpy as np
import pytest
from mission_days import Day, require_sound
from problems import random_plan, random_problem
from worlds import random_loading, random_sorties, random_world

from app.domain.errors import IllegalPlan
from app.domain.records import problem_to_record
from app.jobs.worker import WorkContext
from app.missions import judging
from app.missions.errors import EventRefused

CONTEXT = WorkContext.in_process(lambda _progress: None)
EVENTS = 20


@pytest.mark.parametrize("seed", range(24))
def test_every_plan_in_force_is_legal(seed):
    rng = np.random.default_rng(seed)
    problem = (random_problem, random_world, random_sorties, random_loading)[seed % 4](rng)
    problem = replace(problem, start_plan=random_plan(problem, rng).assignment)
    record = problem_to_record(problem)
    try:
        begun = judging.begin({"problem": record}, CONTEXT).result
    except IllegalPlan:
        assert problem.plans_unloading  # the plan is one of greedy unloading
        return
    across = problem.extent / float(np.median([uav.speed for uav in problem.uavs]))
    day, positions, taken = Day(rng, across / 8), {}, 0
    state, plan, matrices = begun["state"], begun["plan"], record.get("matrices")
    for _ in range(EVENTS):
        event = day.event(state, plan)
        at = event.pop("at")
        if event["type"] == "telemetry":
            positions |= {each["uav_id"]: each for each in event["positions"]}
            continue
        event = with_defaults(event)
        payload = {"state": state, "matrices": matrices, "at": at, "positions": positions}
        try:
            after = judging.apply({**payload, "event": event}, CONTEXT).result
        except EventRefused as refused:
            assert "already" in refused.detail  # noqa: PT017 - of the zones that are drawn
            continue
        # The same state and event make the same state.
        assert judging.apply({**payload, "event": event}, CONTEXT).result == after
        state, plan, positions, taken = after["state"], after["plan"], {}, taken + 1
        require_sound(state, plan, matrices)
        assert after["effect"]["flyable"] == (not after["effect"]["broken"])
    assert taken > EVENTS / 3


def with_defaults(event):
    """The event with what a request may leave out."""
    if event["type"] != "uavs_added":
        return event
    uavs = [{"x_c": uav["x_s"], "y_c": uav["y_s"], **uav} for uav in event["uavs"]]
    return event | {"uavs": uavs}
