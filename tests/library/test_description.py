"""Task descriptions: Eqs. 10-12 by hand, and what they must not depend on."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import random_problem

from app.domain.problem import UAV, Problem, Target
from app.library.description import PAPER_SPACE, description_space, task_description


def test_by_hand():
    # The box is 3 x 4 with its low corner at (1, 2): its diagonal is 5.
    problem = Problem(
        uavs=(
            UAV("a", x_s=1, y_s=2, x_c=4, y_c=2, speed=2, voyage=10, loadlist=(4, 0), dis=5, ret=True),
            UAV("b", x_s=1, y_s=6, x_c=1, y_c=6, speed=4, voyage=20, loadlist=(1, 2)),
        ),
        targets=(Target("t", x=4, y=6, level=3, loadlist=(8, 1)),),
    )

    description = task_description(problem)

    first = [0, 0, 0.6, 0, 0.5, 0.5, 0.25, 1, 0.5, 0]
    second = [0, 0.8, 0, 0.8, 1, 1, 0, 0, 0.125, 0.25]
    target = [0.6, 0.8, 1, 1, 0.125]
    assert description == pytest.approx(first + second + target)
    assert description_space(problem) == f"{PAPER_SPACE}/2x1x2"


@pytest.mark.parametrize("seed", range(40))
def test_length_and_range(seed):
    problem = random_problem(np.random.default_rng(seed))

    description = task_description(problem)

    m, n, k = problem.n_uavs, problem.n_targets, problem.n_materials
    assert description.shape == (m * (8 + k) + n * (3 + k),)
    assert description.dtype == np.float64
    assert np.isfinite(description).all()
    assert (description >= 0).all()


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    length=st.floats(1e-3, 1e3),
    time=st.floats(1e-3, 1e3),
    amount=st.floats(1e-3, 1e3),
    level=st.floats(1e-3, 1e3),
    shift=st.tuples(st.floats(-100, 100), st.floats(-100, 100)),
)
def test_units_and_place_do_not_matter(seed, length, time, amount, level, shift):
    problem = replace(random_problem(np.random.default_rng(seed)), crs="local")
    dx, dy = shift
    elsewhere = replace(
        problem,
        uavs=tuple(
            replace(
                u,
                x_s=(u.x_s + dx) * length,
                y_s=(u.y_s + dy) * length,
                x_c=(u.x_c + dx) * length,
                y_c=(u.y_c + dy) * length,
                speed=u.speed * length / time,
                voyage=u.voyage * length,
                dis=u.dis * length,
                loadlist=tuple(a * amount for a in u.loadlist),
            )
            for u in problem.uavs
        ),
        targets=tuple(
            replace(
                t,
                x=(t.x + dx) * length,
                y=(t.y + dy) * length,
                level=t.level * level,
                loadlist=tuple(a * amount for a in t.loadlist),
            )
            for t in problem.targets
        ),
    )

    assert task_description(elsewhere) == pytest.approx(task_description(problem), rel=1e-6, abs=1e-6)


def test_zeros_stay_zero():
    problem = Problem(
        uavs=(UAV("a", x_s=7, y_s=7, x_c=7, y_c=7, speed=1e-9, voyage=0, loadlist=(0,), dis=1e12),),
        targets=(Target("t", x=7, y=7, level=0, loadlist=(0,)),),
    )

    description = task_description(problem)

    assert np.isfinite(description.astype(np.float32)).all()
    assert description.tolist() == [0, 0, 0, 0, 1, 0, 1e6, 0, 0, 0, 0, 0, 0]
