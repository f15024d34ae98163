"""Missions: begin, tell what happens, look, listen."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing, suppress
from typing import Annotated, Any

from fastapi import APIRouter, Body, Query
from sse_starlette import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.access.guard import key_is_valid
from app.api.event_streams import LastEventId, event_stream, last_seen
from app.api.job_answers import idempotency
from app.api.json_body import JsonRoute
from app.api.mission_models import (
    MAX_NUMBER,
    Differences,
    EventAnswer,
    EventRequest,
    History,
    MissionAsItStands,
    MissionList,
    MissionModel,
    MissionRequest,
    PlanAnswer,
    ProposalList,
    ReplayModel,
    StateAtMoment,
)
from app.api.mission_payload import event_of, mission_answer, mission_of, proposal_answer
from app.api.openapi_examples import EVENT_EXAMPLES, MISSION_EXAMPLES
from app.api.problem_details import responses
from app.api.routes.parameters import LOCATION, Cursor, IdempotencyKey, MissionId
from app.api.services import Served
from app.domain.fields import MAX_MAGNITUDE
from app.jobs.stored_json import write
from app.missions.errors import MissionNotFound
from app.missions.service import MissionService

router = APIRouter(route_class=JsonRoute, prefix="/missions", tags=["missions"])

_EVENT = {
    "description": "One event",
    "type": "object",
    "properties": {
        "id": {"type": "string", "pattern": "^[0-9]+$", "description": "Its number, for `Last-Event-ID`"},
        "event": {"type": "string", "description": "Its type"},
        "data": {
            "type": "string",
            "contentMediaType": "application/json",
            "description": "As in `GET /missions/{mission_id}/events`",
        },
    },
    "required": ["id", "event", "data"],
}
_BODY_PROBLEMS = ("malformed-json", "body-too-large", "unsupported-media-type", "invalid-request")


@router.post(
    "",
    summary="Begin a mission",
    status_code=201,
    response_model=MissionModel,
    response_description="The mission; its first plan is being looked for",
    responses={
        200: {
            "model": MissionModel,
            "description": "The same, as it stands, of a mission that was begun with this key already",
            "headers": LOCATION,
        },
        201: {"headers": LOCATION},
        **responses(
            *_BODY_PROBLEMS,
            "idempotency-key-reused",
            "invalid-problem",
            "problem-too-large",
            "unknown-algorithm",
            "invalid-parameters",
            "illegal-plan",
            "mission-busy",
        ),
    },
)
async def begin_mission(
    body: Annotated[MissionRequest, Body(openapi_examples=MISSION_EXAMPLES)],
    services: Served,
    idempotency_key: IdempotencyKey = None,
) -> Response:
    """Begin a mission: a problem, and how it is planned while things happen.

    The `start_plan` of the problem is in force at first; without one nobody flies yet. A plan is looked for
    at once, and after each event that another plan may be better after. A retry with the same
    `Idempotency-Key` and request gets the mission that the first one began.
    """
    problem, planning = await run_in_threadpool(mission_of, body, services.settings)
    promise = idempotency(idempotency_key, "mission", body)
    mission, new = await services.missions.begin(body.name, problem, planning, promise)
    headers = {"Location": f"/missions/{mission.id}"}
    return _answer(mission_answer(mission), 201 if new else 200, headers)


@router.get(
    "",
    summary="List the missions",
    response_model=MissionList,
    responses=responses("invalid-request", "invalid-cursor"),
)
async def list_missions(
    services: Served,
    limit: Annotated[int, Query(ge=1, le=100, description="Missions a page")] = 20,
    cursor: Cursor = None,
) -> Response:
    """List the missions, newest first. New missions do not shift the pages that follow."""
    missions, following = await asyncio.to_thread(services.missions.store.page, limit, cursor)
    return _answer({"missions": [mission_answer(each) for each in missions], "next_cursor": following})


@router.get(
    "/{mission_id}",
    summary="Read a mission",
    response_model=MissionAsItStands,
    responses=responses("mission-not-found", "invalid-request"),
)
async def get_mission(mission_id: MissionId, services: Served) -> Response:
    """Return a mission as it stands: after its newest event, and where its UAVs were seen last."""
    head = await asyncio.to_thread(services.missions.store.head, mission_id)
    return _answer({**mission_answer(head.mission), "state": head.state, "positions": head.positions})


@router.delete(
    "/{mission_id}",
    summary="Delete a mission",
    status_code=204,
    response_description="It is no more",
    responses=responses("mission-not-found", "invalid-request"),
)
async def delete_mission(mission_id: MissionId, services: Served) -> Response:
    """Delete a mission with its history. Jobs that look for its plans end by themselves."""
    await services.missions.delete(mission_id)
    return Response(status_code=204)


@router.post(
    "/{mission_id}/events",
    summary="Tell what has happened",
    status_code=201,
    response_model=EventAnswer,
    response_description="The event, and what it did to the plan in force",
    responses={
        200: {"model": EventAnswer, "description": "The same, of an event that was known already"},
        **responses(
            *_BODY_PROBLEMS,
            "mission-not-found",
            "event-refused",
            "event-id-reused",
            "proposal-closed",
            "mission-busy",
        ),
    },
)
async def tell_mission_event(
    mission_id: MissionId,
    body: Annotated[EventRequest, Body(openapi_examples=EVENT_EXAMPLES)],
    services: Served,
) -> Response:
    """Tell what has happened; it is on disk with the state that it makes before this answers.

    A retry with the same `id` and the same event gets the first answer. Stops that cannot be made any more
    are dropped from the plan in force, which is legal after every event.
    """
    event, event_id, at, digest = event_of(body)
    entry, new = await services.missions.tell(mission_id, event, at, event_id=event_id, digest=digest)
    return _answer(entry.to_record(), 201 if new else 200)


@router.get(
    "/{mission_id}/events",
    summary="Read the history",
    response_model=History,
    responses=responses("mission-not-found", "invalid-request"),
)
async def list_mission_events(
    mission_id: MissionId,
    services: Served,
    after: Annotated[int, Query(ge=0, le=MAX_NUMBER, description="Only events with larger numbers")] = 0,
    limit: Annotated[int, Query(ge=1, le=1000, description="Events a page")] = 100,
) -> Response:
    """Return what happened, in the order in which it took effect."""
    entries = await asyncio.to_thread(services.missions.store.entries, mission_id, after, limit + 1)
    more = len(entries) > limit
    told = [entry.to_record() for entry in entries[:limit]]
    return _answer({"events": told, "next_after": told[-1]["number"] if more else None})


@router.get(
    "/{mission_id}/state",
    summary="Read a state",
    response_model=StateAtMoment,
    responses=responses("mission-not-found", "invalid-request", "mission-busy"),
)
async def get_mission_state(
    mission_id: MissionId,
    services: Served,
    at: Annotated[
        float | None,
        Query(
            ge=0, le=MAX_MAGNITUDE, allow_inf_nan=False, description="By the mission's clock; default: now"
        ),
    ] = None,
) -> Response:
    """Return the state at a moment: as it was known then, or, after the mission's clock, as it is planned."""
    number, found = await services.missions.look(mission_id, at)
    return _answer({"number": number, "state": found["state"], "plan": found["plan"]})


@router.get(
    "/{mission_id}/plan",
    summary="Read the plan in force",
    response_model=PlanAnswer,
    responses=responses("mission-not-found", "invalid-request"),
)
async def get_mission_plan(mission_id: MissionId, services: Served) -> Response:
    """Return the rest of the plan in force, with its times by the mission's clock."""
    head = await asyncio.to_thread(services.missions.store.head, mission_id)
    return _answer({"number": head.mission.state_number, "clock": head.mission.clock, **head.plan})


@router.get(
    "/{mission_id}/proposals",
    summary="Read the proposals",
    response_model=ProposalList,
    responses=responses("mission-not-found", "invalid-request"),
)
async def list_proposals(mission_id: MissionId, services: Served) -> Response:
    """Return all proposals; the events `proposal_accepted` and `proposal_refused` close them."""
    proposals = await asyncio.to_thread(services.missions.store.proposals, mission_id)
    return _answer({"proposals": [proposal_answer(each) for each in proposals]})


@router.get(
    "/{mission_id}/differences",
    summary="Compare two plans",
    response_model=Differences,
    responses=responses("mission-not-found", "invalid-request"),
)
async def compare_mission_plans(
    mission_id: MissionId,
    services: Served,
    before: Annotated[int, Query(ge=1, le=MAX_NUMBER, description="Number of an event")],
    after: Annotated[int, Query(ge=1, le=MAX_NUMBER, description="Number of another event")],
) -> Response:
    """Return how the plans differ that were in force after two events."""
    return _answer(await services.missions.differences(mission_id, before, after))


@router.get(
    "/{mission_id}/replay",
    summary="Read everything",
    response_model=ReplayModel,
    responses=responses("mission-not-found", "invalid-request"),
)
async def get_mission_replay(mission_id: MissionId, services: Served) -> Response:
    """Return all that is kept of a mission: each event with what it did and the state after it."""
    return await run_in_threadpool(_replay, services.missions, mission_id)


@router.get(
    "/{mission_id}/stream",
    summary="Listen to a mission",
    response_class=EventSourceResponse,
    responses={
        200: {
            "description": "Server-sent events: the history, then what happens",
            "content": {"text/event-stream": {"schema": _EVENT}},
        },
        **responses("mission-not-found", "invalid-request"),
    },
)
async def stream_mission(
    mission_id: MissionId,
    services: Served,
    last_event_id: LastEventId = None,
) -> Response:
    """Stream what happens, until the mission is deleted; a client that was cut off goes on where it was."""
    await asyncio.to_thread(services.missions.store.get, mission_id)
    after = min(last_seen(last_event_id), MAX_NUMBER)
    return event_stream(_events(services.missions, mission_id, after, key_is_valid.get()))


async def _events(
    missions: MissionService, mission_id: str, after: int, allowed: Callable[[], Awaitable[bool]] | None
) -> AsyncIterator[ServerSentEvent]:
    """Yield a mission's events until it is deleted, the server stops, or the client may not have them."""
    with suppress(MissionNotFound):
        async with aclosing(missions.listen(mission_id, after, allowed)) as events:
            async for event in events:
                yield ServerSentEvent(event.text, event=event.type, id=str(event.number))


def _replay(missions: MissionService, mission_id: str) -> Response:
    store = missions.store
    mission = store.get(mission_id)
    entries, states = store.entries(mission_id, 0, MAX_NUMBER), store.states(mission_id)
    told: list[dict[str, Any]] = [
        {**entry.to_record(), "state": states.get(entry.number)} for entry in entries
    ]
    proposals = [proposal_answer(each) for each in store.proposals(mission_id)]
    problem = store.problem(mission_id)
    return _answer(
        {"mission": mission_answer(mission), "problem": problem, "events": told, "proposals": proposals}
    )


def _answer(content: Any, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    """Answer with what was checked when it was made."""
    return Response(write(content), status, headers, media_type="application/json")
