"""What Schemathesis has to know of this service: loaded by it, as `SCHEMATHESIS_HOOKS` names it.

It takes a 422 to a request that keeps to the schema for a defect, and a job that can be read after its
DELETE. Some rules no JSON Schema can say, and cancelled jobs stay readable by contract. A batch is taken
though one of its problems is refused, in a line of its own, which the answer then has to have. Nothing is
excused for its kind alone: for each refusal the rule is applied to the request again, here, and has to be
broken. Everything else is checked as it comes; `invalid-request` is never excused.
"""

import base64
import binascii
import json
import re
import sys
import zlib
from pathlib import Path

import httpx
import safetensors
import schemathesis
from schemathesis.core.failures import AcceptedNegativeData
from schemathesis.generation.meta import TestPhase
from schemathesis.openapi.checks import EnsureResourceAvailability, RejectedPositiveData, UseAfterFree

sys.path.append(str(Path(__file__).parents[2]))

from mission_rules import is_refused
from referee import Illegal, replay
from world_rules import breaks_rules_of_the_world, has_too_many_parts

from app.domain.errors import InvalidParameters
from app.domain.identifiers import fault_of
from app.solvers.registry import parse_parameters

LONGEST_S = 0.05
LARGEST_LIMIT_S = 604_800
SHORT_TRAINING = {"n_epochs": 3, "mode": "paper"}
LIMITED_BY_SIZE = {"dqn", "qmix", "transfer_qmix", "ga"}
"""Algorithms whose tables, buffers or populations have a limit that depends on several fields at once."""

OF_A_PROBLEM = re.compile(
    r"\b(uavs|targets|bases|objective|no_fly_zones|materials|wind|matrices|start_plan|max_steps|crs)\b"
)
ONE_IN = 8
"""Routes that take a problem check it by the same model. What its fields may be is tried in full at
`/allocate`, and one case of so many at each of the others."""

LARGEST = {"uavs": 40, "targets": 50, "no_fly_zones": 200}
"""Limits of the service in the tests, of what events add to."""

STREAM = "/missions/{mission_id}/stream"
"""It goes on as long as its mission is there, so only those of missions that are not are asked for."""

_keys_sent: set[str] = set()
_events_sent: set[tuple[str, str]] = set()


def breaks_rules(problem):
    """Say whether a problem breaks a rule between fields: materials, ids, degrees on the globe, the world."""
    groups = problem["uavs"], problem["targets"]
    if len({len(each["loadlist"]) for group in groups for each in group}) > 1:
        return True
    for target in problem["targets"]:
        asked = target.get("requested")
        if asked is not None and (
            len(asked) != len(target["loadlist"])
            or any(a < b for a, b in zip(asked, target["loadlist"], strict=True))
        ):
            return True
    for group, default in zip(groups, ("uav-", "area-"), strict=True):
        ids = [each.get("id") or f"{default}{number}" for number, each in enumerate(group, 1)]
        if len(set(ids)) < len(ids) or any(fault_of(each) is not None for each in ids):
            return True
    if breaks_rules_of_the_world(problem):
        return True
    points = [
        (each[x], each[y])
        for group in groups
        for each in group
        for x, y in (("x", "y"), ("x_s", "y_s"), ("x_c", "y_c"))
        if each.get(x) is not None and each.get(y) is not None
    ]
    return problem.get("crs") == "wgs84" and any(abs(x) > 180 or abs(y) > 90 for x, y in points)


def has_amounts_that_misfit(body):
    """Say whether an evaluation brings amounts that are not planned, or not of its plan's shape."""
    objective, m, k = body.get("objective") or {}, len(body["uavs"]), len(body["uavs"][0]["loadlist"])
    planned = {"delivered": objective.get("unloading") == "planned"}
    planned["loaded"] = objective.get("loading") == "planned" and bool(body.get("bases"))
    given = {name for name in planned if body.get(name) is not None}
    if any(not planned[name] for name in given) or (given and all(planned.values()) and len(given) < 2):
        return True
    for name in given:
        rows = body[name]
        plan = body.get("assignment") or ()
        if len(rows) != len(plan) or any(len(row) != m for row in rows):
            return True
        stops = [each for row in rows for each in row if each is not None]
        if any(len(each) != k or (name == "delivered" and min(each, default=0) < 0) for each in stops):
            return True
    return False


def is_illegal(problem, plan):
    """Say whether a plan breaks a rule of a problem, with the amounts that it brings."""
    nothing = [0.0] * len(problem["uavs"][0]["loadlist"])
    amounts = {
        name: [[each or nothing for each in row] for row in problem[name]]
        for name in ("delivered", "loaded")
        if problem.get(name) is not None
    }
    try:
        replay(problem, plan, **amounts)
    except Illegal:
        return True
    return False


def has_wrong_parameters(asked, default):
    """Say whether an algorithm refuses the parameters it is given; which there are depends on its name."""
    try:
        parse_parameters(asked.get("algorithm", default), asked.get("parameters", {}))
    except InvalidParameters:
        return True
    return False


def is_beyond_observation(problem, asked, default):
    """Say whether a problem has what the paper's learners, if one is asked for, do not observe."""
    papers = asked.get("algorithm", default) == "dqn" or asked.get("parameters", {}).get("mode") == "paper"
    objective = problem.get("objective") or {}
    unseen = [problem.get(name) for name in ("bases", "no_fly_zones", "matrices")]
    unseen += [objective.get(name) for name in ("half_life", "makespan_weight", "change_weight")]
    return papers and any(unseen)


def is_no_checkpoint(text):
    """Say whether a text in base64 is no safetensors file with the description of a checkpoint in it."""
    try:
        file = base64.b64decode(text, validate=True)
        safetensors.deserialize(file)
    except (binascii.Error, safetensors.SafetensorError):
        return True
    header = json.loads(file[8 : 8 + int.from_bytes(file[:8], "little")])
    return "checkpoint" not in header.get("__metadata__", {})


def breaks_rule_beyond_schemas(case, kind):
    """Say whether a request breaks the rule that it was refused for."""
    body = case.body
    if kind == "event-refused":
        return is_refused(body, _state_of(case), breaks_rules, LARGEST)
    if kind == "event-id-reused":
        return (case.path_parameters["mission_id"], body["id"]) in _events_sent
    problem = body if case.path in ("/allocate", "/evaluate") else body.get("task")
    asked, default = (body, "transfer_qmix") if case.path == "/allocate" else (body.get("train"), "qmix")
    if case.path == "/missions":
        problem, asked, default = _begun_with(body), body, "auto"
    if kind == "invalid-problem":
        rows = (body.get("assignment") or ()) if case.path == "/evaluate" else ()
        uneven = any(len(row) != len(body["uavs"]) for row in rows)
        # Texts that are drawn are no flight files; and there is one plan, not none and not two.
        if case.path == "/evaluate" and (body.get("flight_files") is not None or not rows):
            return True
        beyond = asked is not None and problem is not None and is_beyond_observation(problem, asked, default)
        misfit = case.path == "/evaluate" and has_amounts_that_misfit(body)
        return uneven or misfit or beyond or (problem is not None and breaks_rules(problem))
    if kind == "illegal-plan":
        return is_illegal(body, body["assignment"] if case.path == "/evaluate" else body["start_plan"])
    if kind == "invalid-parameters":
        return asked is not None and has_wrong_parameters(asked, default)
    if kind == "problem-too-large":
        limited = asked is not None and asked.get("algorithm", default) in LIMITED_BY_SIZE
        return limited or (problem is not None and has_too_many_parts(problem))
    if kind == "invalid-checkpoint":
        return "checkpoint" in body and is_no_checkpoint(body["checkpoint"])
    if kind == "idempotency-key-reused":
        return case.headers.get("Idempotency-Key") in _keys_sent
    return False


def _begun_with(body):
    """The problem of a mission, with what a change costs there."""
    problem = body["problem"]
    if body.get("change_weight") is None:
        return problem
    objective = problem.get("objective") or {}
    plan = problem.get("start_plan")
    nobody = [[len(problem["targets"])] * len(problem["uavs"])]
    changed = {
        "objective": {**objective, "change_weight": body["change_weight"]},
        "start_plan": plan or nobody,
    }
    return {**problem, **changed}


def _state_of(case):
    """The state of the mission that an event was told to."""
    mission = f"{case.operation.base_url.rstrip('/')}/missions/{case.path_parameters['mission_id']}"
    return httpx.get(mission, timeout=60).raise_for_status().json()["state"]


def refuses_in_its_line(response):
    """Say whether an answer to a batch refuses one of its problems: the others are answered beside it."""
    lines = map(json.loads, response.text.splitlines())
    return any(line.get("problem", {}).get("status") == 422 for line in lines)


@schemathesis.hook
def filter_case(ctx, case):
    """Keep a part of the cases for a problem's fields where another route has all of them."""
    if case.path == "/allocate" or case.meta is None or case.meta.phase.name != TestPhase.COVERAGE:
        return True
    said = case.meta.phase.data.description or ""
    return OF_A_PROBLEM.search(said) is None or zlib.crc32(f"{case.path} {said}".encode()) % ONE_IN == 0


@schemathesis.hook
def filter_failure(ctx, failure, case, response):
    """Keep every failure but refusals by a rule that was broken, and reading jobs that were cancelled."""
    if isinstance(failure, EnsureResourceAvailability) and case.path == STREAM:
        return False
    if isinstance(failure, AcceptedNegativeData) and case.path == "/allocate/batch":
        return not refuses_in_its_line(response)
    if isinstance(failure, RejectedPositiveData) and response.status_code == 422:
        return not breaks_rule_beyond_schemas(case, response.json()["type"].rpartition("#")[2])
    if isinstance(failure, UseAfterFree) and case.method == "GET" and case.path == "/jobs/{job_id}":
        return response.json()["status"] == "queued"
    return not (
        isinstance(failure, UseAfterFree)
        and case.method == "GET"
        and case.path in ("/jobs/{job_id}/events", "/jobs/{job_id}/plan")
    )


@schemathesis.hook
def after_call(ctx, case, response):
    """Remember the keys that requests came with."""
    if case.headers.get("Idempotency-Key"):
        _keys_sent.add(case.headers["Idempotency-Key"])
    told = case.method == "POST" and case.path == "/missions/{mission_id}/events"
    if told and response.status_code in (200, 201):
        _events_sent.add((case.path_parameters["mission_id"], case.body["id"]))


@schemathesis.hook
def before_call(ctx, case, kwargs):
    """Give work milliseconds that would take minutes; what is wrong with a body stays wrong."""
    if case.path == STREAM and re.fullmatch("[0-9a-f]{32}", case.path_parameters["mission_id"]):
        case.path_parameters = {"mission_id": "f" * 32}
    body = case.body
    if not isinstance(body, dict):
        return
    limited = ("/allocate", "/missions")
    if case.path in limited and is_long(body.get("time_limit_s", 1.0 if case.path == "/missions" else None)):
        case.body = {**body, "time_limit_s": LONGEST_S}
    problems = body.get("problems")
    if case.path == "/allocate/batch" and isinstance(problems, list):
        case.body = {
            **body,
            "problems": [
                {**each, "time_limit_s": LONGEST_S}
                if isinstance(each, dict) and is_long(each.get("time_limit_s"))
                else each
                for each in problems
            ],
        }
    train = body.get("train")
    if case.path == "/library" and isinstance(train, dict):
        parameters = train.get("parameters", {})
        if isinstance(parameters, dict):
            case.body = {**body, "train": {**train, "parameters": {**SHORT_TRAINING, **parameters}}}


def is_long(limit):
    """Say whether a time limit is none, or a valid one that is too long for a test."""
    number = isinstance(limit, int | float) and not isinstance(limit, bool)
    return limit is None or (number and LONGEST_S < limit <= LARGEST_LIMIT_S)
