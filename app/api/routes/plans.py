"""GET /jobs/{job_id}/plan: a plan to take away, for ground stations, maps, tables and paper."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import BeforeValidator, Field
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.job_models import result_of
from app.api.plan_formats import mission
from app.api.plan_formats.altitudes import (
    MAX_CLEARANCE_M,
    MAX_STEP_M,
    TERRAIN_BEYOND_KM,
    AltitudeBy,
    LegOf,
    OwnAltitude,
    Separation,
)
from app.api.plan_formats.archive import zip_archive
from app.api.plan_formats.errors import NoPlan, NotGeographic, NothingToFly, UnknownUAV
from app.api.plan_formats.flown_plan import FlownPlan, flown_plan
from app.api.plan_formats.formats import FORMATS, Document, FlightsDocument, PlanFormat
from app.api.plan_formats.geojson import MEDIA_TYPE as GEOJSON
from app.api.plan_formats.launches import MAX_INTERVAL_S, PlannedFlight, planned_flights
from app.api.plan_formats.map_files import GPX_TYPE, KML_TYPE
from app.api.plan_formats.mission import AltitudeReference, Delivery, Ending, FlightChoices
from app.api.plan_formats.qgroundcontrol import file_name
from app.api.problem_details import responses
from app.api.routes.parameters import JobId
from app.api.services import Served
from app.domain.records import problem_from_record
from app.jobs.model import Job

router = APIRouter(prefix="/jobs", tags=["jobs"])


_CHOICES, _APART = FlightChoices(), Separation()
_OWN_ALTITUDE = re.compile(r"^(?P<whose>.+)=(?P<metres>\d+(\.\d+)?)(@(?P<reference>home|terrain))?$")
_ZIP = "application/zip"
_TEXT = {"schema": {"type": "string"}}
_OBJECT = {"schema": {"type": "object"}}
_MOMENT = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d")


def _by_the_calendar(given: object) -> object:
    """Refuse what begins without a date and a time: a bare number would be seconds since 1970."""
    if isinstance(given, str) and not _MOMENT.match(given):
        raise ValueError("is not a date and time such as 2026-11-30T06:30")
    return given


@router.get(
    "/{job_id}/plan",
    summary="Take a plan away",
    response_class=Response,
    responses={
        200: {
            "description": "The file; several flight files come as a ZIP archive",
            "content": {
                GEOJSON: _OBJECT,
                "application/json": _OBJECT,
                "text/plain": _TEXT,
                "text/csv": _TEXT,
                "text/html": _TEXT,
                KML_TYPE: _TEXT,
                GPX_TYPE: _TEXT,
                _ZIP: {"schema": {"type": "string", "format": "binary"}},
            },
            "headers": {
                "Content-Disposition": {"description": "The file's name", "schema": {"type": "string"}}
            },
        },
        **responses(
            "job-not-found",
            "uav-not-found",
            "no-plan",
            "nothing-to-fly",
            "plan-not-geographic",
            "plan-out-of-range",
            "invalid-request",
        ),
    },
)
async def get_plan(
    job_id: JobId,
    services: Served,
    format: Annotated[
        PlanFormat,
        Query(
            description="html (a page to print), geojson, csv: the whole plan. load-sheet: CSV of what each "
            "UAV takes up before each flight. "
            "briefing (text), kml, gpx: all flights with their altitudes, times and warnings. "
            "qgc-plan (QGroundControl's .plan), qgc-wpl (QGC WPL 110 waypoints): "
            "flight files, one a flight. These five are for problems with crs wgs84"
        ),
    ] = PlanFormat.HTML,
    uav: Annotated[
        str | None,
        Query(
            min_length=1,
            max_length=100,
            description="Id of the UAV whose flights these are; default: all",
        ),
    ] = None,
    altitude: Annotated[
        float,
        Query(
            ge=mission.MIN_ALTITUDE_M,
            le=mission.MAX_ALTITUDE_M,
            allow_inf_nan=False,
            description="Flights: m, the lowest one",
        ),
    ] = _CHOICES.altitude_m,
    altitude_step: Annotated[
        float,
        Query(
            ge=0,
            le=MAX_STEP_M,
            allow_inf_nan=False,
            description="Flights: m that each further UAV of a place, or leg near others, flies above the "
            "one before it",
        ),
    ] = _APART.altitude_step_m,
    altitude_by: Annotated[
        AltitudeBy,
        Query(
            description="Flights: what has an altitude of its own. uav: each UAV, so that those of one place "
            "are apart. leg: each leg of a UAV, so that it is apart from every leg of another UAV that it "
            "crosses or comes near"
        ),
    ] = _APART.altitude_by,
    clearance: Annotated[
        float,
        Query(
            ge=0,
            le=MAX_CLEARANCE_M,
            allow_inf_nan=False,
            description="With altitude_by=leg: m that legs of one altitude are away from each other",
        ),
    ] = _APART.clearance_m,
    altitude_of: Annotated[
        list[Annotated[str, Field(max_length=130, pattern=_OWN_ALTITUDE.pattern)]] | None,
        Query(
            max_length=1000,
            description="Flights: altitude in m of a UAV, as `uav-7=90`, or of a leg, `uav-7/2=90` to its "
            "second stop (reloads are stops, the last leg leads home), from `@terrain` or `@home`",
        ),
    ] = None,
    altitude_reference: Annotated[
        AltitudeReference | None,
        Query(
            description="Flights: what altitudes are measured from; default: home, but the terrain for "
            f"flights of more than {TERRAIN_BEYOND_KM:g} km, and with altitude_by=leg for all if one is so "
            "long or they start at several places"
        ),
    ] = None,
    launch_interval: Annotated[
        float,
        Query(
            ge=0,
            le=MAX_INTERVAL_S,
            allow_inf_nan=False,
            description="Flights: seconds between two take-offs at one place; later ones wait",
        ),
    ] = _APART.launch_interval_s,
    delivery: Annotated[
        Delivery,
        Query(
            description="Flight files: how material is left at a stop. payload-place: "
            "MAV_CMD_NAV_PAYLOAD_PLACE; servo: MAV_CMD_DO_SET_SERVO; gripper: MAV_CMD_DO_GRIPPER; land: land "
            "and take off again; none: fly there"
        ),
    ] = Delivery.PAYLOAD_PLACE,
    end: Annotated[
        Ending, Query(description="Flight files: home after a UAV's last stop, or land there")
    ] = Ending.RETURN,
    servo_channel: Annotated[
        int, Query(ge=1, le=mission.MAX_SERVO_CHANNEL, description="With delivery=servo: the output")
    ] = 9,
    servo_pwm: Annotated[
        int,
        Query(
            ge=mission.MIN_SERVO_PWM_US,
            le=mission.MAX_SERVO_PWM_US,
            description="With delivery=servo: pulse width that releases, µs",
        ),
    ] = 1900,
    gripper: Annotated[
        int, Query(ge=1, le=mission.MAX_GRIPPER, description="With delivery=gripper: which one")
    ] = 1,
    max_descent: Annotated[
        float,
        Query(
            ge=0,
            le=mission.MAX_DESCENT_M,
            allow_inf_nan=False,
            description="With delivery=payload-place: m it may go down to find the ground; 0: no limit",
        ),
    ] = 0.0,
    title: Annotated[
        str | None, Query(max_length=200, description="html: what stands above the plan; default: its id")
    ] = None,
    begins: Annotated[
        datetime | None,
        BeforeValidator(_by_the_calendar),
        Query(
            description="html: when it begins, by the clock where it is flown; default: times count from 0"
        ),
    ] = None,
) -> Response:
    """Write a plan in a format of the field.

    UAVs of one place fly one above the other and take off one after the other; what that makes late is
    among the warnings of a flight, which are in the briefing, in maps and in the notes of a `.plan`.
    Before a flight file is written, every position, altitude, speed and stay is checked against what the
    format holds, and at every stop that the UAV is within its range; all that is wrong is listed. A UAV
    that is on its way already (it has flown, or is not where it started) gets a mission without a
    take-off.
    """
    choices = FlightChoices(
        altitude_m=altitude,
        delivery=delivery,
        end=end,
        servo_channel=servo_channel,
        servo_pwm_us=servo_pwm,
        gripper=gripper,
        max_descent_m=max_descent,
    )
    separation = Separation(
        altitude_step,
        launch_interval,
        reference=altitude_reference,
        altitude_by=altitude_by,
        clearance_m=clearance,
    )
    job = await services.jobs.get(job_id)
    return await run_in_threadpool(
        _file, job, format, uav, choices, separation, altitude_of or (), title, begins
    )


def _file(
    job: Job,
    format: PlanFormat,
    uav: str | None,
    choices: FlightChoices,
    separation: Separation,
    altitude_of: Sequence[str],
    title: str | None,
    begins: datetime | None,
) -> Response:
    answer = result_of(job)
    if answer is None or "routes" not in answer:
        raise NoPlan(job.id, job.kind, job.status.value)
    plan = flown_plan(problem_from_record(job.payload["problem"]), answer)
    if format is PlanFormat.HTML:
        plan = replace(plan, title=title, begins=begins)
    kind = FORMATS[format]
    if isinstance(kind, Document):
        # A page is looked at in the browser, everything else is kept.
        how = "inline" if format is PlanFormat.HTML else "attachment"
        sheet = "-loads" if format is PlanFormat.LOAD_SHEET else ""
        return _response(kind.write(plan), kind.media_type, f"plan-{job.id[:8]}{sheet}.{kind.ending}", how)
    if plan.problem.crs != "wgs84":
        raise NotGeographic(format.value, plan.problem.crs)
    flights = _flights(plan, uav, choices, _with_own(separation, altitude_of, plan))
    if isinstance(kind, FlightsDocument):
        whose = "" if uav is None else f"-{flights[0].flight.route + 1:03d}"
        name = f"plan-{job.id[:8]}{whose}.{kind.ending}"
        return _response(kind.write(plan, flights), kind.media_type, name)
    files = {
        file_name(each.flight, kind.ending, numbered=plan.has_bases): kind.write(each) for each in flights
    }
    if uav is not None and len(files) == 1:
        ((name, text),) = files.items()
        return _response(text, kind.media_type, name)
    of_uav = "" if uav is None else f"-{flights[0].flight.route + 1:03d}"
    return _response(zip_archive(files), _ZIP, f"plan-{job.id[:8]}{of_uav}-{format}.zip")


def _with_own(separation: Separation, altitude_of: Sequence[str], plan: FlownPlan) -> Separation:
    """Add altitudes that UAVs and legs are to have.

    Raises
    ------
    UnknownUAV
        If the plan does not have one of the UAVs.
    """
    known = {each.id for each in plan.problem.uavs}
    of_uavs: dict[str, OwnAltitude] = {}
    of_legs: dict[LegOf, OwnAltitude] = {}
    for each in altitude_of:
        told = _OWN_ALTITUDE.fullmatch(each)
        assert told is not None
        whose, measured_from = told["whose"], told["reference"]
        own = float(told["metres"]), None if measured_from is None else AltitudeReference(measured_from)
        uav_id, _, leg = whose.rpartition("/")
        # An id may look like a leg of another one.
        if whose in known:
            of_uavs[whose] = own
        elif uav_id in known and leg.isascii() and leg.isdigit() and int(leg) > 0:
            of_legs[LegOf(uav_id, int(leg))] = own
        else:
            raise UnknownUAV(whose, "altitude_of")
    return replace(separation, altitude_of=of_uavs, altitude_of_leg=of_legs)


def _flights(
    plan: FlownPlan, uav: str | None, choices: FlightChoices, separation: Separation
) -> list[PlannedFlight]:
    """Return the flights of a UAV, or of all, as they are flown among all others.

    Raises
    ------
    UnknownUAV, NothingToFly
        If the plan does not have the UAV, or any flight.
    """
    if uav is not None and all(route.uav.id != uav for route in plan.routes):
        raise UnknownUAV(uav)
    planned = planned_flights(plan, choices, separation)
    flights = [each for each in planned if uav in (None, each.flight.uav.id)]
    if not flights:
        raise NothingToFly(uav)
    return flights


def _response(content: str | bytes, media_type: str, name: str, how: str = "attachment") -> Response:
    return Response(
        content, media_type=media_type, headers={"Content-Disposition": f'{how}; filename="{name}"'}
    )
