"""Problems as arrays: every field has the axes it is declared with, and parts are problems of their own."""

from dataclasses import replace

import numpy as np
import pytest

from app.simulation.arrays import AXES, OF_UAVS, alike, compile_problem, part, stack
from app.simulation.generator import generate

SIZES = {"M": 4, "N": 6, "K": 2}


@pytest.fixture
def problem():
    made = generate("mid_mission", *SIZES.values(), np.random.default_rng(5))
    return replace(made, objective=replace(made.objective, distance_weight=0.5))


def test_fields_have_the_axes_that_are_declared(problem):
    arrays = compile_problem(problem)
    for name, axes in AXES.items():
        assert getattr(arrays, name).shape == (1, *(SIZES[axis] for axis in axes.names)), name


def test_a_part_is_what_its_own_problem_compiles_to(problem):
    uavs, targets = [2, 0], [4, 1, 3]
    smaller = replace(
        problem,
        uavs=tuple(problem.uavs[i] for i in uavs),
        targets=tuple(problem.targets[j] for j in targets),
    )
    parts = part(compile_problem(problem), np.array([uavs, [1, 3]]), np.array([targets, [0, 2, 5]]))
    expected = compile_problem(smaller)
    for name in AXES:
        if name != "crumb":  # a share of the largest amount of the whole problem
            assert np.array_equal(getattr(parts, name)[0], getattr(expected, name)[0]), name
            assert getattr(parts, name).flags.c_contiguous


def test_uavs_that_differ_in_anything_are_not_alike(problem):
    twins = replace(problem, uavs=(problem.uavs[0], replace(problem.uavs[0], id="twin"), *problem.uavs[2:]))
    arrays = compile_problem(twins)
    assert alike(arrays).tolist() == [0, 0, 2, 3]
    for name in OF_UAVS:
        changed = getattr(arrays, name).copy()
        changed[0, 1] = ~changed[0, 1] if changed.dtype == bool else changed[0, 1] + 1.0
        assert alike(arrays._replace(**{name: changed})).tolist() == [0, 1, 2, 3], name


def test_what_pads_a_stack_is_never_part_of_a_visit(problem):
    small = compile_problem(replace(problem, uavs=problem.uavs[:1], targets=problem.targets[:2]))
    stacked = stack([compile_problem(problem), small])
    assert stacked.shape == tuple(SIZES.values())
    assert stacked.ret[1, 1:].all()
    assert not stacked.need[1, 2:].any()
    assert np.isinf(stacked.areas["deadline"][1, 2:]).all()
