"""The client: every operation of the service as a method, with the types of its declarations.

Written by ``python -m app.api.published`` from ``asynchronous.py``.
"""

from __future__ import annotations

import json
from collections.abc import Generator, Iterable, Mapping
from contextlib import closing
from typing import Any, Self, Unpack, cast

import httpx

from . import types
from .connection import Connection
from .errors import JobCancelled, JobFailed, StreamCutOff
from .event_stream import StreamEvent
from .exchange import Call, File, file_of, one_part

TIMEOUT_S = 60.0
RETRY_S = 30.0


class Client:
    """A client of one service; ``with`` closes its connections.

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
        http: httpx.Client | None = None,
    ) -> None:
        http = http or httpx.Client(base_url=url)
        if key is not None:
            http.headers["Authorization"] = f"Bearer {key}"
        self._connection = Connection(http, timeout_s, retry_s)

    def __enter__(self) -> Self:
        """Return the client."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close its connections."""
        self.close()

    def close(self) -> None:
        """Close its connections."""
        self._connection.http.close()

    def _get(self, path: str, **query: Any) -> Any:
        return (self._connection.send(Call("GET", path, query, repeatable=True))).json()

    def _pages(self, path: str, member: str, **query: Any) -> Generator[Any]:
        cursor: str | None = None
        while True:
            page = self._get(path, cursor=cursor, **query)
            for item in page[member]:
                yield item
            cursor = page["next_cursor"]
            if cursor is None:
                return

    # Allocations

    def allocate(
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
        return cast(types.Allocation, (self._connection.send(call)).json())

    def submit(
        self,
        problem: types.Problem,
        *,
        idempotency_key: str | None = None,
        **options: Unpack[types.AllocationOptions],
    ) -> types.Job:
        """Have a plan found, and return the job at once; :meth:`follow` and :meth:`wait` tell of it."""
        call = _allocation({**problem, **options}, idempotency_key, waits=False)
        return cast(types.Job, (self._connection.send(call)).json())

    def evaluate(
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
        return cast(types.Evaluation, (self._connection.send(call)).json())

    def allocate_many(
        self, problems: Iterable[types.BatchItem], *, idempotency_key: str | None = None
    ) -> Generator[types.BatchLine]:
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
        with closing(self._connection.lines(call)) as lines:
            for line in lines:
                count += 1
                yield json.loads(line)
        if count < len(listed):
            raise StreamCutOff(f"{count} of {len(listed)} problems were answered")

    def algorithms(self) -> list[types.Algorithm]:
        """List the algorithms with their parameters."""
        return cast(list[types.Algorithm], (self._get("/algorithms"))["algorithms"])

    def examples(self) -> list[types.Example]:
        """List the example problems of the service."""
        return cast(list[types.Example], (self._get("/examples"))["examples"])

    def example(self, name: str) -> types.AllocationRequest:
        """Return an example problem."""
        return cast(types.AllocationRequest, self._get(f"/examples/{one_part(name)}"))

    # Jobs

    def jobs(self, status: types.JobStatus | None = None) -> Generator[types.JobSummary]:
        """Yield the jobs, newest first, without plans and results."""
        with closing(self._pages("/jobs", "jobs", status=status)) as jobs:
            for job in jobs:
                yield job

    def job(self, job_id: str) -> types.Job:
        """Return a job as it is now."""
        return cast(types.Job, self._get(f"/jobs/{one_part(job_id)}"))

    def follow(self, job_id: str, after: str | None = None) -> Generator[StreamEvent]:
        """Yield the progress of a job until its end: events ``progress``, and one ``end``.

        Parameters
        ----------
        job_id
            The job.
        after
            Id of the last event that is known already.
        """
        with closing(self._connection.events(f"/jobs/{one_part(job_id)}/events", "end", after)) as events:
            for event in events:
                yield event

    def wait(self, job_id: str) -> types.Job:
        """Wait until a job has ended, however it does, and return it."""
        with closing(self.follow(job_id)) as events:
            for _ in events:
                pass
        return self.job(job_id)

    def answer(self, job_id: str) -> types.Allocation:
        """Wait until an allocation has ended, and return its answer.

        Raises
        ------
        JobFailed, JobCancelled
            If it ended without one.
        """
        job = self.wait(job_id)
        if job["status"] == "failed":
            raise JobFailed(job)
        if job["result"] is None:
            raise JobCancelled(job)
        return cast(types.Allocation, job["result"])

    def cancel(self, job_id: str) -> types.Job:
        """Cancel a job. One that runs stops soon, and the best plan so far becomes its result."""
        call = Call("DELETE", f"/jobs/{one_part(job_id)}", repeatable=True)
        return cast(types.Job, (self._connection.send(call)).json())

    def problem_of(self, job_id: str) -> types.Problem:
        """Return the problem that a job was given."""
        return cast(types.Problem, self._get(f"/jobs/{one_part(job_id)}/problem"))

    def export(self, job_id: str, format: types.PlanFormat, **choices: Unpack[types.PlanChoices]) -> File:
        """Return the plan of an allocation as a file; several flight files come as a ZIP archive."""
        call = Call("GET", f"/jobs/{one_part(job_id)}/plan", {"format": format, **choices}, repeatable=True)
        return file_of(self._connection.send(call))

    # Missions

    def begin_mission(
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
        return cast(types.Mission, (self._connection.send(call)).json())

    def missions(self) -> Generator[types.Mission]:
        """Yield the missions, newest first."""
        with closing(self._pages("/missions", "missions")) as missions:
            for mission in missions:
                yield mission

    def mission(self, mission_id: str) -> types.MissionAsItStands:
        """Return a mission as it stands."""
        return cast(types.MissionAsItStands, self._get(f"/missions/{one_part(mission_id)}"))

    def tell(self, mission_id: str, event: types.Event) -> types.EventAnswer:
        """Tell what has happened; return what it did to the plan in force."""
        call = Call("POST", f"/missions/{one_part(mission_id)}/events", body=event, repeatable=True)
        return cast(types.EventAnswer, (self._connection.send(call)).json())

    def history(self, mission_id: str, after: int = 0) -> Generator[types.EventAnswer]:
        """Yield what has happened, in the order in which it took effect, from after an event's number."""
        following: int | None = after
        while following is not None:
            page = self._get(f"/missions/{one_part(mission_id)}/events", after=following)
            for event in page["events"]:
                yield event
            following = page["next_after"]

    def follow_mission(self, mission_id: str, after: str | None = None) -> Generator[StreamEvent]:
        """Yield the history, then what happens, until the mission is deleted."""
        with closing(
            self._connection.events(f"/missions/{one_part(mission_id)}/stream", None, after)
        ) as events:
            for event in events:
                yield event

    def mission_state(self, mission_id: str, at: float | None = None) -> types.StateAtMoment:
        """Return what remains at a moment: as it was known then, or as it is planned; default: now."""
        return cast(types.StateAtMoment, self._get(f"/missions/{one_part(mission_id)}/state", at=at))

    def mission_plan(self, mission_id: str) -> types.PlanAnswer:
        """Return the rest of the plan in force, with its times."""
        return cast(types.PlanAnswer, self._get(f"/missions/{one_part(mission_id)}/plan"))

    def proposals(self, mission_id: str) -> list[types.Proposal]:
        """Return the plans that were proposed, newest first."""
        found = self._get(f"/missions/{one_part(mission_id)}/proposals")
        return cast(list[types.Proposal], found["proposals"])

    def differences(self, mission_id: str, before: int, after: int) -> types.Differences:
        """Return how the plans in force after two events differ, by the events' numbers."""
        path = f"/missions/{one_part(mission_id)}/differences"
        return cast(types.Differences, self._get(path, before=before, after=after))

    def replay(self, mission_id: str) -> types.Replay:
        """Return all that is kept of a mission."""
        return cast(types.Replay, self._get(f"/missions/{one_part(mission_id)}/replay"))

    def delete_mission(self, mission_id: str) -> None:
        """Delete a mission with its history."""
        self._connection.send(Call("DELETE", f"/missions/{one_part(mission_id)}"))

    # The library of policies

    def register(
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
        return cast(types.Policy | types.Job, (self._connection.send(call)).json())

    def policies(self) -> Generator[types.PolicySummary]:
        """Yield the source policies, newest first, without their tasks."""
        with closing(self._pages("/library", "policies")) as policies:
            for policy in policies:
                yield policy

    def policy(self, policy_id: str) -> types.Policy:
        """Return a source policy with its task."""
        return cast(types.Policy, self._get(f"/library/{one_part(policy_id)}"))

    def checkpoint(self, policy_id: str) -> File:
        """Return the weights of a source policy, as safetensors."""
        path = f"/library/{one_part(policy_id)}/checkpoint"
        return file_of(self._connection.send(Call("GET", path, repeatable=True)))

    def similar(
        self, task: types.Problem, **options: Unpack[types.SimilarOptions]
    ) -> list[types.SimilarPolicy]:
        """Compare a task with the source tasks, nearest first."""
        call = Call("POST", "/library/similar", body={"task": task, **options}, repeatable=True)
        found = (self._connection.send(call)).json()
        return cast(list[types.SimilarPolicy], found["similar"])

    def delete_policy(self, policy_id: str) -> None:
        """Delete a source policy."""
        self._connection.send(Call("DELETE", f"/library/{one_part(policy_id)}"))

    # The service itself

    def health(self) -> types.Health:
        """Say that the service answers, and which version it is."""
        return cast(types.Health, self._get("/healthz"))

    def readiness(self) -> types.Readiness:
        """Say what the service is busy with; a :class:`~.errors.ServiceError` if it is not ready."""
        return cast(types.Readiness, (self._connection.send(Call("GET", "/readyz"))).json())

    def metrics(self) -> str:
        """Return the metrics in Prometheus' text format."""
        return (self._connection.send(Call("GET", "/metrics", repeatable=True))).text

    def description(self) -> dict[str, Any]:
        """Return the OpenAPI description of the service."""
        return cast(dict[str, Any], self._get("/openapi.json"))


def _allocation(body: Mapping[str, Any], idempotency_key: str | None, *, waits: bool) -> Call:
    headers = {"Idempotency-Key": idempotency_key, "Prefer": None if waits else "respond-async"}
    repeatable = idempotency_key is not None
    return Call("POST", "/allocate", body=body, headers=headers, repeatable=repeatable, waits=waits)
