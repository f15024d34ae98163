"""From a UAV's route to MAVLink mission items, which both of QGroundControl's formats hold.

A mission is: take off where it starts at home, fly at the UAV's speed, for every stop fly there, deliver and
stay for the service time, then go home or land. Where the way is no straight line it flies over its corners;
where it is there before the visit begins it loiters; in wind every leg has its speed over ground. Commands
and frames are those of MAVLink's common message set (``MAV_CMD``, ``MAV_FRAME``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flown_plan import FlownRoute, FlownStop, Points
from app.api.problem_details import FieldError
from app.domain.problem import TOLERANCE

MIN_ALTITUDE_M, MAX_ALTITUDE_M = 1.0, 10_000.0
MAX_SERVO_CHANNEL = 32
MIN_SERVO_PWM_US, MAX_SERVO_PWM_US = 500, 2500
MAX_GRIPPER = 8
MAX_DESCENT_M = 1_000.0
MIN_SPEED_M_S, MAX_SPEED_M_S = 0.1, 300.0
MAX_HOLD_S = 65_535.0
"""Autopilots keep the seconds of a delay in 16 bits."""
MAX_ITEMS = 65_535
_SAME_SPEED = 1e-3
"""Share by which speeds over ground differ for a leg to have one of its own."""


class Command(IntEnum):
    """The MAV_CMDs that are used."""

    WAYPOINT = 16
    LOITER_TIME = 19
    RETURN_TO_LAUNCH = 20
    LAND = 21
    TAKEOFF = 22
    DELAY = 93
    PAYLOAD_PLACE = 94
    CHANGE_SPEED = 178
    SET_SERVO = 183
    GRIPPER = 211


class Frame(IntEnum):
    """The MAV_FRAMEs that are used."""

    GLOBAL = 0
    MISSION = 2
    RELATIVE_ALTITUDE = 3
    TERRAIN_ALTITUDE = 10


class Delivery(StrEnum):
    """How material leaves the UAV at a stop."""

    PAYLOAD_PLACE = "payload-place"
    SERVO = "servo"
    GRIPPER = "gripper"
    LAND = "land"
    NONE = "none"


class Ending(StrEnum):
    """What comes after the last stop."""

    RETURN = "return"
    LAND = "land"


class AltitudeReference(StrEnum):
    """What altitudes are measured from."""

    HOME = "home"
    TERRAIN = "terrain"


@dataclass(frozen=True, slots=True)
class FlightChoices:
    """What a plan leaves open and a flight file has to say.

    Attributes
    ----------
    altitude_m
        Of all flight.
    altitude_reference
        What it is measured from.
    delivery, end
        See there.
    servo_channel, servo_pwm_us
        Output and pulse width that open the release, for ``servo``.
    gripper
        Which gripper opens, for ``gripper``; from 1.
    max_descent_m
        How far ``payload-place`` may go down to find the ground; 0: as far as it takes.
    """

    altitude_m: float = 50.0
    altitude_reference: AltitudeReference = AltitudeReference.HOME
    delivery: Delivery = Delivery.PAYLOAD_PLACE
    end: Ending = Ending.RETURN
    servo_channel: int = 9
    servo_pwm_us: int = 1900
    gripper: int = 1
    max_descent_m: float = 0.0

    @property
    def frame(self) -> Frame:
        """The frame of every item that has a place."""
        home = self.altitude_reference is AltitudeReference.HOME
        return Frame.RELATIVE_ALTITUDE if home else Frame.TERRAIN_ALTITUDE


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One mission item.

    Attributes
    ----------
    command, frame
        See there.
    params
        Four parameters; NaN leaves a heading to the autopilot.
    place
        Longitude and latitude in degrees, altitude in m; None for commands without a place.
    """

    command: Command
    frame: Frame
    params: tuple[float, float, float, float]
    place: tuple[float, float, float] | None = None


def mission(route: FlownRoute, choices: FlightChoices) -> tuple[MissionItem, ...]:
    """Turn a route of a ``wgs84`` problem into mission items, without the home position.

    Raises
    ------
    OutOfRange
        With every number that is beyond what the format, an autopilot or the UAV can hold.
    """
    errors = list(_violations(route, choices))
    items = tuple(_items(route, choices))
    if len(items) >= MAX_ITEMS:
        errors.append(
            FieldError(pointer=_at(route), detail=f"{len(items)} mission items, at most {MAX_ITEMS}")
        )
    if errors:
        raise OutOfRange(errors)
    return items


def speed_m_s(route: FlownRoute) -> float:
    """Return a UAV's speed; the problem's is in km/h."""
    return route.uav.speed / 3.6


def _items(route: FlownRoute, choices: FlightChoices) -> Iterator[MissionItem]:
    uav = route.uav
    if route.starts_at_home:
        yield _placed(Command.TAKEOFF, choices, uav.x_s, uav.y_s, choices.altitude_m)
    told = speed_m_s(route)
    yield _speed(told)
    for number, stop in enumerate(route.stops):
        speed = stop.ground_speed / 3.6
        if abs(speed - told) > _SAME_SPEED * told:
            told = speed
            yield _speed(told)
        yield from _corners(stop.path, choices)
        last = number == len(route.stops) - 1
        yield from _visit(stop, choices, _seconds(route.waiting_in_air(number)), last=last)
    if choices.end is Ending.RETURN:
        yield from _corners(route.return_path, choices)
        yield MissionItem(Command.RETURN_TO_LAUNCH, Frame.MISSION, (0.0, 0.0, 0.0, 0.0))
    elif not (route.stops and choices.delivery is Delivery.LAND):
        x, y = (route.stops[-1].target.x, route.stops[-1].target.y) if route.stops else (uav.x_c, uav.y_c)
        yield _placed(Command.LAND, choices, x, y, 0.0)


def _speed(speed: float) -> MissionItem:
    # 1: ground speed; -1: no change of throttle.
    return MissionItem(Command.CHANGE_SPEED, Frame.MISSION, (1.0, speed, -1.0, 0.0))


def _seconds(hours: float) -> float:
    return hours * 3600.0


def _corners(path: Points, choices: FlightChoices) -> Iterator[MissionItem]:
    """Fly over the points between both ends of a way."""
    for x, y in path[1:-1]:
        yield _placed(Command.WAYPOINT, choices, x, y, choices.altitude_m)


def _visit(stop: FlownStop, choices: FlightChoices, waiting_s: float, *, last: bool) -> Iterator[MissionItem]:
    x, y, hold_s = stop.target.x, stop.target.y, _seconds(stop.target.service_time)
    stay = MissionItem(Command.DELAY, Frame.MISSION, (hold_s, -1.0, -1.0, -1.0))
    yield _placed(Command.WAYPOINT, choices, x, y, choices.altitude_m)
    if waiting_s > 0:
        yield _placed(Command.LOITER_TIME, choices, x, y, choices.altitude_m, waiting_s)
    match choices.delivery:
        case Delivery.LAND:
            yield _placed(Command.LAND, choices, x, y, 0.0)
            if hold_s > 0:
                yield stay
            if not (last and choices.end is Ending.LAND):
                yield _placed(Command.TAKEOFF, choices, x, y, choices.altitude_m)
            return
        case Delivery.PAYLOAD_PLACE:
            first = choices.max_descent_m
            yield _placed(Command.PAYLOAD_PLACE, choices, x, y, 0.0, first, heading=0.0)
        case Delivery.SERVO:
            params = (float(choices.servo_channel), float(choices.servo_pwm_us), 0.0, 0.0)
            yield MissionItem(Command.SET_SERVO, Frame.MISSION, params)
        case Delivery.GRIPPER:
            # 0: release.
            yield MissionItem(Command.GRIPPER, Frame.MISSION, (float(choices.gripper), 0.0, 0.0, 0.0))
        case Delivery.NONE:
            pass
    if hold_s > 0:
        yield stay


def _placed(
    command: Command,
    choices: FlightChoices,
    x: float,
    y: float,
    altitude_m: float,
    first: float = 0.0,
    heading: float = math.nan,
) -> MissionItem:
    return MissionItem(command, choices.frame, (first, 0.0, 0.0, heading), (x, y, altitude_m))


def _violations(route: FlownRoute, choices: FlightChoices) -> Iterator[FieldError]:
    at = _at(route)
    uav = route.uav
    yield from _place_violations(f"{at}/start", uav.x_s, uav.y_s)
    yield from _place_violations(f"{at}/position", uav.x_c, uav.y_c)
    for number, stop in enumerate(route.stops):
        yield from _place_violations(f"{at}/stops/{number}", stop.target.x, stop.target.y)
        for name, does, hold_s in (
            ("service_time", "stay", _seconds(stop.target.service_time)),
            ("begin_time", "wait", _seconds(route.waiting_in_air(number))),
        ):
            if hold_s > MAX_HOLD_S:
                yield FieldError(
                    pointer=f"{at}/stops/{number}/{name}",
                    detail=f"{uav.id!r} would {does} {hold_s:g} s at {stop.target.id!r}, "
                    f"at most {MAX_HOLD_S:g} s can be told",
                )
        if stop.ground_speed != uav.speed:
            yield from _speed_violations(f"{at}/stops/{number}/speed", route, stop.ground_speed / 3.6)
        yield from _range_violations(f"{at}/stops/{number}", route, f"at {stop.target.id!r}", stop.range_left)
    if choices.end is Ending.RETURN:
        if route.return_time is None:
            detail = (
                f"{uav.id!r} need not return, and the plan has no way home (end=land stays at the last stop)"
            )
            yield FieldError(pointer=f"{at}/landing", detail=detail)
        yield from _range_violations(at, route, "at home (end=land stays at the last stop)", route.range_left)
    yield from _speed_violations(f"{at}/speed", route, speed_m_s(route))
    yield from _choice_violations(choices)


def _speed_violations(at: str, route: FlownRoute, speed: float) -> Iterator[FieldError]:
    if not MIN_SPEED_M_S <= speed <= MAX_SPEED_M_S:
        limits = f"{MIN_SPEED_M_S:g}..{MAX_SPEED_M_S:g}"
        yield FieldError(pointer=at, detail=f"{route.uav.id!r} flies {speed:g} m/s, which is not in {limits}")


def _choice_violations(choices: FlightChoices) -> Iterator[FieldError]:
    for name, value, low, high in (
        ("altitude", choices.altitude_m, MIN_ALTITUDE_M, MAX_ALTITUDE_M),
        ("servo_channel", choices.servo_channel, 1, MAX_SERVO_CHANNEL),
        ("servo_pwm", choices.servo_pwm_us, MIN_SERVO_PWM_US, MAX_SERVO_PWM_US),
        ("gripper", choices.gripper, 1, MAX_GRIPPER),
        ("max_descent", choices.max_descent_m, 0, MAX_DESCENT_M),
    ):
        if not low <= value <= high:
            yield FieldError(
                pointer="", detail=f"{name} {value:g} is not in {low:g}..{high:g}", parameter=name
            )


def _place_violations(at: str, x: float, y: float) -> Iterator[FieldError]:
    for name, value, limit in (("longitude", x, 180.0), ("latitude", y, 90.0)):
        if not -limit <= value <= limit:
            yield FieldError(
                pointer=f"{at}/{name}", detail=f"{value:g} degrees is not in {-limit:g}..{limit:g}"
            )


def _range_violations(at: str, route: FlownRoute, where: str, left: float) -> Sequence[FieldError]:
    if left >= -TOLERANCE * max(1.0, route.uav.voyage):
        return ()
    detail = f"{route.uav.id!r} would be {-left:g} km beyond its range of {route.uav.voyage:g} km {where}"
    return (FieldError(pointer=f"{at}/range_left", detail=detail),)


def _at(route: FlownRoute) -> str:
    return f"/routes/{route.number}"
