"""The one table of problem types: status, what it means, and what to do about it.

The domain, the jobs and the store raise errors that know no HTTP, by these names. One that is not in the
table is a defect.
"""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from typing import NamedTuple

ERROR_PAGE = "/docs/errors"
"""Where the table is shown, with an anchor for each type."""

DEFECT = "internal-error"


class ProblemType(NamedTuple):
    """A type of problem.

    Attributes
    ----------
    status
        Of the responses that have it.
    meaning
        What has caused it, for people.
    remedy
        What to do about it, for people.
    """

    status: int
    meaning: str
    remedy: str


PROBLEM_TYPES: Mapping[str, ProblemType] = {
    # the request itself
    "malformed-json": ProblemType(
        400,
        "The body is not JSON in UTF-8, or has a name twice in one object",
        "Write the body with a JSON library, in UTF-8; `detail` has line and column of what is wrong",
    ),
    "bad-request": ProblemType(
        400,
        "The request is not HTTP as it should be",
        "Look at what stands between client and service: a request line or a header is broken",
    ),
    "unauthenticated": ProblemType(
        401,
        "An API key is needed, or the one that was sent is unknown or revoked",
        "Send `Authorization: Bearer KEY`; the operator makes keys with `python -m app keys create`",
    ),
    "forbidden": ProblemType(
        403,
        "The API key has not the role that this needs",
        "Ask the operator for a key of the role `library`",
    ),
    "host-not-allowed": ProblemType(
        421,
        "The header Host does not name this service",
        "Call the service by its own name, or have the operator add the name to `ALLOCATOR_ALLOWED_HOSTS`",
    ),
    "not-found": ProblemType(
        404,
        "There is nothing at this path",
        "Compare the path with those at `/docs`",
    ),
    "method-not-allowed": ProblemType(
        405,
        "This path has other methods, which Allow lists",
        "Use one of the methods in `Allow`",
    ),
    "request-timeout": ProblemType(
        408,
        "The request was not received in time",
        "Send it again over a quicker connection; the operator sets how long a request may take",
    ),
    "body-too-large": ProblemType(
        413,
        "The body has more bytes than the operator takes",
        "Send less, or have the operator raise `ALLOCATOR_MAX_BODY_BYTES`; `limit` has what is taken",
    ),
    "unsupported-media-type": ProblemType(
        415,
        "The body is not sent as plain application/json",
        "Send `Content-Type: application/json`, and no `Content-Encoding`",
    ),
    "invalid-request": ProblemType(
        422,
        "Fields or parameters are missing, unknown, of another type or out of range",
        "Correct every field in `errors`; `/docs` has the fields with their limits",
    ),
    "invalid-cursor": ProblemType(
        422,
        "No page has given this cursor out",
        "Begin again without `cursor`, and send each `next_cursor` as it came",
    ),
    # app.domain.errors
    "invalid-problem": ProblemType(
        422,
        "The problem breaks a rule between its fields, or has one that the algorithm refuses",
        "Correct every field in `errors`, or take an algorithm that takes the field: `GET /algorithms`",
    ),
    "illegal-plan": ProblemType(
        422,
        "The plan that was sent breaks a rule of the problem",
        "Change the actions in `errors` and `breaches`, each with the rule, what it needs and what there is",
    ),
    "unknown-algorithm": ProblemType(
        422,
        "No algorithm has this name",
        "Take one of `algorithms`",
    ),
    "invalid-parameters": ProblemType(
        422,
        "The algorithm has no such parameters, or not with these values",
        "Correct every parameter in `errors`; `GET /algorithms` has their schemas",
    ),
    "problem-too-large": ProblemType(
        422,
        "The problem is larger than the operator or the algorithm takes",
        "Cut the problem into parts, take an algorithm without that limit, or have the operator raise it",
    ),
    "batch-too-large": ProblemType(
        422,
        "The batch has more problems than the operator takes",
        "Send several batches of at most `limit` problems",
    ),
    "invalid-checkpoint": ProblemType(
        422,
        "The checkpoint is not exactly what its architecture needs",
        "Export the weights again; `errors` says which tensor is missing, misshapen or not finite",
    ),
    "no-compatible-source": ProblemType(
        409,
        "The library has no policy that fits; `sizes` has the sizes there are",
        "Take a size in `sizes`, register a policy for yours, or leave `mode` at `service`",
    ),
    # app.jobs.errors and what a job can end with
    "job-not-found": ProblemType(
        404,
        "No job has this id; ended ones are deleted after a time",
        "Send the request again; results are kept for `ALLOCATOR_JOB_RETENTION_DAYS`",
    ),
    "idempotency-key-reused": ProblemType(
        422,
        "The Idempotency-Key came with another request before",
        "Take a new key for every new request, and the old one with the very same body only",
    ),
    "job-cancelled": ProblemType(
        409,
        "The job was cancelled before it had a plan",
        "Send the request again, if the plan is still wanted",
    ),
    "job-without-checkpoint": ProblemType(
        409,
        "The job has learned nothing that could be registered",
        "Name a job that learns and has ended; an allocation has to ask for `keep_checkpoint`",
    ),
    # app.api.plan_formats
    "uav-not-found": ProblemType(
        404,
        "No UAV of the plan has this id",
        "Take an id of the plan's `routes`",
    ),
    "no-plan": ProblemType(
        409,
        "The job has no plan, or not yet",
        "Wait for the end of the job, or name one of an allocation or an evaluation",
    ),
    "nothing-to-fly": ProblemType(
        409,
        "The UAV, or all of them, stay where they are",
        "Leave `uav` out, or look in `unmet` for why nobody flies",
    ),
    "plan-not-geographic": ProblemType(
        409,
        "Flight files need a problem with crs wgs84",
        "Send longitudes and latitudes with `crs: wgs84`, or take the plan as `geojson` or `csv`",
    ),
    "plan-out-of-range": ProblemType(
        409,
        "A flight file cannot hold the plan, or the UAV not fly it as asked",
        "Change what `errors` names: the choice, or the problem, and plan again",
    ),
    # app.missions.errors
    "mission-not-found": ProblemType(
        404,
        "No mission has this id",
        "Look for it in `GET /missions`; it may have been deleted",
    ),
    "event-refused": ProblemType(
        422,
        "The event is about something unknown, from the past, or impossible",
        "Correct every field in `errors`; `GET /missions/{id}` has the clock, the UAVs and the areas",
    ),
    "event-id-reused": ProblemType(
        422,
        "The id of the event came with another event before",
        "Take a new id for every event, and the old one with the very same event only",
    ),
    "proposal-closed": ProblemType(
        409,
        "The proposal was accepted, refused or outdated before, or fits no more",
        "Read `GET /missions/{id}/proposals` and accept one that is open",
    ),
    "mission-busy": ProblemType(
        503,
        "What works out missions does not answer, or others change the mission all the time",
        "Send the same event again after a moment: with its id it counts once",
    ),
    # the service as a whole
    "queue-full": ProblemType(
        429,
        "As many jobs wait as may; Retry-After says when to come back",
        "Send it again after `Retry-After` seconds",
    ),
    "draining": ProblemType(
        503,
        "The service is stopping",
        "Send it again after `Retry-After` seconds, with the same `Idempotency-Key`",
    ),
    "not-ready": ProblemType(
        503,
        "The database or the workers do not answer yet",
        "Wait until `GET /readyz` answers 200",
    ),
    "time-limit-exceeded": ProblemType(
        504,
        "No plan was there when the time was up",
        "Allow more time",
    ),
    "store-unavailable": ProblemType(
        503,
        "The database does not answer",
        "Send it again after `Retry-After` seconds, with the same `Idempotency-Key`",
    ),
    # policy_store.errors
    "policy-not-found": ProblemType(
        404,
        "The library has no policy with this id",
        "Look for it in `GET /library`; it may have been deleted",
    ),
    "duplicate-policy": ProblemType(
        409,
        "Another policy has this id",
        "Delete the other one first",
    ),
    "invalid-policy": ProblemType(
        422,
        "A field of the policy cannot be stored",
        "Shorten or correct the field that `detail` names",
    ),
    "damaged-checkpoint": ProblemType(
        500,
        "The stored weights are not those that were registered",
        "Have the operator bring the database back from a backup, or register the policy again",
    ),
    # defects, and jobs that nobody could do
    "internal-error": ProblemType(
        500,
        "The service has a defect, or its machine is in trouble",
        "Report it with its `X-Request-ID`, under which the service's log has more",
    ),
    "worker-lost": ProblemType(
        500,
        "The worker of the job, or its server, died in each attempt; what failed jobs have, not answers",
        "Send it again; if it happens again, have the operator look whether the machine runs out of memory",
    ),
    "unknown-job-kind": ProblemType(
        500,
        "Another version of the service took the job in; what failed jobs have, not answers",
        "Send the request again to the service as it is now",
    ),
}


def title_of(code: str) -> str:
    """Return what an error code means, for people; what a defect means for one that is not in the table."""
    return PROBLEM_TYPES.get(code, PROBLEM_TYPES[DEFECT]).meaning


def status_of(code: str) -> HTTPStatus:
    """Give an error code its status; 500 for one that is not in the table."""
    return HTTPStatus(PROBLEM_TYPES.get(code, PROBLEM_TYPES[DEFECT]).status)


def type_of(code: str) -> str:
    """Return the ``type`` of an error on the wire, which leads to its row on the page."""
    return f"{ERROR_PAGE}#{code}"
