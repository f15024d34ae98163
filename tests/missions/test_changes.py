"""What events do to a mission, by hand-computed numbers: one UAV a line, areas to the east of it."""

from dataclasses import replace

import pytest

from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.domain.surroundings import Base
from app.jobs.worker import WorkContext
from app.missions import judging
from app.missions.errors import EventRefused, ProposalClosed
from app.missions.state import MissionState, Stop, with_routes, without_plan

CONTEXT = WorkContext.in_process(lambda _progress: None)


def problem(**changes):
    """Two UAVs at x = 0, of speed 1; three areas at x = 2, 4 and 6, each of which needs 2."""
    return Problem(
        **{
            "uavs": tuple(UAV(f"uav-{i}", 0.0, float(i), 0.0, float(i), 1.0, 30.0, (4.0,)) for i in (1, 2)),
            "targets": tuple(Target(f"area-{j}", 2.0 * j, 1.0, 1.0, (2.0,)) for j in (1, 2, 3)),
            "objective": Objective(distance_weight=0.01),
            "max_steps": 6,
            **changes,
        }
    )


class Mission:
    """A mission that is judged in this process."""

    def __init__(self, of, *routes):
        stops = [[Stop(each, each.startswith("base")) for each in route] for route in routes]
        planned = with_routes(without_plan(of), stops)
        begun = judging.begin({"problem": problem_to_record(planned)}, CONTEXT).result
        self.state, self.plan, self.effect, self.wants_plan = begun["state"], begun["plan"], None, None
        self.matrices = problem_to_record(of).get("matrices")

    def tell(self, at, type_, positions=(), offer=None, **event):
        seen = {each["uav_id"]: each for each in positions}
        payload = {"state": self.state, "matrices": self.matrices, "positions": seen, "proposal": offer}
        after = judging.apply({**payload, "event": {"type": type_, **event}, "at": at}, CONTEXT).result
        self.state, self.plan = after["state"], after["plan"]
        self.effect, self.wants_plan = after["effect"], after["wants_plan"]
        return self

    def refuses(self, pointer, says, at, type_, **event):
        before = dict(self.state)
        with pytest.raises(EventRefused, match=says) as refused:
            self.tell(at, type_, **event)
        assert refused.value.violations[0].pointer == pointer
        assert self.state == before

    def uav(self, i=0):
        return self.state["problem"]["uavs"][i]

    def area(self, j=0):
        return self.state["problem"]["targets"][j]

    @property
    def routes(self):
        of = MissionState.from_record(self.state, self.matrices)
        return [[stop.id for stop in route] for route in of.routes]


def test_what_is_not_reported_goes_as_planned():
    mission = Mission(problem(), ["area-1", "area-2"], []).tell(3.0, "clock")
    assert mission.state["done"] == [
        {"uav_id": "uav-1", "target_id": "area-1", "time": 2.0, "amounts": [2.0], "reported": False}
    ]
    assert (mission.uav()["x_c"], mission.uav()["dis"], mission.uav()["loadlist"]) == (3.0, 3.0, [2.0])
    assert mission.uav()["committed"] == ["area-2"]
    assert mission.area()["loadlist"] == [0.0]
    assert mission.routes == [["area-2"], []]
    assert mission.effect["flyable"]
    assert not mission.wants_plan


def test_a_visit_that_went_as_planned_changes_nothing():
    mission = Mission(problem(), ["area-1", "area-2"], []).tell(3.0, "clock")
    before = mission.state["problem"]
    mission.tell(3.0, "visit_done", uav_id="uav-1", target_id="area-1", delivered=[2.0], time=2.1)
    assert mission.state["problem"] == before
    assert mission.state["done"][0] | {"reported": True, "time": 2.1} == mission.state["done"][0]
    assert not mission.wants_plan


def test_what_was_not_unloaded_is_still_aboard_and_still_needed():
    mission = Mission(problem(), ["area-1", "area-2"], []).tell(3.0, "clock")
    mission.tell(3.0, "visit_done", uav_id="uav-1", target_id="area-1", delivered=[0.5])
    assert mission.uav()["loadlist"] == [3.5]
    assert (mission.area()["loadlist"], mission.area()["requested"]) == ([1.5], [2.0])
    assert mission.state["done"][0]["amounts"] == [0.5]
    assert mission.wants_plan
    mission.refuses("/delivered/0", "had 3.5 aboard", 3.0, "visit_done", uav_id="uav-1", target_id="area-2",
                    delivered=[4.5])  # fmt: skip


def test_a_visit_that_comes_early_puts_the_uav_there():
    mission = Mission(problem(), ["area-1", "area-2"], [])
    mission.tell(1.0, "visit_done", uav_id="uav-1", target_id="area-1", delivered=[2.0])
    uav = mission.uav()
    assert (uav["x_c"], uav["dis"], uav["available_from"], uav["loadlist"]) == (2.0, 2.0, 1.0, [2.0])
    assert mission.routes == [["area-2"], []]
    assert mission.plan["routes"][0]["stops"][0]["arrival_time"] == 3.0


def test_a_visit_that_was_not_planned_is_taken_as_it_was():
    mission = Mission(problem(), ["area-1"], [])
    mission.tell(5.0, "visit_done", uav_id="uav-2", target_id="area-2", delivered=[1.0])
    uav = mission.uav(1)
    assert (uav["x_c"], uav["loadlist"]) == (4.0, [3.0])
    assert uav["dis"] == pytest.approx(17**0.5)
    assert mission.area(1)["loadlist"] == [1.0]


def test_a_lost_uav_makes_no_visit_and_the_others_do():
    mission = Mission(problem(), ["area-1", "area-2"], ["area-3"]).tell(1.0, "uav_lost", uav_id="uav-1")
    assert [(each["target_id"], each["rule"]) for each in mission.effect["broken"]] == [
        ("area-1", "uav_lost"),
        ("area-2", "uav_lost"),
    ]
    assert mission.routes == [[], ["area-3"]]
    assert mission.uav()["ret"] == 1
    assert mission.effect["reward"] < mission.effect["reward_before"]
    assert mission.wants_plan
    mission.refuses("/uav_id", "is lost", 2.0, "uav_lost", uav_id="uav-1")
    mission.refuses("/uav_id", "is no UAV", 2.0, "uav_lost", uav_id="uav-9")


def test_a_delay_makes_later_visits_late_and_breaks_those_with_deadlines():
    targets, uavs = problem().targets, problem().uavs
    targets = (targets[0], replace(targets[1], deadline=5.0), targets[2])
    uavs = (replace(uavs[0], loadlist=(6.0,)), uavs[1])
    mission = Mission(problem(targets=targets, uavs=uavs), ["area-1", "area-2", "area-3"], [])
    mission.refuses("/until", "not after", 1.0, "uav_delayed", uav_id="uav-1", until=0.5)
    mission.tell(1.0, "uav_delayed", uav_id="uav-1", until=3.0)
    broken, late = mission.effect["broken"], mission.effect["late"]
    assert [(each["target_id"], each["rule"], each["needed"], each["had"]) for each in broken] == [
        ("area-2", "deadline", 6.0, 5.0)
    ]
    assert {(each["target_id"], each["planned"], each["arrival_time"]) for each in late} == {
        ("area-1", 2.0, 4.0),
        ("area-3", 6.0, 8.0),
    }
    assert mission.uav()["airborne"] == 3.0


def test_areas_are_added_changed_and_cancelled():
    mission = Mission(problem(), ["area-1", "area-2"], ["area-3"]).tell(3.0, "clock")
    new = {"id": "area-4", "x": 1.0, "y": 1.0, "level": 2.0, "loadlist": [1.0]}
    mission.tell(3.0, "areas_added", targets=[new])
    assert mission.routes == [["area-2"], ["area-3"]]
    assert mission.effect["flyable"]
    assert mission.wants_plan
    mission.refuses("/targets/0/id", "already", 3.0, "areas_added", targets=[new])
    mission.refuses("/targets/0/loadlist", "2 amounts", 3.0, "areas_added",
                    targets=[new | {"id": "x", "loadlist": [1.0, 2.0]}])  # fmt: skip
    # Two were unloaded there; what it needs anew is asked for beside them.
    mission.tell(3.0, "areas_changed", targets=[new | {"id": "area-1", "loadlist": [3.0]}])
    assert (mission.area()["loadlist"], mission.area()["requested"]) == ([3.0], [5.0])
    mission.tell(3.5, "area_cancelled", target_id="area-2")
    assert [each["rule"] for each in mission.effect["broken"]] == ["area_cancelled"]
    assert mission.routes == [[], ["area-3"]]
    assert mission.uav().get("committed", []) == []
    mission.tell(3.5, "level_changed", target_id="area-3", level=7.0)
    assert mission.area(2)["level"] == 7.0


def test_a_zone_in_the_way_makes_a_detour():
    mission = Mission(problem(), ["area-1"], [])
    zone = {"id": "z", "polygon": [[1.0, 0.0], [1.5, 0.0], [1.5, 3.0], [1.0, 3.0]]}
    mission.tell(0.5, "zones_changed", no_fly_zones=[zone])
    (late,) = mission.effect["late"]
    assert late["planned"] == 2.0
    assert late["arrival_time"] == pytest.approx(0.5 + 1.25**0.5 + 0.5 + 1.25**0.5)


def test_a_uav_that_is_seen_behind_comes_later():
    mission = Mission(problem(), ["area-3"], [])
    seen = {"uav_id": "uav-1", "time": 2.0, "x": 1.0, "y": 1.0, "dis": 5.0}
    mission.tell(2.5, "clock", positions=[seen])
    (late,) = mission.effect["late"]
    assert (late["planned"], late["arrival_time"]) == (6.0, 7.0)
    assert mission.uav()["dis"] == 5.0
    assert mission.wants_plan


def test_who_has_nothing_left_to_do_flies_home_and_can_be_sent_again():
    mission = Mission(problem(), ["area-2"], []).tell(5.0, "clock")
    assert (mission.uav()["x_c"], mission.uav()["dis"]) == (3.0, 5.0)
    mission.tell(6.5, "clock")
    assert (mission.uav()["x_c"], mission.uav()["dis"]) == (1.5, 6.5)
    mission.tell(9.0, "clock")
    assert (mission.uav()["x_c"], mission.uav()["dis"], mission.uav()["ret"]) == (0.0, 8.0, 0)


def test_a_reload_is_reported():
    base = Base("base-1", 2.0, 1.0, stock=(9.0,))
    uavs = (replace(problem().uavs[0], loadlist=(0.0,), full_load=(4.0,)),)
    mission = Mission(problem(uavs=uavs, bases=(base,)), ["base-1", "area-2"]).tell(3.0, "clock")
    assert (mission.uav()["loadlist"], mission.state["problem"]["bases"][0]["stock"]) == ([4.0], [5.0])
    mission.tell(3.0, "reload_done", uav_id="uav-1", base_id="base-1", loadlist=[3.0])
    assert (mission.uav()["loadlist"], mission.state["problem"]["bases"][0]["stock"]) == ([3.0], [6.0])
    assert mission.state["done"][0]["amounts"] == [3.0]
    mission.tell(3.0, "stock_changed", base_id="base-1", stock=[1.0])
    assert mission.state["problem"]["bases"][0]["stock"] == [1.0]


def test_an_event_from_the_past_is_refused():
    mission = Mission(problem(), ["area-1"], []).tell(3.0, "clock")
    mission.refuses("/at", "the mission's clock is 3", 2.0, "clock")


def test_a_proposal_is_taken_where_it_fits_what_was_done_since():
    mission = Mission(problem(), ["area-1", "area-2"], [])
    proposal = {
        "stops": [[{"target_id": "area-1"}, {"target_id": "area-3"}], [{"target_id": "area-2"}]],
        "done": 0,
    }
    mission.tell(2.5, "clock")
    with pytest.raises(ProposalClosed, match="another visit"):
        # It is on its way to area-2.
        mission.tell(2.5, "proposal_accepted", offer=proposal, proposal=1)
    mission = Mission(problem(), ["area-1", "area-2"], []).tell(1.0, "clock")
    mission.tell(1.5, "proposal_accepted", offer=proposal, proposal=1)
    assert mission.routes == [["area-1", "area-3"], ["area-2"]]
    assert not mission.wants_plan


def test_of_planned_amounts_a_stop_goes_that_cannot_be_made_and_not_one_that_loses_its_load_to_it():
    of = problem(objective=Objective(distance_weight=0.01, unloading="planned"))
    mission = Mission(of, ["area-1", "area-2"], [])
    # It is worth more, needs all that is aboard, and cannot be reached in time.
    late = {"id": "area-2", "x": 4.0, "y": 1.0, "level": 9.0, "loadlist": [4.0], "deadline": 1.0}
    mission.tell(0.0, "areas_changed", targets=[late])
    assert mission.routes == [["area-1"], []]
    (broken,) = mission.effect["broken"]
    assert (broken["target_id"], broken["rule"], broken["needed"], broken["had"]) == (
        "area-2",
        "deadline",
        4,
        1,
    )
