"""From a flight to MAVLink mission items, which both of QGroundControl's formats hold.

A mission is: take off where it starts at home or at a base, fly at the UAV's speed, for every stop fly there,
deliver and stay for the service time, then go home or land. A flight that ends elsewhere than it has begun
flies there and lands: a return leads to where the UAV was launched. Where the way is no straight line it
flies over its corners; where it is there before the visit begins it loiters; in wind every leg has its speed
over ground. Commands and frames are those of MAVLink's common message set (``MAV_CMD``, ``MAV_FRAME``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum

from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flights import Flight, FlownReload, FlownStop, Points
from app.api.problem_details import FieldError
from app.domain.problem import TOLERANCE
from app.domain.said import said

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
    """What comes after the last stop of a UAV; flights before its last one end at their base."""

    RETURN = "return"
    LAND = "land"


class AltitudeReference(StrEnum):
    """What altitudes are measured from."""

    HOME = "home"
    TERRAIN = "terrain"


@dataclass(frozen=True, slots=True)
class Altitude:
    """How high a leg is flown.

    Attributes
    ----------
    metres
        See there.
    reference
        What they are measured from.
    """

    metres: float
    reference: AltitudeReference

    @property
    def frame(self) -> Frame:
        """The frame of items at this altitude."""
        home = self.reference is AltitudeReference.HOME
        return Frame.RELATIVE_ALTITUDE if home else Frame.TERRAIN_ALTITUDE


@dataclass(frozen=True, slots=True)
class FlightChoices:
    """What a plan leaves open and a flight file has to say.

    Attributes
    ----------
    altitude_m
        Of all legs that have none of their own.
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
    legs
        Altitudes of the legs of a flight in turn, that to where it lands last; empty: all have the same.
    """

    altitude_m: float = 50.0
    altitude_reference: AltitudeReference = AltitudeReference.HOME
    delivery: Delivery = Delivery.PAYLOAD_PLACE
    end: Ending = Ending.RETURN
    servo_channel: int = 9
    servo_pwm_us: int = 1900
    gripper: int = 1
    max_descent_m: float = 0.0
    legs: tuple[Altitude, ...] = ()

    @property
    def altitudes(self) -> tuple[Altitude, ...]:
        """The altitudes that there are, each once, in the order in which they are flown."""
        return tuple(dict.fromkeys(self.legs or (Altitude(self.altitude_m, self.altitude_reference),)))

    def altitude(self, leg: int) -> Altitude:
        """Return the altitude of a leg, counted from 0."""
        return self.legs[leg] if self.legs else Altitude(self.altitude_m, self.altitude_reference)


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


def mission(flight: Flight, choices: FlightChoices) -> tuple[MissionItem, ...]:
    """Turn a flight of a ``wgs84`` problem into mission items, without the home position.

    Raises
    ------
    OutOfRange
        With every number that is beyond what the format, an autopilot or the UAV can hold.
    """
    errors = list(_violations(flight, choices))
    items = tuple(_items(flight, choices))
    if len(items) >= MAX_ITEMS:
        errors.append(
            FieldError(pointer=_at(flight), detail=f"{len(items)} mission items, at most {MAX_ITEMS}")
        )
    if errors:
        raise OutOfRange(errors)
    return items


def mission_with_home(flight: Flight, choices: FlightChoices) -> tuple[MissionItem, ...]:
    """Return the same with the home position as item 0, as ArduPilot numbers missions.

    It is in the global frame, since no other altitude is measured from anything else.

    Raises
    ------
    OutOfRange
        As :func:`mission` does.
    """
    home = MissionItem(Command.WAYPOINT, Frame.GLOBAL, (0.0, 0.0, 0.0, 0.0), (*flight.launch, 0.0))
    return (home, *mission(flight, choices))


def speed_m_s(flight: Flight) -> float:
    """Return a UAV's speed; the problem's is in km/h."""
    return flight.uav.speed / 3.6


def _ending(flight: Flight, choices: FlightChoices) -> Ending:
    return Ending.RETURN if isinstance(flight.landing, FlownReload) else choices.end


def _items(flight: Flight, choices: FlightChoices) -> Iterator[MissionItem]:
    end = _ending(flight, choices)
    high = choices.altitude(0)
    if flight.takes_off:
        yield _placed(Command.TAKEOFF, high, *flight.launch)
    told = speed_m_s(flight)
    yield _speed(told)
    for number, stop in enumerate(flight.stops):
        speed = stop.ground_speed / 3.6
        if _differs(speed, told):
            told = speed
            yield _speed(told)
        yield from _leg(stop.path, choices, number)
        last = number == len(flight.stops) - 1
        following = None if last and end is Ending.LAND else choices.altitude(number + 1)
        waiting_s = _seconds(flight.waiting_in_air(number))
        yield from _visit(stop, choices, choices.altitude(number), waiting_s, following)
    home = len(flight.stops)
    high = choices.altitude(home)
    if end is Ending.RETURN and flight.returns_to_launch:
        yield from _leg(flight.landing.path, choices, home)
        yield MissionItem(Command.RETURN_TO_LAUNCH, Frame.MISSION, (0.0, 0.0, 0.0, 0.0))
    elif end is Ending.RETURN:
        speed = flight.landing.ground_speed / 3.6
        if _differs(speed, told):
            yield _speed(speed)
        yield from _leg(flight.landing.path, choices, home)
        yield _placed(Command.WAYPOINT, high, *flight.landing.place)
        yield _placed(Command.LAND, replace(high, metres=0.0), *flight.landing.place)
    elif not (flight.stops and choices.delivery is Delivery.LAND):
        x, y = (flight.stops[-1].target.x, flight.stops[-1].target.y) if flight.stops else flight.place
        yield _placed(Command.LAND, replace(choices.altitude(max(0, home - 1)), metres=0.0), x, y)


def _differs(speed: float, told: float) -> bool:
    return abs(speed - told) > _SAME_SPEED * told


def _speed(speed: float) -> MissionItem:
    # 1: ground speed; -1: no change of throttle.
    return MissionItem(Command.CHANGE_SPEED, Frame.MISSION, (1.0, speed, -1.0, 0.0))


def _seconds(hours: float) -> float:
    return hours * 3600.0


def _leg(path: Points, choices: FlightChoices, leg: int) -> Iterator[MissionItem]:
    """Change the altitude over where a leg begins, and fly over the points between both ends of its way."""
    high = choices.altitude(leg)
    took_off = choices.delivery is Delivery.LAND
    if leg > 0 and not took_off and high != choices.altitude(leg - 1):
        yield _placed(Command.WAYPOINT, high, *path[0])
    for x, y in path[1:-1]:
        yield _placed(Command.WAYPOINT, high, x, y)


def _visit(
    stop: FlownStop, choices: FlightChoices, high: Altitude, waiting_s: float, following: Altitude | None
) -> Iterator[MissionItem]:
    """Arrive at an altitude, deliver and stay; `following` is that of the next leg, None where it lands."""
    x, y, hold_s = stop.target.x, stop.target.y, _seconds(stop.target.service_time)
    stay = MissionItem(Command.DELAY, Frame.MISSION, (hold_s, -1.0, -1.0, -1.0))
    ground = replace(high, metres=0.0)
    yield _placed(Command.WAYPOINT, high, x, y)
    if waiting_s > 0:
        yield _placed(Command.LOITER_TIME, high, x, y, waiting_s)
    match choices.delivery:
        case Delivery.LAND:
            yield _placed(Command.LAND, ground, x, y)
            if hold_s > 0:
                yield stay
            if following is not None:
                yield _placed(Command.TAKEOFF, following, x, y)
            return
        case Delivery.PAYLOAD_PLACE:
            first = choices.max_descent_m
            yield _placed(Command.PAYLOAD_PLACE, ground, x, y, first, heading=0.0)
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
    command: Command, high: Altitude, x: float, y: float, first: float = 0.0, heading: float = math.nan
) -> MissionItem:
    return MissionItem(command, high.frame, (first, 0.0, 0.0, heading), (x, y, high.metres))


def _violations(flight: Flight, choices: FlightChoices) -> Iterator[FieldError]:
    at = _at(flight)
    uav, landing = flight.uav, flight.landing
    yield from _place_violations(f"{at}/start", *flight.launch)
    yield from _place_violations(f"{at}/position", *flight.place)
    for number, stop in enumerate(flight.stops):
        at_stop = f"{at}/stops/{stop.number}"
        yield from _place_violations(at_stop, stop.target.x, stop.target.y)
        for name, hold_s in (
            ("service_time", _seconds(stop.target.service_time)),
            ("begin_time", _seconds(flight.waiting_in_air(number))),
        ):
            if hold_s > MAX_HOLD_S:
                yield FieldError(
                    pointer=f"{at_stop}/{name}",
                    detail=said(
                        "{uav!r} would stay {seconds:g} s at {stop!r}, at most {most:g} s can be told",
                        uav=uav.id,
                        seconds=hold_s,
                        stop=stop.target.id,
                        most=MAX_HOLD_S,
                    ),
                )
        if stop.ground_speed != uav.speed:
            yield from _speed_violations(f"{at_stop}/speed", flight, stop.ground_speed / 3.6)
        yield from _left_violations(
            at_stop, flight, f"at {stop.target.id!r}", stop.range_left, stop.endurance_left
        )
    if _ending(flight, choices) is Ending.RETURN:
        if landing.time is None:
            detail = (
                f"{uav.id!r} need not return, and the plan has no way home (end=land stays at the last stop)"
            )
            yield FieldError(pointer=f"{at}/landing", detail=detail)
        at_landing, advice = at, " (end=land stays at the last stop)"
        if isinstance(landing, FlownReload):
            at_landing, advice = f"{at}/stops/{landing.number}", ""
        where = f"at home{advice}" if landing.base is None else f"at base {landing.base.id!r}{advice}"
        if not flight.returns_to_launch:
            yield from _place_violations(f"{at_landing}/landing", *landing.place)
            if landing.ground_speed != uav.speed:
                yield from _speed_violations(f"{at_landing}/speed", flight, landing.ground_speed / 3.6)
        yield from _left_violations(at_landing, flight, where, landing.range_left, landing.endurance_left)
    yield from _speed_violations(f"{at}/speed", flight, speed_m_s(flight))
    yield from _choice_violations(choices)


def _speed_violations(at: str, flight: Flight, speed: float) -> Iterator[FieldError]:
    if not MIN_SPEED_M_S <= speed <= MAX_SPEED_M_S:
        limits = f"{MIN_SPEED_M_S:g}..{MAX_SPEED_M_S:g}"
        yield FieldError(
            pointer=at, detail=f"{flight.uav.id!r} flies {speed:g} m/s, which is not in {limits}"
        )


def _choice_violations(choices: FlightChoices) -> Iterator[FieldError]:
    for name, value, low, high in (
        *(("altitude", each.metres, MIN_ALTITUDE_M, MAX_ALTITUDE_M) for each in choices.altitudes),
        ("servo_channel", choices.servo_channel, 1, MAX_SERVO_CHANNEL),
        ("servo_pwm", choices.servo_pwm_us, MIN_SERVO_PWM_US, MAX_SERVO_PWM_US),
        ("gripper", choices.gripper, 1, MAX_GRIPPER),
        ("max_descent", choices.max_descent_m, 0, MAX_DESCENT_M),
    ):
        if not low <= value <= high:
            detail = said(
                "{name} {value:g} is not in {low:g}..{high:g}", name=name, value=value, low=low, high=high
            )
            yield FieldError(pointer="", detail=detail, parameter=name)


def _place_violations(at: str, x: float, y: float) -> Iterator[FieldError]:
    for name, value, limit in (("longitude", x, 180.0), ("latitude", y, 90.0)):
        if not -limit <= value <= limit:
            detail = said(
                "{value:g} degrees is not in {low:g}..{high:g}", value=value, low=-limit, high=limit
            )
            yield FieldError(pointer=f"{at}/{name}", detail=detail)


def _left_violations(
    at: str, flight: Flight, where: str, range_left: float, endurance_left: float | None
) -> Iterator[FieldError]:
    """Compare what is left of the range and of the time in the air of this flight with none."""
    uav = flight.uav
    for name, left, whole, called, unit in (
        ("range_left", range_left, uav.voyage, "range", "km"),
        ("endurance_left", endurance_left, uav.endurance, "endurance", "h"),
    ):
        if left is not None and whole is not None and left < -TOLERANCE * max(1.0, whole):
            detail = f"{uav.id!r} would be {-left:g} {unit} beyond its {called} of {whole:g} {unit} {where}"
            yield FieldError(pointer=f"{at}/{name}", detail=detail)


def _at(flight: Flight) -> str:
    return f"/routes/{flight.route}"
