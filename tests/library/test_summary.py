"""Summaries of tasks: comparable across sizes, blind to order, units and place."""

from dataclasses import replace

import numpy as np
import pytest
from problems import on_earth, random_problem
from worlds import random_world

from app.domain.matrices import Matrix
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Base
from app.library.summary import FEATURES, task_summary
from app.simulation.generator import FAMILIES, generate


def distance(a, b):
    return float(((task_summary(a) - task_summary(b)) ** 2).sum())


def test_bounded_and_finite_whatever_the_task():
    rng = np.random.default_rng(1)
    for _ in range(200):
        summary = task_summary(random_problem(rng))
        assert summary.shape == (len(FEATURES),)
        assert np.isfinite(summary).all()
        assert (summary >= 0).all()
        assert (summary <= 1 + 1e-12).all()


def test_extremes_are_finite():
    rng = np.random.default_rng(2)
    problem = generate("deadline", 3, 4, 2, rng)
    at_one_place = replace(
        problem,
        uavs=tuple(replace(u, x_s=0.0, y_s=0.0, x_c=0.0, y_c=0.0) for u in problem.uavs),
        targets=tuple(replace(t, x=0.0, y=0.0) for t in problem.targets),
    )
    nothing = replace(
        problem,
        uavs=tuple(replace(u, loadlist=(0.0, 0.0), voyage=0.0, ret=True) for u in problem.uavs),
        targets=tuple(replace(t, loadlist=(0.0, 0.0), level=0.0, deadline=-1.0) for t in problem.targets),
        objective=Objective(0.0),
    )
    huge = replace(
        problem,
        uavs=tuple(replace(u, loadlist=(1e12, 1e12), voyage=1e12, speed=1e-9) for u in problem.uavs),
        targets=tuple(replace(t, x=1e12, level=1e12, service_time=1e12) for t in problem.targets),
        objective=Objective(1e12),
    )
    single = generate("uniform", 1, 1, 1, rng)
    for task in (at_one_place, nothing, huge, single):
        assert np.isfinite(task_summary(task)).all()


def test_order_of_uavs_targets_and_materials_does_not_matter():
    rng = np.random.default_rng(3)
    for _ in range(50):
        problem = random_problem(rng)
        order = rng.permutation(problem.n_materials)

        def mixed(items, order=order):
            return tuple(
                replace(items[i], loadlist=tuple(items[i].loadlist[k] for k in order))
                for i in rng.permutation(len(items))
            )

        other = replace(problem, uavs=mixed(problem.uavs), targets=mixed(problem.targets))
        np.testing.assert_allclose(task_summary(other), task_summary(problem), atol=1e-9)


def test_order_does_not_matter_where_only_some_targets_are_looked_at():
    problem = generate("clustered", 3, 700, 1, np.random.default_rng(4))
    other = replace(problem, targets=problem.targets[::-1])
    np.testing.assert_allclose(task_summary(other), task_summary(problem), atol=1e-9)


def test_units_and_place_do_not_matter():
    rng = np.random.default_rng(5)
    length, time, amount, worth = 1000.0, 60.0, 7.0, 3.0
    for family in FAMILIES:
        problem = generate(family, 4, 6, 2, rng)
        moved = {"x_s": 5.0, "y_s": -3.0, "x_c": 5.0, "y_c": -3.0, "x": 5.0, "y": -3.0}

        def scaled(item, names, moved=moved):
            return {name: length * (getattr(item, name) + moved.get(name, 0.0)) for name in names}

        uavs = tuple(
            replace(
                u,
                **scaled(u, ("x_s", "y_s", "x_c", "y_c", "voyage", "dis")),
                speed=u.speed * length / time,
                loadlist=tuple(amount * a for a in u.loadlist),
            )
            for u in problem.uavs
        )
        targets = tuple(
            replace(
                t,
                **scaled(t, ("x", "y")),
                level=worth * t.level,
                loadlist=tuple(amount * a for a in t.loadlist),
                deadline=None if t.deadline is None else time * t.deadline,
                service_time=time * t.service_time,
            )
            for t in problem.targets
        )
        weight = Objective(problem.distance_weight * worth / length)
        other = replace(problem, uavs=uavs, targets=targets, objective=weight)
        np.testing.assert_allclose(task_summary(other), task_summary(problem), atol=1e-6)


def test_tasks_on_earth_are_like_those_on_a_plane():
    rng = np.random.default_rng(6)
    for family in FAMILIES:
        problem = generate(family, 5, 8, 2, rng)
        problem = replace(problem, objective=Objective())
        # One degree of longitude is shorter than one of latitude, so they are alike and not the same.
        assert distance(problem, on_earth(problem, rng)) < 0.15


def test_nearest_of_one_task_a_family_is_mostly_of_the_same_family():
    """Also at another size; by chance it would be one in eight."""
    known = {family: generate(family, 10, 20, 3, np.random.default_rng(7)) for family in FAMILIES}
    hits = total = 0
    for seed in range(5):
        for family in FAMILIES:
            problem = generate(family, 12, 16, 3, np.random.default_rng([8, seed]))
            hits += family == min(known, key=lambda name: distance(known[name], problem))
            total += 1
    assert hits > 0.6 * total


@pytest.mark.parametrize(("size", "near"), [((11, 20, 3), True), ((40, 80, 3), False)])
def test_sizes_count(size, near):
    rng = np.random.default_rng(9)
    known = generate("uniform", 10, 20, 3, rng)
    assert (distance(generate("uniform", *size, rng), known) < 0.1) == near


def test_endurance_and_reserve_are_a_shorter_range():
    problem = generate("uniform", 4, 8, 2, np.random.default_rng(10))

    def with_all(**fields):
        return replace(problem, uavs=tuple(replace(u, **fields) for u in problem.uavs))

    halved = replace(problem, uavs=tuple(replace(u, voyage=u.voyage / 2) for u in problem.uavs))
    timed = replace(problem, uavs=tuple(replace(u, endurance=u.voyage / u.speed / 2) for u in problem.uavs))
    for task in (with_all(reserve=0.5), timed):
        np.testing.assert_allclose(task_summary(task), task_summary(halved), atol=1e-12)
    assert distance(problem, halved) > 0.01
    assert (task_summary(with_all(endurance=1e9)) == task_summary(problem)).all()
    in_the_air = with_all(endurance=1.0, airborne=1.0)
    assert task_summary(in_the_air)[FEATURES.index("range")] == 0.0


def test_pairs_that_may_not_be_flown_are_not_in_range():
    problem = generate("single_base", 3, 5, 2, np.random.default_rng(11))
    problem = replace(problem, uavs=tuple(replace(u, voyage=100.0) for u in problem.uavs))

    def share(task):
        return task_summary(task)[FEATURES.index("pairs_in_range")]

    first, *others = problem.uavs
    excluded = replace(first, excluded=(problem.targets[0].id, problem.targets[1].id))
    skilled = replace(problem.targets[4], skills=("winch",))
    assert share(problem) == 1.0
    assert share(replace(problem, uavs=(excluded, *others))) == pytest.approx(13 / 15)
    barred = replace(problem, targets=(*problem.targets[:4], skilled))
    assert share(barred) == pytest.approx(12 / 15)
    can = replace(barred, uavs=(replace(first, skills=("winch",)), *others))
    assert share(can) == pytest.approx(13 / 15)


def test_bounded_and_finite_whatever_the_world():
    rng = np.random.default_rng(12)
    for _ in range(200):
        summary = task_summary(random_world(rng))
        assert np.isfinite(summary).all()
        assert (summary >= 0).all()
        assert (summary <= 1 + 1e-12).all()


def test_a_task_with_bases_and_matrices_is_summarised():
    base = Base("base-1", 1.0, 0.0, location=2)
    uavs = (UAV("uav-1", 0.0, 0.0, 0.0, 0.0, 1.0, 9.0, (2.0,), location=0),)
    areas = (Target("area-1", 2.0, 0.0, 1.0, (2.0,), location=1),)
    legs = Matrix([[0.0, 2.0, 1.0], [2.0, 0.0, 1.0], [1.0, 1.0, 0.0]])
    with_tables = Problem(uavs, areas, bases=(base,), matrices={"all": legs})
    summary = task_summary(with_tables)
    assert np.isfinite(summary).all()
    plain = replace(
        with_tables,
        uavs=(replace(uavs[0], location=None, home_location=None),),
        targets=(replace(areas[0], location=None),),
        bases=(replace(base, location=None),),
        matrices=None,
    )
    assert summary == pytest.approx(task_summary(plain))
