"""Generated problems of the second edition: each has what its family is for, and can be flown."""

import numpy as np
import pytest

from app.domain.world_use import uses_world
from app.simulation.evaluation import reward_of
from app.simulation.world_generator import WORLD_FAMILIES
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import never

SOLVER = create_solver("greedy", parse_parameters("greedy", {}), SolverContext())

HAS = {
    "windows": lambda p: any(t.earliest for t in p.targets) and all(u.endurance for u in p.uavs),
    "zones": lambda p: len(p.no_fly_zones) == 4,
    "windy": lambda p: p.wind.speed < min(u.speed for u in p.uavs),
    "promised": lambda p: any(t.skills for t in p.targets) and any(u.excluded for u in p.uavs),
    "partly": lambda p: any(t.requested != t.loadlist for t in p.targets) and p.objective.minimum_share,
    "matrix": lambda p: {u.profile for u in p.uavs} == set(p.matrices),
    "sorties": lambda p: len(p.bases) == 1 and p.bases[0].stock is None,
    "stock": lambda p: all(b.stock for b in p.bases) and any(not any(u.loadlist) for u in p.uavs),
    "loading": lambda p: p.plans_loading and not any(any(u.loadlist) for u in p.uavs),
    "fair": lambda p: p.objective.half_life and p.objective.minimum_share,
}


@pytest.mark.parametrize("family", WORLD_FAMILIES)
def test_problems_have_what_their_family_is_for(family):
    for number in range(5):
        problem = WORLD_FAMILIES[family](8, 16, 2, np.random.default_rng(number))
        assert uses_world(problem)
        assert HAS[family](problem)
        assert reward_of(problem, SOLVER.solve(problem, 1, never, lambda _told: None).plan) > 0
    again = WORLD_FAMILIES[family](8, 16, 2, np.random.default_rng(number))
    assert again == problem
