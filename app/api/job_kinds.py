"""The kinds of job there are, and how trained policies come into the library with the end of their job."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection

from app.domain.errors import InvalidCheckpoint
from app.domain.records import problem_from_record
from app.domain.said import said
from app.jobs.model import FollowUp, Job, JobKind, WorkResult
from app.library.entries import new_policy
from app.missions.planner import REPLAN
from app.missions.store import MissionStore
from policy_store.checkpoint import ContainerLimits
from policy_store.library import PolicyLibrary

ALLOCATE = "allocate"
BATCH = "batch"
EVALUATE = "evaluate"
TRAIN = "train"
REGISTER = "register"

_REASONS = FollowUp("app.allocation.tasks:complete_reasons", {"reasons": "incomplete"})


def _effort(payload: Mapping[str, Any]) -> float:
    """Return how much larger than a small one an allocation is, to read, to plan greedily and to write."""
    problem = payload["problem"]
    m, n, k = len(problem["uavs"]), len(problem["targets"]), len(problem["uavs"][0]["loadlist"])
    return 1.0 + (m * n / 1000 + (m + 2 * n) * (1.0 + k / 16)) / 400


def job_kinds(
    library: PolicyLibrary,
    missions: MissionStore,
    limits: ContainerLimits,
    max_run_s: float | None,
    max_training_s: float | None,
) -> list[JobKind]:
    """List the kinds of job.

    Parameters
    ----------
    library
        Where policies are registered, in the transaction that ends their job.
    missions
        Where new plans are proposed, likewise.
    limits
        What a checkpoint may have at most.
    max_run_s, max_training_s
        How long an allocation and a training may run, in seconds; None: as long as they like.
    """

    def add_to_library(connection: Connection, job: Job, work: WorkResult) -> Mapping[str, Any]:
        if work.artifact is None:
            raise InvalidCheckpoint(
                said(
                    "{kind} job {id} has left no checkpoint: it was stopped before its first epoch, or its "
                    "training has diverged",
                    kind=job.kind,
                    id=job.id,
                )
            )
        task = problem_from_record(job.payload["problem"])
        policy = library.add(new_policy(job.payload["name"], task, work.artifact, limits=limits), connection)
        return {**work.result, "policy_id": policy.id}

    def propose(connection: Connection, job: Job, work: WorkResult) -> Mapping[str, Any]:
        about, proposal = job.payload, work.result["proposal"]
        number = missions.propose(connection, about["mission_id"], about["number"], job.id, proposal)
        return {**work.result, "mission_id": about["mission_id"], "proposal": number}

    return [
        JobKind(
            ALLOCATE,
            "app.allocation.tasks:allocate",
            "interactive",
            at_once="app.allocation.tasks:allocate_at_once",
            max_run_s=max_run_s,
            effort=_effort,
            follow_up=_REASONS,
        ),
        JobKind(EVALUATE, "app.allocation.evaluating:evaluate", "interactive", max_run_s=max_run_s),
        JobKind(BATCH, "app.allocation.tasks:allocate", "batch", max_run_s=max_run_s, follow_up=_REASONS),
        JobKind(
            REPLAN,
            "app.missions.replanning:replan",
            "interactive",
            propose,
            max_run_s=max_run_s,
            follow_up=_REASONS,
        ),
        JobKind(TRAIN, "app.allocation.tasks:train", "training", add_to_library, max_run_s=max_training_s),
        # The weights are the job's artifact, and the policy's.
        JobKind(
            REGISTER,
            "app.allocation.tasks:register",
            "interactive",
            add_to_library,
            dropped_fields=frozenset({"checkpoint_base64"}),
        ),
    ]
