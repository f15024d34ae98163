"""Whether a mission refuses an event that keeps to the schema: rules that depend on its state."""

from __future__ import annotations

TOLERANCE = 1e-6


def is_refused(event, state, breaks_rules, limits):
    """Say whether an event breaks a rule of a mission.

    Parameters
    ----------
    event
        As it was sent.
    state
        Of the mission, as it is answered.
    breaks_rules
        Says whether a problem breaks a rule between fields.
    limits
        How many UAVs, targets and no-fly zones are taken.
    """
    problem, at = state["problem"], event.get("at")
    if at is not None and at < state["clock"]:
        return True
    uavs = {uav["id"]: uav for uav in problem["uavs"] if uav["id"] not in state["lost"]}
    targets = {target["id"] for target in problem["targets"]}
    bases = {base["id"] for base in problem.get("bases") or ()}
    for name, known in (("uav_id", uavs), ("target_id", targets), ("base_id", bases)):
        if name in event and event[name] not in known:
            return True
    if "proposal" in event:
        return True  # no number is known before a search has ended
    if event.get("target_id") in state["cancelled"]:
        return True
    if event.get("time") is not None and event["time"] > (state["clock"] if at is None else at):
        return True
    if event["type"] == "telemetry":
        globe = problem["crs"] == "wgs84"
        return any(
            each["uav_id"] not in {uav["id"] for uav in problem["uavs"]}
            or each.get("location") is not None
            or (globe and (abs(each["x"]) > 180 or abs(each["y"]) > 90))
            for each in event["positions"]
        )
    if event["type"] == "uav_delayed":
        return event["until"] <= (state["clock"] if at is None else at)
    amounts = [event[name] for name in ("delivered", "loadlist", "stock") if event.get(name) is not None]
    if any(len(each) != len(problem["uavs"][0]["loadlist"]) for each in amounts):
        return True
    if event["type"] in ("visit_done", "reload_done"):
        uav = uavs[event["uav_id"]]
        given = event.get("delivered") or event["loadlist"]
        return uav.get("capacity") is not None or any(
            amount > have * (1 + TOLERANCE) for amount, have in zip(given, uav["loadlist"], strict=True)
        )
    return _makes_another_problem_that_is_refused(event, problem, targets, breaks_rules, limits)


def _makes_another_problem_that_is_refused(event, problem, targets, breaks_rules, limits):
    """Say the same of an event that puts items into the problem."""
    plain = {**problem, "start_plan": None}
    match event["type"]:
        case "uavs_added":
            now = {**plain, "uavs": [*problem["uavs"], *_named(event["uavs"], "uav")]}
        case "areas_added":
            now = {**plain, "targets": [*problem["targets"], *_named(event["targets"], "area")]}
        case "areas_changed":
            changed = {each["id"]: each for each in _named(event["targets"], "area")}
            if not changed.keys() <= targets:
                return True
            now = {**plain, "targets": [changed.get(each["id"], each) for each in problem["targets"]]}
        case "zones_changed":
            now = {**plain, "no_fly_zones": event["no_fly_zones"]}
        case "wind_changed":
            now = {**plain, "wind": event.get("wind")}
        case _:
            return False
    return breaks_rules(now) or any(len(now.get(name) or ()) > most for name, most in limits.items())


def _named(items, stem):
    return [{**each, "id": each.get("id") or f"{stem}-{place}"} for place, each in enumerate(items, 1)]
