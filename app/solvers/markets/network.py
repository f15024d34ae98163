"""Which UAVs hear each other, and which messages arrive."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from app.domain.problem import Problem
from app.simulation.arrays import Flags, Floats
from app.simulation.distances import between_points


@dataclass(slots=True)
class Network:
    """Messages between UAVs.

    Attributes
    ----------
    hears
        (M, M) whether UAV i hears UAV k; nobody hears itself.
    loss
        Probability that a message is lost.
    delay
        Rounds that a message takes beyond the one in which it is sent.
    rng
        Decides which are lost.
    sent
        Messages so far, lost ones among them.
    """

    hears: Flags
    loss: float
    delay: int
    rng: np.random.Generator
    sent: int = field(default=0)

    def arriving(self, shape: tuple[int, ...]) -> Flags:
        """Draw which messages of an array of links arrive."""
        if self.loss == 0.0:
            return np.ones(shape, np.bool_)
        return np.asarray(self.rng.random(shape) >= self.loss)

    def neighbours(self, i: int) -> npt.NDArray[np.int64]:
        """List the UAVs that hear UAV `i`."""
        return np.flatnonzero(self.hears[:, i])


def network_of(
    problem: Problem, reach: float | None, loss: float, delay: int, rng: np.random.Generator
) -> Network:
    """Connect the UAVs that are not farther apart than `reach`, where they are now; all where it is None."""
    m = problem.n_uavs
    hears = np.ones((m, m), np.bool_)
    if reach is not None:
        hears = _apart(problem) <= reach
    np.fill_diagonal(hears, False)
    return Network(hears, loss, delay, rng)


def _apart(problem: Problem) -> Floats:
    at = np.array([(uav.x_c, uav.y_c) for uav in problem.uavs])
    return between_points(problem.crs, at, at)


def manager_of(problem: Problem) -> npt.NDArray[np.int64]:
    """Return for each area, (N,), the UAV that is nearest to it now: it found the area, and announces it."""
    uavs = np.array([(uav.x_c, uav.y_c) for uav in problem.uavs])
    areas = np.array([(target.x, target.y) for target in problem.targets])
    return np.asarray(between_points(problem.crs, uavs, areas).argmin(axis=0))
