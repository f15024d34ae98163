"""Lines and polygons of the globe, cut where they cross the meridian opposite to Greenwich."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

Point = tuple[float, float]


def cut_line(places: Sequence[Point]) -> list[list[Point]]:
    """Cut a line where it crosses the antimeridian; every leg takes the shorter way round."""
    lines = [[places[0]]]
    for (x_a, y_a), (x_b, y_b) in pairwise(places):
        if abs(x_b - x_a) > 180.0:
            edge = 180.0 if x_a > 0 else -180.0
            there = x_b + 2 * edge
            y = y_a if there == x_a else y_a + (y_b - y_a) * (edge - x_a) / (there - x_a)
            lines[-1].append((edge, y))
            lines.append([(-edge, y)])
        lines[-1].append((x_b, y_b))
    return lines


def cut_ring(corners: Sequence[Point]) -> list[list[Point]]:
    """Cut a polygon where it crosses the antimeridian; every side takes the shorter way round.

    Parameters
    ----------
    corners
        In order, the first one not repeated.

    Returns
    -------
    list
        One ring, or one on either side. One that goes round a pole has no two sides, and stays as it is.
    """
    around, turns = [corners[0]], 0.0
    for (x_a, _), (x_b, y_b) in pairwise([*corners, corners[0]]):
        turns += 360.0 if x_b - x_a < -180.0 else -360.0 if x_b - x_a > 180.0 else 0.0
        around.append((x_b + turns, y_b))
    around.pop()
    if turns:
        return [list(corners)]
    west, east = min(x for x, _ in around), max(x for x, _ in around)
    if west >= -180.0 and east <= 180.0:
        return [around]
    edge = 180.0 if east > 180.0 else -180.0
    sides = [_side(around, edge, sign) for sign in (1.0, -1.0)]
    beyond = sides[0] if edge > 0 else sides[1]
    within = sides[1] if edge > 0 else sides[0]
    return [within, [(x - 2 * edge, y) for x, y in beyond]]


def _side(ring: Sequence[Point], edge: float, sign: float) -> list[Point]:
    """Return the part of a ring to the east (1) or west (-1) of a meridian."""
    kept: list[Point] = []
    for (x_a, y_a), (x_b, y_b) in pairwise([*ring, ring[0]]):
        a, b = sign * (x_a - edge), sign * (x_b - edge)
        if a >= 0:
            kept.append((x_a, y_a))
        if a * b < 0:
            kept.append((edge, y_a + (y_b - y_a) * a / (a - b)))
    return kept


def closed(ring: Sequence[Point]) -> list[Point]:
    """Return a ring counter-clockwise and with its first corner again at its end, as the format has it."""
    area = sum(x_a * y_b - x_b * y_a for (x_a, y_a), (x_b, y_b) in pairwise([*ring, ring[0]]))
    corners = list(ring) if area >= 0 else list(ring)[::-1]
    return [*corners, corners[0]]
