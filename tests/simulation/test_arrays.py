"""Problems as arrays: every field has the axes it is declared with, and parts are problems of their own."""

from dataclasses import replace

import numpy as np
import pytest

from app.domain.errors import ProblemTooLarge
from app.domain.problem import Objective
from app.domain.said import to_record
from app.domain.surroundings import Base, Wind
from app.simulation import legs
from app.simulation.arrays import AXES, OF_UAVS, compile_problem
from app.simulation.generator import generate
from app.simulation.stacks import alike, part, stack, without_reloads

SIZES = {"M": 4, "N": 6, "K": 2}


@pytest.fixture
def problem():
    made = generate("mid_mission", *SIZES.values(), np.random.default_rng(5))
    return replace(made, objective=replace(made.objective, distance_weight=0.5))


@pytest.fixture
def windy(problem):
    """A problem in which every array has entries; its UAVs have two speeds."""
    uavs = [replace(uav, speed=1.0 + (i % 2), endurance=9.0) for i, uav in enumerate(problem.uavs)]
    ids = [target.id for target in problem.targets]
    uavs[0] = replace(uavs[0], committed=(ids[4], ids[1]))
    return replace(
        problem,
        uavs=tuple(uavs),
        wind=Wind(0.2, 30.0),
        start_plan=((4, 0, 1, 2), (1, 6, 6, 6)),
        objective=replace(problem.objective, change_weight=0.1, minimum_share=0.5, minimum_weight=2.0),
    )


@pytest.fixture
def based(windy):
    """The same with bases, of which one UAV may not use the second."""
    bases = (Base("b", 0.2, 0.3), Base("c", 0.9, 0.1, stock=(3.0, 4.0), turnaround=0.5))
    uavs = (replace(windy.uavs[0], bases=("b",), full_load=(7.0, 8.0)), *windy.uavs[1:])
    return replace(windy, uavs=uavs, bases=bases)


@pytest.mark.parametrize("which", ["problem", "windy", "based"])
def test_fields_have_the_axes_that_are_declared(which, request):
    given = request.getfixturevalue(which)
    arrays = compile_problem(given)
    d, n = given.n_bases, SIZES["N"]
    sizes = {**SIZES, "C": len({uav.speed for uav in given.uavs}) if given.wind else 1, "D": d}
    sizes["L"] = n + 1 + d if d else n
    for name, axes in AXES.items():
        shape = getattr(arrays, name).shape
        declared = tuple(sizes[axis] for axis in axes.names if axis != "X")
        assert shape[0] == 1
        assert len(shape) == 1 + len(axes.names)
        # Where times follow from lengths there are none, and lists of visits may be empty.
        assert shape[1 : 1 + len(declared)] == declared or not getattr(arrays, name).size, name


@pytest.mark.parametrize("which", ["problem", "windy", "based"])
def test_a_part_is_what_its_own_problem_compiles_to(which, request):
    problem = request.getfixturevalue(which)
    uavs, targets = [2, 0], [4, 1, 3]
    smaller = replace(
        problem,
        start_plan=((1, 0), (3, 1)) if problem.start_plan else None,
        uavs=tuple(problem.uavs[i] for i in uavs),
        targets=tuple(problem.targets[j] for j in targets),
    )
    parts = part(compile_problem(problem), np.array([uavs, [1, 3]]), np.array([targets, [0, 2, 5]]))
    expected = compile_problem(smaller)
    for name in AXES:
        found, wanted = getattr(parts, name)[0].copy(), getattr(expected, name)[0].copy()
        if name == "terms":  # a share of the largest amount of the whole problem
            found["crumb"] = wanted["crumb"]
        assert np.array_equal(found, wanted), name
        assert getattr(parts, name).flags.c_contiguous


def test_without_reloads_ways_home_stay(based):
    arrays, plain = compile_problem(based), without_reloads(compile_problem(based))
    assert plain.n_bases == 0
    assert plain.shape == arrays.shape
    assert np.array_equal(plain.home, arrays.home[:, :, : SIZES["N"]])
    uavs = tuple(replace(uav, bases=None) for uav in based.uavs)
    far = compile_problem(replace(based, uavs=uavs, bases=()))
    assert (plain.home < far.home).any()


def test_uavs_that_differ_in_anything_are_not_alike(windy):
    problem = replace(
        windy, uavs=tuple(replace(uav, speed=1.0 + (i > 1)) for i, uav in enumerate(windy.uavs))
    )
    twins = replace(
        problem,
        uavs=(problem.uavs[0], replace(problem.uavs[0], id="twin"), *problem.uavs[2:]),
        start_plan=((4, 4, 1, 2), (1, 1, 6, 6)),
    )
    arrays = compile_problem(twins)
    assert alike(arrays).tolist() == [0, 0, 2, 3]
    for name in OF_UAVS:
        for column in getattr(arrays, name).dtype.names or (None,):
            changed = getattr(arrays, name).copy()
            place = changed if column is None else changed[column]
            if place.dtype == bool:
                place[0, 1] = ~place[0, 1]
            else:
                place[0, 1] = np.where(np.isfinite(place[0, 1]), place[0, 1] + 1, 0)
            assert alike(arrays._replace(**{name: changed})).tolist() == [0, 1, 2, 3], (name, column)


def test_problems_with_bases_are_stacked_only_where_they_have_as_many_targets(based):
    few = compile_problem(replace(based, targets=based.targets[:5], start_plan=None, objective=Objective()))
    whole = compile_problem(based)
    assert stack([whole, whole]).shape == whole.shape
    with pytest.raises(ValueError, match="as many targets"):
        stack([whole, few])


def test_legs_that_would_not_fit_are_refused(windy, monkeypatch):
    monkeypatch.setattr(legs, "MOST_LEGS", 71)
    with pytest.raises(ProblemTooLarge, match="targets and bases are 72; the limit is 71") as refused:
        legs.leg_arrays(windy)
    told = to_record(refused.value.detail)
    assert told["values"] == {"classes": 2, "stops": 6, "legs": 72, "limit": 71}


def test_what_pads_a_stack_is_never_part_of_a_visit(problem):
    small = compile_problem(replace(problem, uavs=problem.uavs[:1], targets=problem.targets[:2]))
    stacked = stack([compile_problem(problem), small])
    assert stacked.shape == tuple(SIZES.values())
    assert stacked.ret[1, 1:].all()
    assert not stacked.need[1, 2:].any()
    assert np.isinf(stacked.areas["deadline"][1, 2:]).all()
