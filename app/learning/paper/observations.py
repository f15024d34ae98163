"""States as the networks see them: Eqs. 10-12 at any moment of an episode.

The fixed parts are those of the task description that the library compares (:mod:`app.library.description`),
so at the beginning of an episode the state is the description. Amounts and flown distances change by the
same scales. Observations (Eq. 13) are parts of the state, so nothing else is stored.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.domain.problem import Problem
from app.domain.world_use import require_unused
from app.learning.paper.architecture import TARGET_FIELDS, UAV_FIELDS
from app.learning.paper.observed import unobserved
from app.library.description import task_description
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.visit import START

Float32s = npt.NDArray[np.float32]

LARGEST_SHARE = 1e6
"""Bound of a distance flown, in largest voyages, as in the description: a float32 stays finite."""


class Features(NamedTuple):
    """What the states of one problem are made of.

    Attributes
    ----------
    uavs
        (M, 8+K) scaled rows of the UAVs in the request (Eq. 11).
    targets
        (N, 3+K) scaled rows of the targets in the request (Eq. 12).
    largest_voyage, largest_amount
        (1,) what distances flown and amounts are divided by; 1 where all are zero.
    """

    uavs: Float32s
    targets: Float32s
    largest_voyage: npt.NDArray[np.float64]
    largest_amount: npt.NDArray[np.float64]


def features_of(problem: Problem) -> Features:
    """Describe a problem for :func:`write_states`.

    Raises
    ------
    InvalidProblem
        If its reward does not follow from what is observed; :mod:`app.learning.paper.observed`.
    """
    require_unused(problem, unobserved())
    m, n, k = problem.n_uavs, problem.n_targets, problem.n_materials
    description = task_description(problem).astype(np.float32)
    n_own = m * (UAV_FIELDS + k)
    largest_voyage = max(u.voyage for u in problem.uavs)
    loads = [uav.loadlist for uav in problem.uavs] + [target.need for target in problem.targets]
    return Features(
        uavs=description[:n_own].reshape(m, UAV_FIELDS + k),
        targets=description[n_own:].reshape(n, TARGET_FIELDS + k),
        largest_voyage=np.array([largest_voyage or 1.0]),
        largest_amount=np.array([np.max(loads) or 1.0]),
    )


@compiled
def write_states(features: Features, episodes: Episodes, out: Float32s) -> None:
    """Write the state of every episode at this moment.

    Parameters
    ----------
    features
        Of the problem that all the episodes are of.
    episodes
        B of them.
    out
        (B, D), overwritten: M rows of UAVs, then N rows of targets.
    """
    m, n_fields = features.uavs.shape
    n, n_target_fields = features.targets.shape
    largest_voyage, largest_amount = features.largest_voyage[0], features.largest_amount[0]
    for b in range(out.shape[0]):
        column = 0
        for i in range(m):
            for f in range(n_fields):
                out[b, column + f] = features.uavs[i, f]
            at = episodes.at[b, i]
            if at == n:
                out[b, column + 2] = features.uavs[i, 0]
                out[b, column + 3] = features.uavs[i, 1]
            elif at != START:
                out[b, column + 2] = features.targets[at, 0]
                out[b, column + 3] = features.targets[at, 1]
            out[b, column + 6] = min(episodes.flown[b, i] / largest_voyage, LARGEST_SHARE)
            out[b, column + 7] = 1.0 if episodes.ret[b, i] else 0.0
            for k in range(episodes.load.shape[2]):
                out[b, column + 8 + k] = episodes.load[b, i, k] / largest_amount
            column += n_fields
        for j in range(n):
            for f in range(3):
                out[b, column + f] = features.targets[j, f]
            for k in range(episodes.need.shape[2]):
                out[b, column + 3 + k] = episodes.need[b, j, k] / largest_amount
            column += n_target_fields
