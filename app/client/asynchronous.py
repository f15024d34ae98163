"""The client: every operation of the service as a method, with the types of its declarations."""

from __future__ import annotations

import json
from collections.abc import AsyncGenerator, Iterable, Mapping
from contextlib import aclosing
from typing import Any, Self, Unpack, cast

import httpx

from . import types
from .asynchronous_connection import AsyncConnection
from .errors import JobCancelled, JobFailed, StreamCutOff
from .event_stream import StreamEvent
from .exchange import Call, File, file_of, one_part

TIMEOUT_S = 60.0
RETRY_S = 30.0


class AsyncClient:
    """A client of one service; ``async with`` closes its connections.

    All methods raise :class:`~.errors.ServiceError` where the service refuses, and
    :class:`~.errors.ServiceUnreachable` where it does not answer.

    Parameters
    ----------
    url
        Of the service, such as ``http://127.0.0.1:8000``.
    key
        An API key, where the service needs one.
    timeout_s
        Seconds without a byte after which a connection counts as lost. Those who wait for a plan wait as
        long as the search takes.
    retry_s
        Seconds for which a request is sent again that found no service, or a busy one. Requests that change
        something are, where the service has not taken them in, or where they say who they are: by an
        ``idempotency_key``, or the id of an event.
    http
        In place of a client of its own: one of :mod:`httpx`, with a base URL, proxies, certificates.
    """

    def __init__(
        self,
        url: str = "",
        key: str | None = None,
        *,
        timeout_s: float = TIMEOUT_S,
        retry_s: float = RETRY_S,
        http: httpx.AsyncClient | None = None,
    ) -> None:
        http = http or httpx.AsyncClient(base_url=url)
        if key is not None:
            http.headers["Authorization"] = f"Bearer {key}"
        self._connection = AsyncConnection(http, timeout_s, retry_s)

    async def __aenter__(self) -> Self:
        """Return the client."""
        return self

    async def __aexit__(self, *error: object) -> None:
        """Close its connections."""
        await self.close()

    async def close(self) -> None:
        """Close its connections."""
        await self._connection.http.aclose()

    async def _get(self, path: str, **query: Any) -> Any:
        return (await self._connection.send(Call("GET", path, query, repeatable=True))).json()

    async def _pages(self, path: str, member: str, **query: Any) -> AsyncGenerator[Any]:
        cursor: str | None = None
        while True:
            page = await self._get(path, cursor=cursor, **query)
            for item in page[member]:
                yield item
            cursor = page["next_cursor"]
            if cursor is None:
                return

    # Allocations

    async def allocate(
        self,
        problem: types.Problem,
        *,
        idempotency_key: str | None = None,
        **options: Unpack[types.AllocationOptions],
    ) -> types.Allocation:
        """Find a plan, and wait for it.

        Parameters
        ----------
        problem
            The problem.
        idempotency_key
            Makes a retry safe; without one the search ends when the connection does.
        options
            How to solve it; they count before those that come with the problem.
        """
        call = _allocation({**problem, **options}, idempotency_key, waits=True)
        return cast(types.Allocation, (await self._connection.send(call)).json())

    async def submit(
        self,
        problem: types.Problem,
        *,
        idempotency_key: str | None = None,
        **options: Unpack[types.AllocationOptions],
    ) -> types.Job:
        """Have a plan found, and return the job at once; :meth:`follow` and :meth:`wait` tell of it."""
        call = _allocation({**problem, **options}, idempotency_key, waits=False)
        return cast(types.Job, (await self._connection.send(call)).json())

    async def evaluate(
        self,
        problem: types.Problem,
        assignment: list[list[int]] | None = None,
        **options: Unpack[types.EvaluationOptions],
    ) -> types.Evaluation:
        """Say what a plan of one's own earns and does.

        Parameters
        ----------
        problem
            The problem.
        assignment
            One joint action a step; None where ``flight_files`` of the options say the plan.
        options
            What is asked of it.
        """
        plan = {} if assignment is None else {"assignment": assignment}
        body = {**problem, **plan, **options}
        call = Call("POST", "/evaluate", body=body, repeatable=True, waits=True)
        return cast(types.Evaluation, (await self._connection.send(call)).json())

    async def allocate_many(
        self, problems: Iterable[types.BatchItem], *, idempotency_key: str | None = None
    ) -> AsyncGenerator[types.BatchLine]:
        """Find plans for many problems; a line each, as soon as it is solved.

        Raises
        ------
        StreamCutOff
            If the answer breaks off. With a key, the same call goes on where it was.
        """
        listed = list(problems)
        call = Call(
            "POST",
            "/allocate/batch",
            body={"problems": listed},
            headers={"Idempotency-Key": idempotency_key},
            repeatable=idempotency_key is not None,
            waits=True,
        )
        count = 0
        async with aclosing(self._connection.lines(call)) as lines:
            async for line in lines:
                count += 1
                yield json.loads(line)
        if count < len(listed):
            raise StreamCutOff(f"{count} of {len(listed)} problems were answered")

    async def algorithms(self) -> list[types.Algorithm]:
        """List the algorithms with their parameters."""
        return cast(list[types.Algorithm], (await self._get("/algorithms"))["algorithms"])

    async def examples(self) -> list[types.Example]:
        """List the example problems of the service."""
        return cast(list[types.Example], (await self._get("/examples"))["examples"])

    async def example(self, name: str) -> types.AllocationRequest:
        """Return an example problem."""
        return cast(types.AllocationRequest, await self._get(f"/examples/{one_part(name)}"))

    # Jobs

    async def jobs(self, status: types.JobStatus | None = None) -> AsyncGenerator[types.JobSummary]:
        """Yield the jobs, newest first, without plans and results."""
        async with aclosing(self._pages("/jobs", "jobs", status=status)) as jobs:
            async for job in jobs:
                yield job

    async def job(self, job_id: str) -> types.Job:
        """Return a job as it is now."""
        return cast(types.Job, await self._get(f"/jobs/{one_part(job_id)}"))

    async def follow(self, job_id: str, after: str | None = None) -> AsyncGenerator[StreamEvent]:
        """Yield the progress of a job until its end: events ``progress``, and one ``end``.

        Parameters
        ----------
        job_id
            The job.
        after
            Id of the last event that is known already.
        """
        async with aclosing(
            self._connection.events(f"/jobs/{one_part(job_id)}/events", "end", after)
        ) as events:
            async for event in events:
                yield event

    async def wait(self, job_id: str) -> types.Job:
        """Wait until a job has ended, however it does, and return it."""
        async with aclosing(self.follow(job_id)) as events:
            async for _ in events:
                pass
        return await self.job(job_id)

    async def answer(self, job_id: str) -> types.Allocation:
        """Wait until an allocation has ended, and return its answer.

        Raises
        ------
        JobFailed, JobCancelled
            If it ended without one.
        """
        job = await self.wait(job_id)
        if job["status"] == "failed":
            raise JobFailed(job)
        if job["result"] is None:
            raise JobCancelled(job)
        return cast(types.Allocation, job["result"])

    async def cancel(self, job_id: str) -> types.Job:
        """Cancel a job. One that runs stops soon, and the best plan so far becomes its result."""
        call = Call("DELETE", f"/jobs/{one_part(job_id)}", repeatable=True)
        return cast(types.Job, (await self._connection.send(call)).json())

    async def problem_of(self, job_id: str) -> types.Problem:
        """Return the problem that a job was given."""
        return cast(types.Problem, await self._get(f"/jobs/{one_part(job_id)}/problem"))

    async def export(
        self, job_id: str, format: types.PlanFormat, **choices: Unpack[types.PlanChoices]
    ) -> File:
        """Return the plan of an allocation as a file; several flight files come as a ZIP archive."""
        call = Call("GET", f"/jobs/{one_part(job_id)}/plan", {"format": format, **choices}, repeatable=True)
        return file_of(await self._connection.send(call))

    # Missions

    async def begin_mission(
        self,
        problem: types.Problem,
        *,
        idempotency_key: str | None = None,
        **options: Unpack[types.MissionOptions],
    ) -> types.Mission:
        """Begin a mission: a problem, and how it is planned while things happen.

        Parameters
        ----------
        problem
            The problem.
        idempotency_key
            Makes a retry safe: the same key and request give the mission that the first one began.
        options
            How it is planned.
        """
        call = Call(
            "POST",
            "/missions",
            body={"problem": problem, **options},
            headers={"Idempotency-Key": idempotency_key},
            repeatable=idempotency_key is not None,
        )
        return cast(types.Mission, (await self._connection.send(call)).json())

    async def missions(self) -> AsyncGenerator[types.Mission]:
        """Yield the missions, newest first."""
        async with aclosing(self._pages("/missions", "missions")) as missions:
            async for mission in missions:
                yield mission

    async def mission(self, mission_id: str) -> types.MissionAsItStands:
        """Return a mission as it stands."""
        return cast(types.MissionAsItStands, await self._get(f"/missions/{one_part(mission_id)}"))

    async def tell(self, mission_id: str, event: types.Event) -> types.EventAnswer:
        """Tell what has happened; return what it did to the plan in force."""
        call = Call("POST", f"/missions/{one_part(mission_id)}/events", body=event, repeatable=True)
        return cast(types.EventAnswer, (await self._connection.send(call)).json())

    async def history(self, mission_id: str, after: int = 0) -> AsyncGenerator[types.EventAnswer]:
        """Yield what has happened, in the order in which it took effect, from after an event's number."""
        following: int | None = after
        while following is not None:
            page = await self._get(f"/missions/{one_part(mission_id)}/events", after=following)
            for event in page["events"]:
                yield event
            following = page["next_after"]

    async def follow_mission(self, mission_id: str, after: str | None = None) -> AsyncGenerator[StreamEvent]:
        """Yield the history, then what happens, until the mission is deleted."""
        async with aclosing(
            self._connection.events(f"/missions/{one_part(mission_id)}/stream", None, after)
        ) as events:
            async for event in events:
                yield event

    async def mission_state(self, mission_id: str, at: float | None = None) -> types.StateAtMoment:
        """Return what remains at a moment: as it was known then, or as it is planned; default: now."""
        return cast(types.StateAtMoment, await self._get(f"/missions/{one_part(mission_id)}/state", at=at))

    async def mission_plan(self, mission_id: str) -> types.PlanAnswer:
        """Return the rest of the plan in force, with its times."""
        return cast(types.PlanAnswer, await self._get(f"/missions/{one_part(mission_id)}/plan"))

    async def proposals(self, mission_id: str) -> list[types.Proposal]:
        """Return the plans that were proposed, newest first."""
        found = await self._get(f"/missions/{one_part(mission_id)}/proposals")
        return cast(list[types.Proposal], found["proposals"])

    async def differences(self, mission_id: str, before: int, after: int) -> types.Differences:
        """Return how the plans in force after two events differ, by the events' numbers."""
        path = f"/missions/{one_part(mission_id)}/differences"
        return cast(types.Differences, await self._get(path, before=before, after=after))

    async def replay(self, mission_id: str) -> types.Replay:
        """Return all that is kept of a mission."""
        return cast(types.Replay, await self._get(f"/missions/{one_part(mission_id)}/replay"))

    async def delete_mission(self, mission_id: str) -> None:
        """Delete a mission with its history."""
        await self._connection.send(Call("DELETE", f"/missions/{one_part(mission_id)}"))

    # The library of policies

    async def register(
        self, registration: types.Registration, *, idempotency_key: str | None = None
    ) -> types.Policy | types.Job:
        """Register a source policy; of one that is trained first, return the job."""
        call = Call(
            "POST",
            "/library",
            body=registration,
            headers={"Idempotency-Key": idempotency_key},
            repeatable=idempotency_key is not None,
            waits=True,
        )
        return cast(types.Policy | types.Job, (await self._connection.send(call)).json())

    async def policies(self) -> AsyncGenerator[types.PolicySummary]:
        """Yield the source policies, newest first, without their tasks."""
        async with aclosing(self._pages("/library", "policies")) as policies:
            async for policy in policies:
                yield policy

    async def policy(self, policy_id: str) -> types.Policy:
        """Return a source policy with its task."""
        return cast(types.Policy, await self._get(f"/library/{one_part(policy_id)}"))

    async def checkpoint(self, policy_id: str) -> File:
        """Return the weights of a source policy, as safetensors."""
        path = f"/library/{one_part(policy_id)}/checkpoint"
        return file_of(await self._connection.send(Call("GET", path, repeatable=True)))

    async def similar(
        self, task: types.Problem, **options: Unpack[types.SimilarOptions]
    ) -> list[types.SimilarPolicy]:
        """Compare a task with the source tasks, nearest first."""
        call = Call("POST", "/library/similar", body={"task": task, **options}, repeatable=True)
        found = (await self._connection.send(call)).json()
        return cast(list[types.SimilarPolicy], found["similar"])

    async def delete_policy(self, policy_id: str) -> None:
        """Delete a source policy."""
        await self._connection.send(Call("DELETE", f"/library/{one_part(policy_id)}"))

    # The service itself

    async def health(self) -> types.Health:
        """Say that the service answers, and which version it is."""
        return cast(types.Health, await self._get("/healthz"))

    async def readiness(self) -> types.Readiness:
        """Say what the service is busy with; a :class:`~.errors.ServiceError` if it is not ready."""
        return cast(types.Readiness, (await self._connection.send(Call("GET", "/readyz"))).json())

    async def metrics(self) -> str:
        """Return the metrics in Prometheus' text format."""
        return (await self._connection.send(Call("GET", "/metrics", repeatable=True))).text

    async def description(self) -> dict[str, Any]:
        """Return the OpenAPI description of the service."""
        return cast(dict[str, Any], await self._get("/openapi.json"))


def _allocation(body: Mapping[str, Any], idempotency_key: str | None, *, waits: bool) -> Call:
    headers = {"Idempotency-Key": idempotency_key, "Prefer": None if waits else "respond-async"}
    repeatable = idempotency_key is not None
    return Call("POST", "/allocate", body=body, headers=headers, repeatable=repeatable, waits=waits)
