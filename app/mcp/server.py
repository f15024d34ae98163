"""The tools: each is one or two operations of a running service, whose keys and limits count.

Annotations are evaluated here, since the SDK reads them: what a tool takes is made of the description.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Annotated, Any, cast

from mcp.server.mcpserver import Context, MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp.types import ToolAnnotations
from pydantic import WithJsonSchema

from app.client import AsyncClient, ClientError, __version__, types
from app.mcp.explanation import explanation
from app.mcp.schemas import body_of

INSTRUCTIONS = """\
Plans for swarms of UAVs that carry relief materials: which UAV flies where, with what. Begin with
`example_problem` to see what a problem is like. `allocate` finds a plan, `explain` says in words what it does
and why needs stay unmet, `evaluate` judges a plan of your own. A mission is a day that is flown: tell what
happens, and plans are proposed. Take `"algorithm": "auto"` with a `time_limit_s` unless another is asked for.
"""

_READS = ToolAnnotations(read_only_hint=True)
_ADDS = ToolAnnotations(read_only_hint=False, destructive_hint=False)
_DELETES = ToolAnnotations(read_only_hint=False, destructive_hint=True, idempotent_hint=True)
_REASONS_WITHIN_S = 30.0
_POLL_S = 0.2
_Tool = Callable[..., Awaitable[Any]]


def create_server(url: str, key: str | None, description: Mapping[str, Any]) -> MCPServer:
    """Put the server together.

    Parameters
    ----------
    url
        Of the service.
    key
        The API key of all calls; None: each call has its own, in the header ``Authorization`` of the request
        that it came with.
    description
        The service's, which says what tools take.
    """
    server: MCPServer = MCPServer(
        "uav-allocator", instructions=INSTRUCTIONS, version=__version__, log_level="WARNING"
    )
    Request = Annotated[dict[str, Any], WithJsonSchema(body_of(description, "/allocate"))]
    Plan = Annotated[dict[str, Any], WithJsonSchema(body_of(description, "/evaluate"))]
    Beginning = Annotated[dict[str, Any], WithJsonSchema(body_of(description, "/missions"))]
    events = "/missions/{mission_id}/events"
    Event = Annotated[dict[str, Any], WithJsonSchema(body_of(description, events))]

    @asynccontextmanager
    async def service(context: Context) -> AsyncIterator[AsyncClient]:
        """Open a client for one call; what the service refuses is told to the assistant in its words."""
        async with AsyncClient(url, key or _key_of(context)) as client:
            try:
                yield client
            except ClientError as error:
                raise ToolError(str(error)) from error

    async def example_problem(context: Context, name: str | None = None) -> dict[str, Any]:
        """Return an example problem by its name, or, without one, the names of all."""
        async with service(context) as client:
            if name is None:
                return {"examples": [each["name"] for each in await client.examples()]}
            return {**await client.example(name)}

    async def list_algorithms(context: Context) -> list[dict[str, Any]]:
        """List the algorithms with their parameters, and the fields of problems that they refuse."""
        async with service(context) as client:
            return [{**each} for each in await client.algorithms()]

    async def allocate(context: Context, request: Request) -> dict[str, Any]:
        """Find a plan: a problem, and how to solve it. The answer's `job_id` is for `explain`.

        A search that is called off ends.
        """
        async with service(context) as client:
            job = await client.submit(cast(types.Problem, request))
            try:
                async for event in client.follow(job["id"]):
                    best = event.data["best_reward"]
                    said = None if best is None else f"best reward {best:g}"
                    await context.report_progress(event.data["fraction"], 1.0, said)
                answer = await client.answer(job["id"])
            except asyncio.CancelledError:
                await asyncio.shield(client.cancel(job["id"]))
                raise
            return {name: value for name, value in answer.items() if name != "history"}

    async def evaluate(context: Context, request: Plan) -> dict[str, Any]:
        """Say what a plan of your own earns and does, or which rule each wrong action breaks.

        With `at` the answer has the problem that remains at that moment of the plan.
        """
        async with service(context) as client:
            return {**await client.evaluate(cast(types.Problem, request))}

    async def explain(context: Context, job_id: str) -> str:
        """Say in words what the plan of a job does and earns, and why needs stay unmet."""
        async with service(context) as client:
            answer, end = await client.answer(job_id), asyncio.get_running_loop().time() + _REASONS_WITHIN_S
            while answer.get("reasons") == "pending" and asyncio.get_running_loop().time() < end:
                await asyncio.sleep(_POLL_S)
                answer = await client.answer(job_id)
            if "routes" not in answer:
                raise ToolError(f"job {job_id} has no plan to explain")
            return explanation(answer)

    async def list_missions(context: Context) -> list[dict[str, Any]]:
        """List the missions, newest first."""
        async with service(context) as client:
            return [{**mission} async for mission in client.missions()]

    async def begin_mission(context: Context, request: Beginning) -> dict[str, Any]:
        """Begin a mission: a problem, and how plans are looked for while it is flown."""
        async with service(context) as client:
            options = dict(request)
            problem = options.pop("problem", {})
            return {**await client.begin_mission(problem, **cast(types.MissionOptions, options))}

    async def tell_mission(context: Context, mission_id: str, event: Event) -> dict[str, Any]:
        """Tell a mission what has happened; the answer says what that does to the plan in force.

        `proposal_accepted` and `proposal_refused` are events too.
        """
        async with service(context) as client:
            return {**await client.tell(mission_id, cast(types.Event, event))}

    async def look_at_mission(context: Context, mission_id: str, at: float | None = None) -> dict[str, Any]:
        """Return a mission as it stands: state, the rest of the plan in force, and plans that are proposed.

        With `at` state and plan are those of another moment of its clock.
        """
        async with service(context) as client:
            mission = dict(await client.mission(mission_id))
            moment = await client.mission_state(mission_id, at)
            proposals = await client.proposals(mission_id)
            mission["proposals"] = [each for each in proposals if each["status"] == "open"]
            return {**mission, "state": moment["state"], "plan": moment["plan"]}

    async def delete_mission(context: Context, mission_id: str) -> str:
        """Delete a mission with its history."""
        async with service(context) as client:
            await client.delete_mission(mission_id)
            return f"mission {mission_id} is deleted"

    reads: tuple[_Tool, ...] = (example_problem, list_algorithms, evaluate, explain, list_missions)
    adds: tuple[_Tool, ...] = (allocate, begin_mission, tell_mission)
    for tools, annotations in (
        ((*reads, look_at_mission), _READS),
        (adds, _ADDS),
        ((delete_mission,), _DELETES),
    ):
        for tool in tools:
            server.add_tool(tool, annotations=annotations)
    return server


def _key_of(context: Context) -> str | None:
    """Return the key that a call came with, of a transport that has headers."""
    scheme, _, token = (context.headers or {}).get("authorization", "").partition(" ")
    return token.strip() if scheme.lower() == "bearer" else None
