"""Which places and corners have a straight way between them.

Each pair is held against the outlines whose circle it crosses, edge by edge: a piece of a line crosses an
edge where the ends of each lie on different sides of the other. On which side of an edge a point lies is
worked out once for all pairs. An outline is narrower than what must not be entered, so that nothing here
hangs on the last digit.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.travel.obstacles import TOLERANCE, Contact, Obstacles, Outline

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

PAIRS_AT_ONCE = 1 << 15
"""So many pairs keep what is worked out for them in the processor's cache."""


class Sight:
    """Sight between P points past obstacles.

    Parameters
    ----------
    obstacles
        What is in the way.
    points
        In the plane, (P, 2); none inside an obstacle.
    """

    def __init__(self, obstacles: Obstacles, points: Floats) -> None:
        self._outlines = obstacles.outlines
        self._contacts = obstacles.contacts
        self._x, self._y = np.ascontiguousarray(points.T)
        self._facing = [_facing(outline, points) for outline in self._outlines]
        self._side = [_side(contact, points) for contact in self._contacts]

    def free(self, a: Integers, b: Integers) -> Flags:
        """Return for Q pairs whether the straight way from one point to the other is free.

        Parameters
        ----------
        a, b
            (Q,) indices of points.
        """
        free = np.ones(len(a), dtype=np.bool_)
        for begin in range(0, len(a), PAIRS_AT_ONCE):
            some = slice(begin, begin + PAIRS_AT_ONCE)
            free[some] = self._free(a[some], b[some])
        return free

    def _free(self, a: Integers, b: Integers) -> Flags:
        x, y = self._x[a], self._y[a]
        dx, dy = self._x[b] - x, self._y[b] - y
        length = np.hypot(dx, dy)
        offset = dx * y - dy * x
        free = np.ones(len(a), dtype=np.bool_)
        for outline, facing in zip(self._outlines, self._facing, strict=True):
            (x_0, y_0), radius = outline.centre, outline.radius
            # The last term is more than the rounding of the others.
            near = np.abs(dx * y_0 - dy * x_0 - offset) <= radius * length + 1e-15
            along = dx * x_0 + dy * y_0 - (dx * x + dy * y)
            reach = radius * length + 1e-15
            near &= free & (along >= -reach) & (along <= length * length + reach)
            hit = np.flatnonzero(near)
            if len(hit):
                crossed = _crosses(outline, x[hit], y[hit], dx[hit], dy[hit], facing[a[hit]], facing[b[hit]])
                free[hit[crossed]] = False
        for contact, side in zip(self._contacts, self._side, strict=True):
            (x_0, y_0), radius = contact.point, contact.radius
            along = dx * (x_0 - x) + dy * (y_0 - y)
            near = np.abs(dx * (y_0 - y) - dy * (x_0 - x)) <= radius * length
            near &= (along > 2 * radius * length) & (along < length * (length - 2 * radius))
            free &= ~(near & (side[a] != side[b]))
        return free


def _facing(outline: Outline, points: Floats) -> Flags:
    """Return for each of P points and E edges of an outline whether the point lies to the left, (P, E)."""
    begin = outline.points[:-1]
    dx, dy = np.diff(outline.points, axis=0).T
    return np.asarray(dx * (points[:, 1:] - begin[:, 1]) > dy * (points[:, :1] - begin[:, 0]))


def _crosses(
    outline: Outline, x: Floats, y: Floats, dx: Floats, dy: Floats, facing_a: Flags, facing_b: Flags
) -> Flags:
    """Return for Q pieces of lines whether they cross an outline.

    Parameters
    ----------
    outline
        With E edges.
    x, y, dx, dy
        (Q,) where they begin, and how far they go.
    facing_a, facing_b
        (Q, E) on which side of the edges they begin and end.
    """
    corner_x, corner_y = outline.points.T
    left = dx[:, None] * (corner_y - y[:, None]) > dy[:, None] * (corner_x - x[:, None])
    crossed = (left[:, 1:] != left[:, :-1]) & (facing_a != facing_b)
    return np.asarray(crossed.any(axis=1))


def _side(contact: Contact, points: Floats) -> Integers:
    """Return on which side of a contact each point lies, (P,)."""
    angle = np.arctan2(points[:, 1] - contact.point[1], points[:, 0] - contact.point[0])
    return np.searchsorted(contact.walls, angle) % len(contact.walls)


def bends_around(towards: Floats, neighbours: Floats) -> Flags:
    """Return whether a way that turns at a corner could be a shortest one.

    It is where the border lies on one side of it: a way that could be pulled tight is longer than another.

    Parameters
    ----------
    towards
        (..., 2) from a place to a corner.
    neighbours
        (..., 2, 2) from the corner along the border, either way.
    """
    x, y = towards[..., 0], towards[..., 1]
    left, right = (x * neighbours[..., k, 1] - y * neighbours[..., k, 0] for k in range(2))
    # Along a side one of them is 0 up to rounding: then the way turns, or goes straight on.
    slack = TOLERANCE * np.hypot(x, y)
    return np.asarray((np.minimum(left, right) >= -slack) | (np.maximum(left, right) <= slack))
