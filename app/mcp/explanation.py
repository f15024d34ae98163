"""An answer in words: who flies where, what it earns, what stays unmet and why."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.client.types import Allocation, Evaluation, Reload, Route, Stop, Unmet


def explanation(answer: Allocation | Evaluation) -> str:
    """Tell what a plan does and why it is as it is.

    Parameters
    ----------
    answer
        Of an allocation or an evaluation.
    """
    return "\n".join(_lines(answer))


def _lines(answer: Allocation | Evaluation) -> Iterator[str]:
    asked, found = answer.get("algorithm"), answer.get("answered_by")
    whose = f", the plan of {found}" if found != asked else ""
    yield f"Plan of job {answer['job_id']}" + (f", asked of {asked}{whose}" if asked else "")
    yield (
        f"Reward {answer['reward']:g}: satisfaction {answer['satisfaction']:g}, "
        f"distance {answer['distance']:g} at {answer['distance_weight']:g} each"
    )
    bound, gap = answer.get("bound"), answer.get("gap")
    if bound is not None:
        within = "" if gap is None else f"; this one falls short of that by at most {gap:.2%}"
        yield f"No plan earns more than {bound:g}{within}"
    yield "Routes:"
    yield from (f"- {_route(route)}" for route in answer["routes"])
    yield "Unmet needs:" if answer["unmet"] else "All needs are met."
    yield from (f"- {_unmet(need)}" for need in answer["unmet"])
    if answer.get("reasons", "complete") != "complete":
        yield f"The reasons are {answer['reasons']}."
    for warning in answer.get("warnings", ()):
        yield f"Warning, {warning['pointer']}: {warning['detail']}"


def _route(route: Route) -> str:
    if not route["stops"]:
        return f"{route['uav_id']} stays"
    stops = ", ".join(map(_stop, route["stops"]))
    return f"{route['uav_id']}: {stops}; distance {route['distance']:g}, home {route['return_distance']:g}"


def _stop(stop: Stop | Reload) -> str:
    if "target_id" in stop:
        return f"{stop['target_id']} at {stop['arrival_time']:g} ({_amounts(stop['delivered'])} unloaded)"
    return f"base {stop['base_id']} at {stop['arrival_time']:g} ({_amounts(stop['loaded'])} loaded)"


def _unmet(need: Unmet) -> str:
    said = f"{need['target_id']}, {_amounts(need['remaining'])} missing ({need['code']}): {need['reason']}"
    if remedy := need.get("remedy"):
        said += f". Remedy: {remedy}"
    change = need.get("reward_change")
    return said if change is None else f"{said}. The reward would change by {change:g}"


def _amounts(amounts: Sequence[float]) -> str:
    return " + ".join(f"{amount:g}" for amount in amounts)
