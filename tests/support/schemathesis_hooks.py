"""What Schemathesis has to know of this service: loaded by it, as `SCHEMATHESIS_HOOKS` names it.

Two things no JSON Schema can say, and one that keeps a run short. Everything else is checked as it comes.
"""

import schemathesis
from schemathesis.openapi.checks import RejectedPositiveData, UseAfterFree

BEYOND_SCHEMAS = {
    "invalid-problem",  # as many amounts as there are materials, ids that are unique, degrees on the globe
    "problem-too-large",  # the operator's limits
    "invalid-parameters",  # which there are depends on the algorithm
    "invalid-checkpoint",  # base64 of what is no checkpoint
    "idempotency-key-reused",  # with another body
}
"""Problem types that may answer a request which keeps to the schema; `invalid-request` never may."""

LONGEST_S = 0.05
LARGEST_LIMIT_S = 604_800
SHORT_TRAINING = {"n_epochs": 3, "mode": "paper"}


@schemathesis.hook
def filter_failure(ctx, failure, case, response):
    """Keep every failure but those of rules between fields, and of cancelled jobs, which stay readable."""
    if isinstance(failure, RejectedPositiveData) and response.status_code == 422:
        return response.json()["type"] not in BEYOND_SCHEMAS
    return not (isinstance(failure, UseAfterFree) and case.path.startswith("/jobs/{job_id}"))


@schemathesis.hook
def before_call(ctx, case, kwargs):
    """Give work milliseconds that would take minutes; what is wrong with a body stays wrong."""
    body = case.body
    if not isinstance(body, dict):
        return
    if case.path == "/allocate" and is_long(body.get("time_limit_s")):
        case.body = {**body, "time_limit_s": LONGEST_S}
    train = body.get("train")
    if case.path == "/library" and isinstance(train, dict):
        parameters = train.get("parameters", {})
        if isinstance(parameters, dict):
            case.body = {**body, "train": {**train, "parameters": {**SHORT_TRAINING, **parameters}}}


def is_long(limit):
    """Say whether a time limit is none, or a valid one that is too long for a test."""
    number = isinstance(limit, int | float) and not isinstance(limit, bool)
    return limit is None or (number and LONGEST_S < limit <= LARGEST_LIMIT_S)
