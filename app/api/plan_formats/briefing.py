"""What is read before the first take-off: flights in order, with altitudes, times, amounts and warnings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.api.plan_formats.altitudes import altitude_text
from app.api.plan_formats.flown_plan import FlownPlan
from app.api.plan_formats.launches import PlannedFlight
from app.api.plan_formats.printed_text import called, named_amounts_text, position_text
from app.domain.clock import clock


def briefing(plan: FlownPlan, flights: Sequence[PlannedFlight]) -> str:
    """Write the flights of a ``wgs84`` plan as text, in the order in which they take off.

    Parameters
    ----------
    plan
        The plan.
    flights
        Those to write.
    """
    begun = sorted(flights, key=lambda each: each.flight.take_off_time or 0.0)
    lines = [
        f"Flights of plan {plan.job_id[:8]}, as they take off. Times: hours:minutes from the plan's begin.",
        "",
    ]
    for number, each in enumerate(begun, 1):
        lines += [*_flight(plan, number, each), ""]
    return "\n".join(lines)


def _flight(plan: FlownPlan, place: int, planned: PlannedFlight) -> Iterator[str]:
    flight, choices = planned.flight, planned.choices
    which = f", flight {flight.number}" if plan.has_bases else ""
    yield f"{place}. {called(flight.uav)}{which}"
    takes_off = flight.take_off_time
    begins = "is in the air" if takes_off is None else f"takes off at {clock(takes_off)}"
    yield f"   {begins}, {position_text(plan, *flight.place)}"
    yield f"   {altitude_text(choices.altitudes)}"
    several = len(choices.altitudes) > 1

    def at(leg: int) -> str:
        return f", flown to at {altitude_text([choices.altitude(leg)])}" if several else ""

    for number, stop in enumerate(flight.stops):
        yield (
            f"   {clock(flight.arrives(number))} {called(stop.target)}, "
            f"{position_text(plan, *stop.path[-1])}: unloads {named_amounts_text(plan, stop.delivered)}, "
            f"{stop.range_left:.1f} km of range left{at(number)}"
        )
    landing = flight.landing
    where = "where it started" if landing.base is None else f"at base {called(landing.base)}"
    if landing.time is not None:
        left = f"{landing.range_left:.1f} km of range left{at(len(flight.stops))}"
        yield f"   {clock(landing.time)} lands {where}, {left}"
    yield from (f"   ! {warning}" for warning in planned.warnings)
