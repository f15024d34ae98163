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
from app.domain.said import said


class PlanUnavailable(RequestError):
    """Root of the tree."""


class NoPlan(PlanUnavailable):
    """The job has no plan, or not yet."""

    def __init__(self, job_id: str, kind: str, status: str) -> None:
        super().__init__(
            "no-plan",
            said(
                "job {id} ({kind}, {status}) has no plan to take away; an allocation has, once it ended",
                id=job_id,
                kind=kind,
                status=status,
            ),
            extensions={"job_id": job_id, "job_status": status},
        )


class NotGeographic(PlanUnavailable):
    """Flight files need longitudes and latitudes."""

    def __init__(self, format: str, crs: str) -> None:
        super().__init__(
            "plan-not-geographic",
            said(
                "format {format!r} needs a problem with crs 'wgs84'; the crs of this one is {crs!r}",
                format=format,
                crs=crs,
            ),
            errors=[
                FieldError(
                    pointer="/crs", detail=said("{crs!r}; {format!r} needs 'wgs84'", crs=crs, format=format)
                )
            ],
            extensions={"crs": crs},
        )


class UnknownUAV(PlanUnavailable):
    """No UAV of the plan has that id."""

    def __init__(self, uav_id: str, parameter: str = "uav") -> None:
        super().__init__(
            "uav-not-found",
            said("{parameter}: no UAV of the plan has the id {id!r}", parameter=parameter, id=uav_id),
            errors=[
                FieldError(
                    pointer="", detail=said("{id!r} is not in the plan", id=uav_id), parameter=parameter
                )
            ],
        )


class NothingToFly(PlanUnavailable):
    """The UAV, or every one, stays where it is."""

    def __init__(self, uav_id: str | None) -> None:
        if uav_id is None:
            detail = said("no UAV flies in this plan")
        else:
            detail = said("UAV {id!r} does not fly in this plan", id=uav_id)
        super().__init__("nothing-to-fly", detail)


class OutOfRange(PlanUnavailable):
    """Numbers of the plan are beyond what a flight file, an autopilot, or the UAV can hold."""

    def __init__(self, errors: Sequence[FieldError]) -> None:
        first = errors[0]
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        super().__init__("plan-out-of-range", f"{first.pointer}: {first.detail}{more}", errors=errors)
