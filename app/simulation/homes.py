"""Where a UAV lands: at its starting point or, if that is nearer in the air, at a base that it may use."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.domain.problem import Problem
from app.simulation.legs import UNREACHABLE, Floats, LegArrays

AT_START = -1
"""In place of a base: a UAV lands at its starting point."""


def usable_bases(problem: Problem) -> npt.NDArray[np.bool_]:
    """Return which bases each UAV may use, (M, D)."""
    return np.array(
        [
            [uav.bases is None or base.id in allowed for base in problem.bases]
            for uav in problem.uavs
            for allowed in [frozenset(uav.bases or ())]
        ],
        np.bool_,
    ).reshape(problem.n_uavs, problem.n_bases)


class Homes(NamedTuple):
    """Where UAVs land from: the number of a base, or ``AT_START``.

    Attributes
    ----------
    from_stop
        (M, L) from each target and base, numbered as actions are.
    from_now
        (M,) from where the request has them.
    """

    from_stop: npt.NDArray[np.int64]
    from_now: npt.NDArray[np.int64]


def nearest_homes(problem: Problem, legs: LegArrays) -> tuple[LegArrays, Homes]:
    """Return legs whose ways home lead to the nearest home, and whose stops are numbered as actions are.

    With D bases there are N + 1 + D stops instead of N + D: number N has no legs.

    Parameters
    ----------
    problem
        A problem with bases.
    legs
        Its legs, with ways home to starting points alone.
    """
    n, (nearest, homes) = problem.n_targets, _to_nearest(problem, legs)
    return _numbered_as_actions(nearest, n), homes._replace(
        from_stop=np.insert(homes.from_stop, n, AT_START, axis=1)
    )


def _to_nearest(problem: Problem, legs: LegArrays) -> tuple[LegArrays, Homes]:
    speed, of = np.array([uav.speed for uav in problem.uavs]), legs.leg_class
    ends = _Ends(legs.home.copy(), legs.home_time.copy(), legs.homeless.copy(), speed[:, None], legs)
    starts = _Ends(
        legs.start_home[:, None].copy(), legs.start_home_time[:, None].copy(),
        legs.homeless_start[:, None].copy(), speed[:, None], legs,
    )  # fmt: skip
    for d, allowed in enumerate(usable_bases(problem).T):
        stop = problem.n_targets + d
        time, start_time = None, None
        if legs.timed:
            time, start_time = legs.between_time[of, :, stop], legs.start_time[:, stop, None]
        ends.offer(d, allowed, legs.between[of, :, stop], time)
        starts.offer(d, allowed, legs.start_target[:, stop, None], start_time)
        # Who is at a base has nothing to fly, also where a matrix has no way from a place to itself.
        here = allowed & (legs.between[of, stop, stop] >= UNREACHABLE)
        ends.length[here, stop], ends.missing[here, stop], ends.base[here, stop] = 0.0, False, d
        if legs.timed:
            ends.time[here, stop] = 0.0
    found = legs._replace(
        home=ends.length, home_time=ends.time, homeless=ends.missing, start_home=starts.length[:, 0],
        start_home_time=starts.time[:, 0] if legs.timed else legs.start_home_time,
        homeless_start=starts.missing[:, 0],
    )  # fmt: skip
    return found, Homes(ends.base, starts.base[:, 0])


class _Ends:
    """Ways home so far, (M, X) of everything; `speed` is (M, 1)."""

    def __init__(
        self, length: Floats, time: Floats, missing: npt.NDArray[np.bool_], speed: Floats, legs: LegArrays
    ) -> None:
        self.length, self.time, self.missing = length, time, missing
        self._speed, self._timed, self._in_wind = speed, legs.timed, legs.in_wind
        self.base = np.full(length.shape, AT_START, np.int64)
        self._air = np.where(missing, np.inf, time * speed if legs.in_wind else length)

    def offer(self, d: int, allowed: npt.NDArray[np.bool_], length: Floats, time: Floats | None) -> None:
        """Take base `d` as home where it is nearer in the air, and allowed."""
        air = time * self._speed if self._in_wind and time is not None else length
        nearer = allowed[:, None] & (length < UNREACHABLE) & (air < self._air)
        self._air[nearer], self.length[nearer], self.missing[nearer] = air[nearer], length[nearer], False
        self.base[nearer] = d
        if time is not None:
            self.time[nearer] = time[nearer]


def _numbered_as_actions(legs: LegArrays, n: int) -> LegArrays:
    """Make room for number N, the action that sends a UAV home, which is no stop."""
    between, between_time = legs.between, legs.between_time
    for axis in (1, 2):
        between = np.insert(between, n, UNREACHABLE, axis=axis)
        between_time = np.insert(between_time, n, UNREACHABLE, axis=axis) if legs.timed else between_time
    out, out_time, back_time = legs.start_target, legs.start_time, legs.home_time
    if legs.timed:
        out_time, back_time = (
            np.insert(out_time, n, UNREACHABLE, axis=1),
            np.insert(back_time, n, 0.0, axis=1),
        )
    return legs._replace(
        start_target=np.insert(out, n, UNREACHABLE, axis=1), between=between, between_time=between_time,
        start_time=out_time, home=np.insert(legs.home, n, 0.0, axis=1), home_time=back_time,
        homeless=np.insert(legs.homeless, n, True, axis=1),
    )  # fmt: skip
