"""The whole of a day as one problem, all of it known from the morning: what days are held against.

A visit begins no sooner than its area appears, legs take as long as they really do, and a UAV that is lost
begins its last visit before, and need not come home. UAVs may be on their way, or wait, before anybody
could have known why. So no way of replanning earns more than the best plan, but for two things that are
small: its search may miss that plan, and who unloads first where two UAVs meet is by the plan's steps here,
by time on the day.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from app.domain.geometry import distances
from app.domain.matrices import Matrix
from app.domain.problem import UAV, Problem, Target
from app.domain.surroundings import Base
from app.missions.days.kinds import Day


def in_hindsight(day: Day) -> Problem:
    """Return the problem of a day as it looks when it is over; each UAV has legs of its own."""
    known = day.problem
    depot = known.uavs[0]
    areas = tuple(day.areas.values())
    sites: tuple[Target | Base, ...] = (*areas, *known.bases)
    places = [(depot.x_s, depot.y_s), *((each.x, each.y) for each in sites)]
    stops = [each.id for each in sites]
    lengths = distances(known.crs, np.array(places), np.array(places))
    targets = tuple(
        replace(each, earliest=max(each.earliest, day.appears.get(each.id, 0.0)), location=1 + j)
        for j, each in enumerate(areas)
    )
    bases = tuple(replace(each, location=1 + len(areas) + d) for d, each in enumerate(known.bases))
    last = max(each.service_time for each in areas)
    return replace(
        known,
        uavs=tuple(_knowing(uav, day, last) for uav in known.uavs),
        targets=targets,
        bases=bases,
        matrices={uav.id: _legs(uav, stops, lengths, day) for uav in known.uavs},
    )


def _knowing(uav: UAV, day: Day, service_time: float) -> UAV:
    until = day.lost.get(uav.id)
    ends = None if until is None else until + service_time
    return replace(uav, location=0, home_location=0, profile=uav.id, available_until=ends)


def _legs(uav: UAV, stops: list[str], lengths: npt.NDArray[np.float64], day: Day) -> Matrix:
    slowness = np.array([1.0, *(day.slowness.get((uav.id, stop), 1.0) for stop in stops)])
    length, duration = lengths.copy(), lengths * slowness / uav.speed
    if uav.id in day.lost:
        # It flies home from nowhere: what it would pay for that is not paid on the day.
        length[:, 0] = duration[:, 0] = 0.0
    return Matrix(length, duration)
