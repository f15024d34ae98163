"""Problems in which UAVs carry enough for all they visit, and all their routes, by brute force."""

import numpy as np

from app.domain.problem import UAV, Objective, Problem, Target


def parcels(
    rng: np.random.Generator,
    m: int = 3,
    n: int = 7,
    weight: float = 0.0,
    latest: float | None = 1.2,
    charge_return: bool = False,
    return_to_base: bool = False,
    voyage: float = 9.0,
    load: float | None = None,
    steps: int = 5,
) -> Problem:
    """UAVs of two kinds at one base, each with more than enough for every area, or for so many."""
    carried = (float(n) if load is None else load,)
    uavs = tuple(UAV(f"u{i}", 0.5, 0.5, 0.5, 0.5, 1.0 + i % 2, voyage, carried) for i in range(m))
    targets = tuple(
        Target(
            f"t{j}", *rng.random(2), float(rng.integers(1, 10)), (1.0,), deadline=latest, service_time=0.05
        )
        for j in range(n)
    )
    objective = Objective(weight, return_to_base=return_to_base, charge_return=charge_return)
    return Problem(uavs, targets, max_steps=min(n, steps), objective=objective)


def legal_routes(problem: Problem, i: int) -> dict[frozenset[int], float]:
    """The sets of targets that a UAV can visit in time and range, and the least charged distance of each."""
    uav, objective = problem.uavs[i], problem.objective
    base = np.array([uav.x_s, uav.y_s])
    at = [np.array([t.x, t.y]) for t in problem.targets]
    best: dict[frozenset[int], float] = {}

    def extend(route, place, flown, clock):
        for j, target in enumerate(problem.targets):
            if j in route or len(route) == problem.max_steps or len(route) + 1 > uav.loadlist[0]:
                continue
            leg = float(np.hypot(*(at[j] - place)))
            home = float(np.hypot(*(at[j] - base)))
            arrival = clock + leg / uav.speed
            late = target.deadline is not None and arrival > target.deadline
            if late or flown + leg + home * objective.return_to_base > uav.voyage:
                continue
            charged = flown + leg + home * objective.charge_return
            key = frozenset({*route, j})
            best[key] = min(best.get(key, np.inf), charged)
            extend([*route, j], at[j], flown + leg, arrival + target.service_time)

    extend([], np.array([uav.x_c, uav.y_c]), 0.0, 0.0)
    return best
