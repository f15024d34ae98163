"""How good an answer is: the bound that a request may ask for beside the plan."""

from __future__ import annotations

import math
from typing import Any

from app.domain.problem import Problem
from app.solvers.bound.instance import new_instance
from app.solvers.bound.upper_bound import gap, upper_bound
from app.solvers.bound.visits import visit_bound
from app.solvers.protocol import Proof, StopCriterion
from app.solvers.stop import Deadline, EarlierOf, never

_LARGEST_SHARE = 1 / 3
"""Of the time limit of a request, kept for the bound; what the search leaves is the bound's too."""


def kept_for_bound(limit_s: float | None, left_s: float) -> float:
    """Return the seconds of those left that the search leaves to the bound.

    Parameters
    ----------
    limit_s
        How long the bound may take; None: no bound is asked for.
    left_s
        Seconds until the request's time is up.
    """
    return 0.0 if limit_s is None else min(limit_s, _LARGEST_SHARE * max(0.0, left_s))


def bound_answer(
    problem: Problem, reward: float, limit_s: float | None, stop: StopCriterion
) -> dict[str, Any]:
    """Return the bound by the field names of ``POST /allocate``; nulls where it was not asked for.

    Parameters
    ----------
    problem
        The problem.
    reward
        Of the plan in the answer.
    limit_s
        Seconds it may take, or None as above.
    stop
        When true, the bound so far is the answer.
    """
    if limit_s is None:
        return {"bound": None, "gap": None}
    if stop():
        bound = max(everything(problem), reward)
        return {"bound": bound, "gap": gap(bound, reward)}
    found = upper_bound(problem, reward, EarlierOf(stop, Deadline(limit_s)))
    # The units that the bound is computed in may round a reward that is reached away by a hair.
    bound = max(found.value, reward)
    return {"bound": bound, "gap": gap(bound, reward)}


def everything(problem: Problem) -> float:
    """Return what meeting every need would earn if nobody had to fly for it: a bound that takes no time."""
    objective = problem.objective
    most = 1.0 + (objective.minimum_weight - 1.0) * objective.minimum_share
    return most * math.fsum(target.level for target in problem.targets if any(target.loadlist))


def proof_answer(proof: Proof | None) -> dict[str, Any] | None:
    """Return what the algorithm knows of plans that it has not found."""
    if proof is None:
        return None
    return {"bound": proof.bound, "proven": proof.proven}


def warm_up(problem: Problem) -> None:
    """Load and compile what bounds of any size need."""
    upper_bound(problem, None, never)
    visit_bound(new_instance(problem), 0.0, never)
