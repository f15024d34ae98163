"""Jobs on the wire."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import Field

from app.api.allocation_models import AnswerModel
from app.api.problem_details import FieldError
from app.jobs.model import Job, JobPage, JobStatus


class ProgressModel(AnswerModel):
    """How far a job is, and the best it has found."""

    fraction: float = Field(description="Of the work, 0 to 1")
    epoch: int | None = Field(description="Epochs done, where the work has epochs")
    best_reward: float | None = Field(description="Reward of the best plan so far")
    assignment: list[list[int]] | None = Field(description="The best plan so far")


class JobErrorModel(AnswerModel):
    """Why a job failed."""

    type: str = Field(description="Stable name, as the `type` of a problem")
    detail: str = Field(description="What went wrong")
    errors: list[FieldError] = Field(description="Field by field, where that is known")
    details: dict[str, Any] = Field(description="Further facts, such as the `sizes` there are")


class JobSummary(AnswerModel):
    """A job without what it found."""

    id: str = Field(description="32 hexadecimal digits")
    kind: str = Field(description="allocate, batch (an allocation of one), train or register")
    status: JobStatus = Field(description="Where it is in its life")
    created_at: datetime = Field(description="When it was asked for, UTC")
    started_at: datetime | None = Field(description="When its newest attempt began, UTC")
    finished_at: datetime | None = Field(description="When it ended, UTC")
    progress: ProgressModel = Field(description="How far it is")
    error: JobErrorModel | None = Field(description="Why it failed, if it did")


class JobModel(JobSummary):
    """A job with what it found."""

    result: dict[str, Any] | None = Field(
        description="Of an allocation the answer of `POST /allocate`; a training's has `policy_id` too. "
        "A job that was cancelled in its midst has the best it had found."
    )


class JobList(AnswerModel):
    """A page of jobs."""

    jobs: list[JobSummary] = Field(description="Newest first")
    next_cursor: str | None = Field(description="`cursor` of the next page; null on the last")


def job_summary(job: Job) -> JobSummary:
    """Describe a job without its result."""
    return JobSummary(**_summary(job))


def job_model(job: Job) -> JobModel:
    """Describe a job with its result."""
    return JobModel(**_summary(job), result=result_of(job))


def job_list(page: JobPage) -> JobList:
    """Describe a page of jobs."""
    return JobList(jobs=[job_summary(job) for job in page.jobs], next_cursor=page.next_cursor)


def result_of(job: Job) -> dict[str, Any] | None:
    """Return a job's result with its id and how long it took, from its arrival to its end, in seconds."""
    if job.result is None or job.finished_at is None:
        return None
    elapsed = (job.finished_at - job.created_at).total_seconds()
    return {"job_id": job.id, **job.result, "elapsed_s": elapsed}


def _summary(job: Job) -> dict[str, Any]:
    error = job.error
    return {
        "id": job.id,
        "kind": job.kind,
        "status": job.status,
        "created_at": job.created_at,
        "started_at": job.started_at,
        "finished_at": job.finished_at,
        "progress": ProgressModel(**job.progress.as_json()),
        "error": None
        if error is None
        else JobErrorModel(
            type=error["code"],
            detail=error["detail"],
            errors=[FieldError(**violation) for violation in error["violations"]],
            details=error["details"],
        ),
    }
