"""Planned unloading: the best amounts against a linear program, and their replay against the referee."""

from dataclasses import replace

import highspy
import numpy as np
import pytest
from loading_program import best_by_program
from problems import random_problem
from referee import Illegal, replay

from app.domain.errors import IllegalPlan
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.explain import explain
from app.simulation.generator import generate
from app.simulation.planned_amounts import best_amounts
from app.simulation.worth import satisfaction_of


def worth(problem, delivered, actions):
    """Satisfaction of given amounts."""
    total = 0.0
    for s, i in np.argwhere(actions < problem.n_targets):
        target = problem.targets[actions[s, i]]
        if sum(target.loadlist):
            total += target.level * delivered[s, i].sum() / sum(target.loadlist)
    return total


def by_linear_program(problem, actions):
    """Largest satisfaction for the routes, by HiGHS."""
    solver = highspy.Highs()
    solver.silent()
    loads, needs = {}, {}
    value = 0
    for s, i in np.argwhere(actions < problem.n_targets):
        j = actions[s, i]
        target = problem.targets[j]
        for k in range(problem.n_materials):
            amount = solver.addVariable(0, highspy.kHighsInf)
            loads.setdefault((i, k), []).append(amount)
            needs.setdefault((j, k), []).append(amount)
            value += (target.level / sum(target.loadlist) if sum(target.loadlist) else 0.0) * amount
    for (i, k), amounts in loads.items():
        solver.addConstr(sum(amounts) <= problem.uavs[i].loadlist[k])
    for (j, k), amounts in needs.items():
        solver.addConstr(sum(amounts) <= problem.targets[j].loadlist[k])
    solver.maximize(value)
    return solver.getObjectiveValue()


def random_routes(rng, problem):
    """Routes that share areas, whatever their lengths."""
    steps, m, n = problem.max_steps, problem.n_uavs, problem.n_targets
    lengths = rng.integers(0, steps + 1, m)
    actions = rng.integers(0, n, (steps, m))
    actions[np.arange(steps)[:, None] >= lengths] = n
    return actions


def scarce(rng):
    """A problem of several visits a target, where the amounts must be shared out with care."""
    m, n, k = (int(rng.integers(low, high)) for low, high in ((1, 9), (1, 8), (1, 4)))
    whole = rng.random() < 0.5
    problem = generate("uniform", m, n, k, rng)
    draw = (
        (lambda high: float(rng.integers(0, high))) if whole else (lambda high: float(rng.uniform(0, high)))
    )
    return replace(
        problem,
        max_steps=int(rng.integers(1, 6)),
        uavs=tuple(replace(u, loadlist=tuple(draw(6) for _ in range(k))) for u in problem.uavs),
        targets=tuple(
            replace(t, level=draw(9), loadlist=tuple(draw(9) for _ in range(k))) for t in problem.targets
        ),
    )


def test_the_amounts_are_the_best_for_the_routes():
    rng = np.random.default_rng(5)
    for _ in range(250):
        problem = scarce(rng)
        actions = random_routes(rng, problem)
        delivered = best_amounts(compile_problem(problem), actions).delivered
        assert delivered.min() >= 0
        for i, uav in enumerate(problem.uavs):
            assert np.all(delivered[:, i].sum(axis=0) <= np.array(uav.loadlist) * (1 + 1e-9))
        for j, target in enumerate(problem.targets):
            assert np.all(delivered[actions == j].sum(axis=0) <= np.array(target.loadlist) * (1 + 1e-9))
        best = by_linear_program(problem, actions)
        assert worth(problem, delivered, actions) == pytest.approx(best, rel=1e-7, abs=1e-7)


def test_a_first_share_that_earns_more_is_brought_first():
    rng = np.random.default_rng(6)
    for _ in range(100):
        problem = scarce(rng)
        share, more = float(rng.uniform(0, 1)), float(rng.uniform(1, 4))
        problem = replace(problem, objective=Objective(minimum_share=share, minimum_weight=more))
        arrays, actions = compile_problem(problem), random_routes(rng, problem)
        met = np.zeros((problem.n_targets, problem.n_materials))
        delivered = best_amounts(arrays, actions).delivered
        for s, i in np.argwhere(actions < problem.n_targets):
            met[actions[s, i]] += delivered[s, i]
        best = best_by_program(problem_to_record(problem), actions.tolist())
        assert satisfaction_of(arrays, met) == pytest.approx(best, rel=1e-7, abs=1e-7)


def test_a_chain_of_uavs_takes_over_from_each_other():
    # Only u1 gets to "last"; it can go on if u2 takes over at "first", and u3 at "second".
    arrays = compile_problem(chain())
    delivered = best_amounts(arrays, np.array([[0, 0, 1], [2, 1, 3]])).delivered
    assert delivered[:, :, 0].tolist() == [[0.0, 1.0, 1.0], [1.0, 0.0, 0.0]]


def chain():
    uavs = tuple(UAV(f"u{i}", 0, 0, 0, 0, 1.0, 100.0, (1.0,)) for i in (1, 2, 3))
    targets = tuple(
        Target(name, x, 0, level, (1.0,))
        for name, x, level in (("first", 1, 3.0), ("second", 2, 2.0), ("last", 3, 1.0))
    )
    return Problem(uavs, targets, 3, objective=Objective(0.0, unloading="planned"))


def keep_for_later():
    """Two units: "near" on the way needs both, "urgent" behind it needs one and is worth more."""
    return Problem(
        uavs=(UAV("u", 0, 0, 0, 0, 1.0, 10.0, (2.0,)),),
        targets=(Target("near", 1, 0, 1.0, (2.0,)), Target("urgent", 2, 0, 10.0, (1.0,), deadline=2.0)),
        objective=Objective(0.1, unloading="planned"),
    )


def test_a_uav_keeps_material_for_a_more_urgent_area():
    problem = keep_for_later()
    answer = explain(problem, Plan(((0,), (1,))))
    assert [stop.delivered for stop in answer.routes[0].stops] == [(1.0,), (1.0,)]
    assert answer.satisfaction == pytest.approx(0.5 + 10)
    assert answer.reward == pytest.approx(10.5 - 0.2)
    assert [(unmet.target_id, unmet.remaining) for unmet in answer.unmet] == [("near", (1.0,))]
    greedy = replace(problem, objective=replace(problem.objective, unloading="greedy"))
    with pytest.raises(IllegalPlan, match="unload nothing"):
        reward_of(greedy, Plan(((0,), (1,))))


@pytest.mark.parametrize(
    ("rows", "rule"),
    [
        (((1,), (1,)), "it would unload nothing"),
        (((0,), (2,), (1,)), "a returning UAV gets no more targets"),
        (((3,),), "there is no such action"),
        (((2,),) * 6, "the plan has more rows than max_steps"),
    ],
)
def test_illegal_plans_are_refused(rows, rule):
    with pytest.raises(IllegalPlan) as refused:
        reward_of(keep_for_later(), Plan(rows))
    assert refused.value.details["rule"] == rule


def test_the_referee_agrees_on_every_option():
    rng = np.random.default_rng(11)
    legal = 0
    for _ in range(600):
        problem = random_problem(rng)
        problem = replace(problem, objective=replace(problem.objective, unloading="planned"))
        plan = Plan.of(random_routes(rng, problem), problem.n_targets)
        delivered = best_amounts(compile_problem(problem), plan.as_array()).delivered.tolist()
        try:
            expected = replay(problem_to_record(problem), plan.assignment, delivered)
        except Illegal:
            with pytest.raises(IllegalPlan):
                explain(problem, plan)
            continue
        legal += 1
        answer = explain(problem, plan)
        assert answer.reward == pytest.approx(expected["reward"], rel=1e-9, abs=1e-9)
        assert answer.distance == pytest.approx(expected["distance"], rel=1e-9)
    assert legal > 50


def test_the_referee_refuses_more_than_there_is():
    record = problem_to_record(keep_for_later())
    for delivered in ([[[1.5]], [[1.0]]], [[[2.0]], [[0.5]]], [[[-1.0]], [[1.0]]]):
        with pytest.raises(Illegal, match="amount"):
            replay(record, [[0], [1]], delivered)
    with pytest.raises(Illegal, match="useless"):
        replay(record, [[0], [1]], [[[2.0]], [[0.0]]])
