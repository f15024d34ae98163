"""What no plan's satisfaction exceeds: by it, many changes are known to be no good before they are made."""

from __future__ import annotations

import numpy as np

from app.domain.problem import TOLERANCE
from app.simulation.arrays import ProblemArrays
from app.simulation.visit import first_visits
from app.simulation.worth import worths


def most_satisfaction(arrays: ProblemArrays) -> float:
    """Return an upper bound on the satisfaction of any plan, whatever the unloading rule.

    Each material by itself goes to where a unit earns most, as far as what all UAVs carry of it lasts; a
    target gets what it needs if any UAV with that material can fly there first: no way there is shorter. At
    bases there is more of it.

    Parameters
    ----------
    arrays
        A stack of one problem.
    """
    wanted = arrays.areas["need_total"][0] > 0
    worth = worths(arrays)[wanted]
    need = arrays.need[0][wanted]
    load = np.where(arrays.ret[0][:, None], 0.0, arrays.load[0])
    direct = first_visits(arrays)[:, wanted]
    supply = load.sum(axis=0) + arrays.stock[0].sum(axis=0)
    load = load + (~arrays.ret[0])[:, None] * arrays.full[0] * (arrays.stock[0] > 0).any(axis=0)
    # As a product of matrices: with many materials much quicker than looking at each UAV's.
    served = direct.T.astype(np.float32) @ (load > 0).astype(np.float32) > 0
    order = np.argsort(-worth, kind="stable")
    most = np.where(served, need, 0.0)[order]
    before = np.cumsum(most, axis=0) - most
    unloaded = np.clip(supply - before, 0.0, most)
    return float((worth[order] @ unloaded).sum()) * (1.0 + TOLERANCE)
