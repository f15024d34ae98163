"""Jobs on the wire."""

from __future__ import annotations

import json
from datetime import datetime
from typing import Any

from pydantic import Field
from starlette.responses import Response

from app.api.allocation_models import AnswerModel
from app.api.problem_details import FieldError, Worded
from app.api.problem_models import ProblemModel
from app.api.problem_types import title_of, type_of
from app.domain.said import from_record
from app.jobs import model
from app.jobs.model import Job, JobPage, JobStatus
from app.jobs.stored_json import write


class ProgressSummary(AnswerModel):
    """How far a job is."""

    fraction: float = Field(description="Of the work, 0 to 1")
    epoch: int | None = Field(description="Epochs done, where the work has epochs")
    best_reward: float | None = Field(description="Reward of the best plan so far")


class ProgressModel(ProgressSummary):
    """How far a job is, and the best it has found."""

    assignment: list[list[int]] | None = Field(description="The best plan so far")
    answered_by: str | None = Field(default=None, description="The algorithm that found it")


class JobErrorModel(AnswerModel, Worded):
    """Why a job failed."""

    type: str = Field(
        description="Stable name, as the `type` of a problem", examples=[type_of("worker-lost")]
    )
    title: str = Field(description="What the type means, for people")
    detail: str = Field(description="What went wrong")
    errors: list[FieldError] = Field(description="Field by field, where that is known")
    details: dict[str, Any] = Field(description="Further facts, such as the `sizes` there are")


class _JobFields(AnswerModel):
    id: str = Field(description="32 hexadecimal digits")
    kind: str = Field(
        description="allocate, evaluate, batch (an allocation of one), train, register or replan (of a "
        "mission)"
    )
    status: JobStatus = Field(description="Where it is in its life")
    created_at: datetime = Field(description="When it was asked for, UTC")
    started_at: datetime | None = Field(description="When its newest attempt began, UTC")
    finished_at: datetime | None = Field(description="When it ended, UTC")
    error: JobErrorModel | None = Field(description="Why it failed, if it did")


class JobSummary(_JobFields):
    """A job without what it found."""

    progress: ProgressSummary = Field(description="How far it is")


class JobModel(_JobFields):
    """A job with what it found."""

    progress: ProgressModel = Field(description="How far it is")
    result: dict[str, Any] | None = Field(
        description="Of an allocation the answer of `POST /allocate`; a training's has `policy_id` too. "
        "A job that was cancelled in its midst has the best it had found."
    )


class JobList(AnswerModel):
    """A page of jobs."""

    jobs: list[JobSummary] = Field(description="Newest first")
    next_cursor: str | None = Field(description="`cursor` of the next page; null on the last")


def job_response(
    job: model.JobSummary, result: str | None, status: int = 200, headers: dict[str, str] | None = None
) -> Response:
    """Answer with a job and its result, which is JSON and goes out as it is stored, however large it is."""
    progress = ProgressModel(**job.progress.as_json())
    described = JobModel(**_fields(job), progress=progress, result=None).model_dump_json(exclude={"result"})
    if result is not None and (elapsed_s := _elapsed_s(job)) is not None:
        first, last = {"job_id": job.id}, {"elapsed_s": elapsed_s}
        result = _joined(json.dumps(first), result, json.dumps(last))
    whole = _joined(described, f'{{"result":{result or "null"}}}')
    return Response(whole, status, headers, media_type="application/json")


def job_list(page: JobPage) -> JobList:
    """Describe a page of jobs."""
    jobs = []
    for job in page.jobs:
        known = job.progress
        progress = ProgressSummary(fraction=known.fraction, epoch=known.epoch, best_reward=known.best_reward)
        jobs.append(JobSummary(**_fields(job), progress=progress))
    return JobList(jobs=jobs, next_cursor=page.next_cursor)


def problem_of(job: Job) -> ProblemModel:
    """Return the problem that a job is about; a UAV that is where it started has no position of its own."""
    record = job.payload["problem"]
    uavs = [
        {**uav, "x_c": None, "y_c": None} if (uav["x_c"], uav["y_c"]) == (uav["x_s"], uav["y_s"]) else uav
        for uav in record["uavs"]
    ]
    return ProblemModel.model_validate({**record, "uavs": uavs})


def written_result_of(job: Job) -> str | None:
    """Return the same as JSON, as it was written."""
    elapsed_s = _elapsed_s(job)
    if job.result is None or elapsed_s is None:
        return None
    return _joined(json.dumps({"job_id": job.id}), write(job.result), json.dumps({"elapsed_s": elapsed_s}))


def result_of(job: Job) -> dict[str, Any] | None:
    """Return a job's result with its id and how long it took, from its arrival to its end, in seconds."""
    elapsed_s = _elapsed_s(job)
    if job.result is None or elapsed_s is None:
        return None
    return {"job_id": job.id, **job.result, "elapsed_s": elapsed_s}


def _elapsed_s(job: model.JobSummary) -> float | None:
    return None if job.finished_at is None else (job.finished_at - job.created_at).total_seconds()


def _joined(*objects: str) -> str:
    """Return the JSON object that has the members of all of these, in their order."""
    members = (text.strip()[1:-1] for text in objects)
    return f"{{{','.join(each for each in members if each.strip())}}}"


def _fields(job: model.JobSummary) -> dict[str, Any]:
    error = job.error
    return {
        "id": job.id,
        "kind": job.kind,
        "status": job.status,
        "created_at": job.created_at,
        "started_at": job.started_at,
        "finished_at": job.finished_at,
        "error": None
        if error is None
        else JobErrorModel(
            type=type_of(error["code"]),
            title=title_of(error["code"]),
            detail=from_record(error),
            errors=[FieldError(**violation) for violation in error["violations"]],
            details=error["details"],
        ),
    }
