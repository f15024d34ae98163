"""Task descriptions: the vectors that Algorithm 2 compares to find the most similar source task."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from app.domain.geometry import unrolled
from app.domain.problem import Problem

PAPER_SPACE = "task-description-1"
"""Kind and version of the features; with the size appended it names the space of comparable vectors."""

_LARGEST_SHARE = 1e6
"""Bound of what can exceed 1: a distance flown, against the largest voyage. Keeps single precision finite."""


def description_space(problem: Problem) -> str:
    """Name the space of a problem's description: only tasks of the same M, N and K can be compared."""
    return f"{PAPER_SPACE}/{problem.n_uavs}x{problem.n_targets}x{problem.n_materials}"


def task_description(problem: Problem) -> npt.NDArray[np.float64]:
    """Flatten the state of Eqs. 10-12: all UAV rows, then all target rows, in the problem's own scale.

    Positions are measured from the low corner of the bounding box of all positions, in diagonals of that
    box; voyages and distances flown in the largest voyage; speeds, amounts and levels in the largest of
    their kind. So the description does not depend on units, nor on where on the map a task lies. What is
    zero for everybody stays zero.

    Parameters
    ----------
    problem
        M UAVs, N targets, K materials.

    Returns
    -------
    numpy.ndarray
        Shape (M · (8 + K) + N · (3 + K),), finite. A UAV's row is x_s, y_s, x_c, y_c, speed, voyage, dis,
        ret and its load; a target's x, y, level and its need.
    """
    uavs, targets = problem.uavs, problem.targets
    places = np.array(
        [(u.x_s, u.y_s) for u in uavs] + [(u.x_c, u.y_c) for u in uavs] + [(t.x, t.y) for t in targets],
        dtype=np.float64,
    )
    places[:, 0] = unrolled(problem.crs, places[:, 0])
    starts, current, areas = np.split(places, [len(uavs), 2 * len(uavs)])  # (M, 2), (M, 2), (N, 2)
    low, high = places.min(axis=0), places.max(axis=0)
    diagonal = math.hypot(*(high - low)) or 1.0

    loads = np.array([u.loadlist for u in uavs])  # (M, K)
    needs = np.array([t.need for t in targets])  # (N, K)
    largest_amount = max(loads.max(), needs.max()) or 1.0
    voyages = np.array([u.voyage for u in uavs])
    largest_voyage = voyages.max() or 1.0
    flown = np.minimum([u.dis for u in uavs], largest_voyage * _LARGEST_SHARE) / largest_voyage
    speeds = np.array([u.speed for u in uavs])
    levels = np.array([t.urgency for t in targets])

    uav_rows = np.column_stack(
        [
            (starts - low) / diagonal,
            (current - low) / diagonal,
            speeds / speeds.max(),
            voyages / largest_voyage,
            flown,
            [float(u.ret) for u in uavs],
            loads / largest_amount,
        ]
    )  # (M, 8 + K)
    target_rows = np.column_stack(
        [(areas - low) / diagonal, levels / (levels.max() or 1.0), needs / largest_amount]
    )  # (N, 3 + K)
    return np.concatenate([uav_rows.ravel(), target_rows.ravel()])
