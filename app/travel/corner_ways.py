"""Shortest ways among the corners of zones: Dijkstra's algorithm from all corners at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class CornerWays:
    """For each of C corners the tree of shortest ways from it.

    Attributes
    ----------
    length
        (C, C), infinite where there is no way.
    previous
        (C, C) on the way from a corner to another, the corner before the other; at the first one itself.
    settled
        (C, C) from every corner the others, nearest first.
    """

    length: Floats
    previous: Integers
    settled: Integers

    @classmethod
    def among(cls, pieces: Floats) -> CornerWays:
        """Return the shortest ways.

        Parameters
        ----------
        pieces
            (C, C) lengths of straight pieces, symmetric; infinite where corners do not see each other.
        """
        count = len(pieces)
        every = np.arange(count)
        targets, lengths = padded(np.isfinite(pieces), pieces)
        length = np.full((count, count), np.inf)
        length[every, every] = 0.0
        previous = np.tile(every, (count, 1)).T.copy()
        waiting = length.copy()
        settled = np.empty((count, count), dtype=np.int64)
        for step in range(count):
            nearest = waiting.argmin(axis=1)
            # A corner that is not reached stands here more than once; it reaches nothing.
            settled[:, step] = nearest
            onward = length[every, nearest][:, None] + lengths[nearest]
            beyond = targets[nearest]
            row, slot = np.nonzero(onward < np.take_along_axis(length, beyond, axis=1))
            corner = beyond[row, slot]
            length[row, corner] = waiting[row, corner] = onward[row, slot]
            previous[row, corner] = nearest[row]
            waiting[every, nearest] = np.inf
        return cls(length, previous, settled)

    def sums(self, pieces: Floats) -> Floats:
        """Add up what each piece of the ways takes, along the ways from every corner, (C, C).

        Parameters
        ----------
        pieces
            (C, C) for the piece from a corner to another that follows it on a way.
        """
        every = np.arange(len(pieces))
        sums = np.full(pieces.shape, np.inf)
        sums[every, every] = 0.0
        for corner in self.settled[:, 1:].T:
            before = self.previous[every, corner]
            known = np.isfinite(self.length[every, corner]) & (corner != every)
            total = sums[every, before] + pieces[before, corner]
            sums[every[known], corner[known]] = total[known]
        return sums

    def between(self, first: int, last: int) -> list[int]:
        """Return the corners on the way from one to another, both included; there is a way."""
        way = [last]
        while way[-1] != first:
            way.append(int(self.previous[first, way[-1]]))
        return way[::-1]


def padded(chosen: Flags, lengths: Floats) -> tuple[Integers, Floats]:
    """List the chosen entries of every row, with their lengths, in as many columns as the longest list needs.

    Parameters
    ----------
    chosen, lengths
        (R, C).

    Returns
    -------
    columns, lengths
        (R, K), K at least 1. What is left of a row is column 0 at an infinite length.
    """
    width = max(1, int(chosen.sum(axis=1).max(initial=0)))
    rows, columns = np.nonzero(chosen)
    slots = (np.cumsum(chosen, axis=1) - 1)[rows, columns]
    listed = np.zeros((len(chosen), width), dtype=np.int64)
    found = np.full((len(chosen), width), np.inf)
    listed[rows, slots] = columns
    found[rows, slots] = lengths[rows, columns]
    return listed, found
