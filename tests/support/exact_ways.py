"""Shortest ways round zones in rational numbers: slow, and independent of the service's.

Everything hangs on one question: whether a way may pass a point, coming from one direction and leaving in
another. It may not where zones lie on its left and on its right, however near to the point: then the point
is inside their union, or they touch there. A straight piece is free if it may pass the middle of every
stretch between two borders that it meets, and the points where it meets them. A way may turn at a corner if
it may pass it so.

Integers are much faster than fractions. So the plane is scaled until all corners are integers, and a point
inside is `(x, y, w)`, which stands for `(x / w, y / w)`; of a direction only the ratio counts.
"""

import heapq
import math
from fractions import Fraction
from itertools import pairwise

Point = tuple[Fraction, Fraction]


class ExactWays:
    """Ways round zones that are given by corners with rational coordinates; no two sides of one cross.

    `measure` is the length of a straight piece, where that is not what it is on this plane.
    """

    def __init__(self, zones, measure=math.dist):
        self.measure = measure
        zones = [[exact(corner) for corner in zone] for zone in zones]
        self.corners = sorted({corner for zone in zones for corner in zone})
        self._scale = math.lcm(*(value.denominator for corner in self.corners for value in corner))
        self.zones = [[self._scaled(corner) for corner in zone] for zone in zones]
        self.edges = [edge for zone in self.zones for edge in zip(zone, zone[1:] + zone[:1], strict=True)]
        self._free = {}

    def length(self, a, b):
        """Length of the shortest way; infinite where there is none."""
        return self.way(a, b)[0]

    def way(self, a, b):
        """Length of the shortest way, and its points; infinite and None where there is none."""
        a, b = exact(a), exact(b)
        if self.inside(a) or self.inside(b):
            return math.inf, None
        if a == b or self.free(a, b):
            return self.measure(a, b), (a, b)
        done = set()
        heap = [(self.measure(a, c), (a, c)) for c in self.corners if c != a and self.free(a, c)]
        heapq.heapify(heap)
        while heap:
            length, points = heapq.heappop(heap)
            before, here = points[-2:]
            if (before, here) in done:
                continue
            done.add((before, here))
            if here == b:
                return length, points
            for onward in (b, *self.corners):
                if (
                    onward not in (here, before)
                    and (here, onward) not in done
                    and self.free(here, onward)
                    and self._may_turn(before, here, onward)
                ):
                    heapq.heappush(heap, (length + self.measure(here, onward), (*points, onward)))
        return math.inf, None

    def inside(self, point):
        """Whether a point lies in the interior of the union."""
        return all(solid for _, _, solid in self._around(self._scaled(point), [(1, 0), (-1, 0), (0, 1)]))

    def free(self, a, b):
        """Whether the straight way between two different points is free."""
        key = (a, b) if a <= b else (b, a)
        if key not in self._free:
            self._free[key] = self._is_free(*map(self._scaled, key))
        return self._free[key]

    def _scaled(self, point):
        x, y = (value * self._scale for value in point)
        w = math.lcm(x.denominator, y.denominator)
        return (int(x * w), int(y * w), w)

    def _is_free(self, a, b):
        way = minus(b, a)
        whole = Fraction(a[2] * b[2])  # how often the way itself goes into its direction
        met = {Fraction(0), 1 / whole}
        for c, d in self.edges:
            met.update(t for t in meetings(a, way, c, d) if 0 < t * whole < 1)
        met = sorted(met)
        tried = met[1:-1] + [(s + t) / 2 for s, t in pairwise(met)]
        back = (-way[0], -way[1])
        return all(self.may_pass(along(a, t, way), back, way) for t in tried)

    def _may_turn(self, before, here, onward):
        before, here, onward = map(self._scaled, (before, here, onward))
        return self.may_pass(here, minus(before, here), minus(onward, here))

    def may_pass(self, point, back, ahead):
        """Whether a way from the direction `back` to the direction `ahead` may pass a point."""
        if turn(back, ahead) == 0 and dot(back, ahead) > 0:
            return True
        around = self._around(point, [back, ahead])
        k = next(k for k, (left, _, _) in enumerate(around) if same(left, back))
        solid = [False, False]
        side = 0
        for left, _, filled in around[k:] + around[:k]:
            side = 1 if same(left, ahead) else side
            solid[side] |= filled
        return not all(solid)

    def _around(self, point, directions):
        """Sectors around a point between directions and borders: from, to, and whether they are solid."""
        borders = [minus(end, point) for c, d in self.edges if on(point, c, d) for end in (c, d)]
        directions = [*directions, *(border for border in borders if border != (0, 0))]
        distinct = []
        for direction in sorted(directions, key=Angle):
            if not distinct or not same(distinct[-1], direction):
                distinct.append(direction)
        # Where no border is, all around the point is as the point is.
        everywhere = None if borders else self._in_a_zone(point)
        sectors = []
        for left, right in zip(distinct, distinct[1:] + distinct[:1], strict=True):
            between = (left[0] + right[0], left[1] + right[1])
            if turn(left, right) < 0:
                between = (-between[0], -between[1])
            elif turn(left, right) == 0:
                between = (-left[1], left[0])
            solid = self._solid(point, between) if everywhere is None else everywhere
            sectors.append((left, right, solid))
        return sectors

    def _solid(self, point, direction):
        """Whether points in a direction, which is that of no border, are inside a zone however near."""
        ahead = [t for c, d in self.edges for t in meetings(point, direction, c, d) if t > 0]
        return self._in_a_zone(along(point, min(ahead, default=Fraction(1)) / 2, direction))

    def _in_a_zone(self, point):
        return any(odd(point, zone) for zone in self.zones)


class Angle:
    """Sorts directions counter-clockwise from east."""

    def __init__(self, direction):
        self.direction = direction
        x, y = direction
        self.half = 0 if y > 0 or (y == 0 and x > 0) else 1

    def __lt__(self, other):
        if self.half != other.half:
            return self.half < other.half
        return turn(self.direction, other.direction) > 0


def exact(point) -> Point:
    return (Fraction(point[0]), Fraction(point[1]))


def minus(a, b):
    """The direction from a point to another: their difference times both of their `w`."""
    return (a[0] * b[2] - b[0] * a[2], a[1] * b[2] - b[1] * a[2])


def along(a, t, way):
    """The point that lies `t` times a direction away."""
    p, q = t.numerator, t.denominator
    return (a[0] * q + p * way[0] * a[2], a[1] * q + p * way[1] * a[2], a[2] * q)


def turn(a, b):
    return a[0] * b[1] - a[1] * b[0]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1]


def same(a, b):
    return turn(a, b) == 0 and dot(a, b) > 0


def on(point, c, d):
    """Whether a point lies on a side, its ends included."""
    return turn(minus(point, c), minus(d, c)) == 0 and dot(minus(point, c), minus(point, d)) <= 0


def meetings(a, way, c, d):
    """How far along a line, in lengths of `way`, it meets a side: once, at both ends of it, or never."""
    side, gap = minus(d, c), minus(c, a)
    across, beside = turn(way, side), turn(gap, way)
    if across == 0:
        if beside != 0:
            return []
        return [Fraction(dot(minus(end, a), way), dot(way, way) * a[2]) for end in (c, d)]
    if across < 0:
        across, beside, side = -across, -beside, (-side[0], -side[1])
    # The side's ends are integers, so that only the `w` of the point is in the gap.
    return [Fraction(turn(gap, side), across * a[2])] if 0 <= beside <= across * a[2] else []


def odd(point, zone):
    """Whether a point, not on the border, is inside a zone: a line from it crosses an odd number of sides."""
    x, y, w = point
    inside = False
    for (ax, ay, _), (bx, by, _) in zip(zone, zone[1:] + zone[:1], strict=True):
        if (ay * w > y) != (by * w > y):
            left = (x - ax * w) * (by - ay) < (y - ay * w) * (bx - ax)
            inside ^= left == (by > ay)
    return inside
