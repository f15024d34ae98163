"""Promised visits where amounts are planned: they unload something, however little they earn."""

import pytest

from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Base
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import replay_at_best, reward_of
from app.simulation.explain import explain
from app.simulation.visit import ALLOWED
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import Never

PLANNED = Objective(unloading="planned", distance_weight=0.01, charge_return=True)
CHEAP = Target("cheap", 1, 0, level=0.01, loadlist=(4.0,))
DEAR = Target("dear", 2, 0, level=5.0, loadlist=(5.0,))
HAWK = UAV("hawk", 0, 0, 0, 0, speed=1.0, voyage=9.0, loadlist=(5.0,), committed=("cheap",))
KITE = UAV("kite", 0, 0, 0, 0, speed=1.0, voyage=9.0, loadlist=(4.0,))
PROMISED = Problem(uavs=(HAWK,), targets=(CHEAP, DEAR), objective=PLANNED)
BOTH = Plan(((0,), (1,)))
LEGAL_AT_LEAST = {
    "one UAV": (PROMISED, BOTH),
    "what another one brings": (
        Problem(uavs=(HAWK, KITE), targets=(CHEAP, DEAR), objective=PLANNED),
        Plan(((0, 0), (1, 2))),
    ),
    "worth nothing": (
        Problem(uavs=(HAWK,), targets=(Target("cheap", 1, 0, 0.0, (4.0,)), DEAR), objective=PLANNED),
        BOTH,
    ),
    "loads that are planned": (
        Problem(
            uavs=(HAWK,),
            targets=(CHEAP, DEAR),
            bases=(Base("b", 0, 1, stock=(0.0,)),),
            objective=Objective(unloading="planned", loading="planned", distance_weight=0.01),
        ),
        BOTH,
    ),
}


@pytest.mark.parametrize("name", LEGAL_AT_LEAST)
def test_a_promised_visit_unloads_a_little_and_nothing_else_is_lost(name):
    problem, plan = LEGAL_AT_LEAST[name]
    arrays = compile_problem(problem)
    result, amounts = replay_at_best(arrays, plan.as_array(), True)
    assert result.rule[0] == ALLOWED
    assert 0 < amounts.delivered[0, 0, 0] < 1e-4
    assert amounts.delivered[1, 0, 0] == pytest.approx(5.0, rel=1e-4)
    assert (
        amounts.delivered.sum(axis=(0, 1)) <= problem.targets[0].need[0] + problem.targets[1].need[0]
    ).all()
    assert explain(problem, plan).reward == pytest.approx(float(result.reward[0]))


@pytest.mark.parametrize("name", ["greedy", "local_search", "exact"])
def test_no_algorithm_stays_at_home_because_of_a_promise(name):
    solver = create_solver(name, parse_parameters(name, {}), SolverContext("sqlite://", 1, lambda: 0))
    plan = solver.solve(PROMISED, 1, Never(), lambda _progress: None).plan
    assert plan.as_array().tolist() == [[0], [1]]
    assert reward_of(PROMISED, plan) == pytest.approx(5.0 - 0.01 * 4, rel=1e-4)
