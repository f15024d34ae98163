"""What a before for every size does depends neither on order, nor on units, nor on the map's orientation."""

from dataclasses import replace

import numpy as np
import pytest

from app.domain.plan import Plan
from app.domain.problem import Objective
from app.learning.universal.episodes.rollout import play
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.simulation.stacks import stack


def greedy(before, problem):
    played = play(before.agent, compile_problem(problem), np.zeros(1, np.int64))
    return played.plans[0]


def moving(plans, home):
    """Whether anybody flies: a test on policies that stay at home would prove nothing."""
    return sum((plan < home).sum() for plan in plans)


def test_order_of_targets_and_materials_does_not_matter(before, family_problems):
    rng, plans = np.random.default_rng(1), []
    for problem in family_problems:
        targets, materials = rng.permutation(problem.n_targets), rng.permutation(problem.n_materials)

        def mixed(item, materials=materials):
            return replace(item, loadlist=tuple(item.loadlist[k] for k in materials))

        other = replace(
            problem,
            uavs=tuple(map(mixed, problem.uavs)),
            targets=tuple(mixed(problem.targets[j]) for j in targets),
        )
        back = np.append(targets, problem.n_targets)
        plans.append(greedy(before, problem))
        assert np.array_equal(back[greedy(before, other)], plans[-1])
    assert moving(plans, 8) > 30


def test_units_do_not_matter(before, family_problems):
    length, amount, time, worth = 137.0, 3.0, 0.01, 11.0
    plans = []
    for problem in family_problems:
        uavs = tuple(
            replace(
                u,
                **{name: length * getattr(u, name) for name in ("x_s", "y_s", "x_c", "y_c", "voyage", "dis")},
                speed=u.speed * length / time,
                loadlist=tuple(amount * a for a in u.loadlist),
            )
            for u in problem.uavs
        )
        targets = tuple(
            replace(
                t,
                x=length * t.x,
                y=length * t.y,
                level=worth * t.level,
                loadlist=tuple(amount * a for a in t.loadlist),
                deadline=None if t.deadline is None else time * t.deadline,
                service_time=time * t.service_time,
            )
            for t in problem.targets
        )
        weight = Objective(problem.distance_weight * worth / length)
        plans.append(greedy(before, problem))
        other = replace(problem, uavs=uavs, targets=targets, objective=weight)
        assert np.array_equal(greedy(before, other), plans[-1])
    assert moving(plans, 8) > 30


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("quarter_turns", range(4))
def test_rotated_and_mirrored_maps_are_the_same_map(before, family_problems, quarter_turns, mirrored):
    def turned(item, *names):
        place = {}
        for x, y in names:
            at = complex(getattr(item, x), getattr(item, y)) * 1j**quarter_turns
            at = at.conjugate() if mirrored else at
            place |= {x: at.real, y: at.imag}
        return replace(item, **place)

    for problem in family_problems:
        fixed = replace(problem, objective=Objective(problem.distance_weight))
        other = replace(
            fixed,
            uavs=tuple(turned(u, ("x_s", "y_s"), ("x_c", "y_c")) for u in problem.uavs),
            targets=tuple(turned(t, ("x", "y")) for t in problem.targets),
        )
        assert np.array_equal(greedy(before, other), greedy(before, fixed))


def test_problems_in_a_stack_are_played_as_alone(make_before):
    rng = np.random.default_rng(2)
    problems = [generate("mid_mission", 4, 6, k, rng) for k in (1, 2, 3, 5)]
    arrays = stack([compile_problem(problem) for problem in problems])
    for seed in range(3):
        before = make_before(seed)
        together = play(before.agent, arrays, np.arange(4))
        for number, problem in enumerate(problems):
            alone = play(before.agent, compile_problem(problem), np.zeros(1, np.int64))
            assert np.array_equal(together.plans[number], alone.plans[0])
            assert together.rewards[number] == pytest.approx(alone.rewards[0])


def test_every_size_is_played(before):
    for m, n, k in ((1, 1, 1), (1, 9, 2), (9, 1, 2), (12, 30, 6), (30, 12, 64)):
        problem = generate("uniform", m, n, k, np.random.default_rng(3))
        plan = Plan.of(greedy(before, problem), n)
        assert len(plan.assignment[0]) == m
