"""What can stand between a plan and its file.

RequestError
 └─ PlanUnavailable
     ├─ NoPlan              the job has no plan (yet)
     ├─ NotGeographic       flight files need longitudes and latitudes
     ├─ UnknownUAV          no UAV of the plan has that id
     ├─ NothingToFly        the UAV stays where it is
     └─ OutOfRange          a number is beyond what a flight file or the UAV can hold
"""

from __future__ import annotations

from collections.abc import Sequence

from app.api.errors import RequestError
from app.api.problem_details import FieldError


class PlanUnavailable(RequestError):
    """Root of the tree."""


class NoPlan(PlanUnavailable):
    """The job has no plan, or not yet."""

    def __init__(self, job_id: str, kind: str, status: str) -> None:
        super().__init__(
            "no-plan",
            f"job {job_id} ({kind}, {status}) has no plan to take away; an allocation has, once it ended",
            extensions={"job_id": job_id, "job_status": status},
        )


class NotGeographic(PlanUnavailable):
    """Flight files need longitudes and latitudes."""

    def __init__(self, format: str, crs: str) -> None:
        super().__init__(
            "plan-not-geographic",
            f"format {format!r} needs a problem with crs 'wgs84'; the crs of this one is {crs!r}",
            errors=[FieldError(pointer="/crs", detail=f"{crs!r}; {format!r} needs 'wgs84'")],
            extensions={"crs": crs},
        )


class UnknownUAV(PlanUnavailable):
    """No UAV of the plan has that id."""

    def __init__(self, uav_id: str, parameter: str = "uav") -> None:
        super().__init__(
            "uav-not-found",
            f"{parameter}: no UAV of the plan has the id {uav_id!r}",
            errors=[FieldError(pointer="", detail=f"{uav_id!r} is not in the plan", parameter=parameter)],
        )


class NothingToFly(PlanUnavailable):
    """The UAV, or every one, stays where it is."""

    def __init__(self, uav_id: str | None) -> None:
        who = "no UAV flies" if uav_id is None else f"UAV {uav_id!r} does not fly"
        super().__init__("nothing-to-fly", f"{who} in this plan")


class OutOfRange(PlanUnavailable):
    """Numbers of the plan are beyond what a flight file, an autopilot, or the UAV can hold."""

    def __init__(self, errors: Sequence[FieldError]) -> None:
        first = errors[0]
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        super().__init__("plan-out-of-range", f"{first.pointer}: {first.detail}{more}", errors=errors)
