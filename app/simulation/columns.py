"""Columns of :class:`~app.simulation.arrays.ProblemArrays`: what a problem, a UAV and a target have.

A structured array is one argument of compiled code, however many columns it has. With twelve arrays more the
replay took 18 s to compile instead of 11.
"""

from __future__ import annotations

import numpy as np

TERMS = np.dtype(
    [
        ("weight", "f8"),
        ("decay", "f8"),
        ("bonus", "f8"),
        ("makespan", "f8"),
        ("change", "f8"),
        ("crumb", "f8"),
        ("return_to_base", "?"),
        ("charge_return", "?"),
        ("timed", "?"),
        ("in_wind", "?"),
        ("metric", "?"),
        ("plans_loading", "?"),
    ],
    align=True,
)
"""What holds for a whole problem.

weight, makespan, change
    Distance weight λ as it is used, and the weights of makespan and changes.
decay
    1 / half_life, 0 where nothing decays.
bonus
    What the first share of a need earns above the rest, minimum_weight - 1; 0 where there is none.
crumb
    Amount below which what is left of another one may be rounding: that share of the largest.
return_to_base, charge_return
    The objective's switches.
timed
    Whether times of legs are given; otherwise they are lengths over speeds.
in_wind
    Whether the air length of a leg is time · speed, not the length over ground.
metric
    Whether no way over a third place is shorter, or takes less time, than the leg itself.
plans_loading
    Whether what a reload takes is decided with the plan.
"""

UAVS = np.dtype(
    [
        ("speed", "f8"),
        ("voyage", "f8"),
        ("dis", "f8"),
        ("ready", "f8"),
        ("until", "f8"),
        ("airborne", "f8"),
        ("endurance", "f8"),
        ("capacity", "f8"),
        ("start_home", "f8"),
        ("start_home_time", "f8"),
        ("leg_class", "i8"),
        ("watched", "?"),
        ("on_ground", "?"),
    ],
    align=True,
)
"""What a UAV has.

speed, dis
    As in the request.
voyage, endurance
    Range, and time that it may be in the air, without what has to be left after landing; the latter is
    infinite where there is no limit.
capacity
    Most weight that it leaves a base with, where loading is planned; infinite where there is no limit.
ready, until
    Its clock at the start, and the latest time to have landed; infinite where there is none.
airborne
    Time in the air at the start.
start_home, start_home_time
    Length of the leg from its current position to its starting point, 0 where there is none, and its time
    where times are given.
leg_class
    Class of its legs.
watched
    Whether ``until`` or ``endurance`` is a limit.
on_ground
    Whether it waits for its first visit on the ground.
"""

BASES = np.dtype([("turnaround", "f8")], align=True)
"""What a base has: the time from landing until a UAV takes off again."""

AREAS = np.dtype(
    [
        ("level", "f8"),
        ("unit", "f8"),
        ("need_total", "f8"),
        ("earliest", "f8"),
        ("deadline", "f8"),
        ("service", "f8"),
    ],
    align=True,
)
"""What holds for a target.

level
    What meeting the whole need at once earns: the emergency level, times the share of what was requested
    that is still needed, and what the first share earns above.
unit
    What a unit of material beyond the first share earns.
need_total
    Sum of the needs over materials; 0 for a target that needs nothing.
earliest, deadline, service
    As in the request; the deadline is infinite where there is none.
"""
