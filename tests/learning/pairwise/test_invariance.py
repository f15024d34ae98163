"""What the policy sees and does depends neither on units and orientation, nor, but for ties, on numbers."""

from dataclasses import replace

import numpy as np
import pytest

from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Wind
from app.learning.pairwise.features import VisitFeature
from app.learning.pairwise.gains import begin_step, look, new_gains
from app.learning.pairwise.observation import observe
from app.learning.pairwise.rollout import play
from app.learning.pairwise.seen import new_seen
from app.simulation.arrays import compile_problem
from app.simulation.drawn_generator import drawn
from app.simulation.generator import generate
from app.simulation.simulator import new_episodes
from app.simulation.world_generator import WORLD_FAMILIES


def greedy(policy, problem):
    return play(policy.agent, compile_problem(problem), np.zeros(1, np.int64)).plans[0]


def sight(problem):
    """What is seen at the beginning: UAVs, areas, bases, visits, reloads."""
    arrays = compile_problem(problem)
    episodes, gains, seen = new_episodes(arrays, 1), new_gains(arrays, 1), new_seen(1, arrays)
    look(arrays, episodes, gains)
    begin_step(episodes, gains, 0)
    observe(arrays, episodes, gains, 0, seen, 0)
    return [part[0] for part in seen]


def of_the_world():
    """Problems with windows, wind, zones, promises, decay, shares and bases."""
    kinds = [kind for kind in WORLD_FAMILIES if kind not in ("matrix", "loading")]
    for kind in kinds:
        yield WORLD_FAMILIES[kind](4, 6, 2, np.random.default_rng([3, *kind.encode()]))
    for seed in range(6):
        yield drawn(4, 7, 2, np.random.default_rng([4, seed]))


def flying(plans, problems):
    """How many visits and reloads there are: a test on policies that stay at home would prove nothing."""
    return sum(int((plan != each.n_targets).sum()) for plan, each in zip(plans, problems, strict=True))


def scaled(item, factors):
    """A part of a problem with some of its fields multiplied; what is not given stays away."""

    def times(value, factor):
        if isinstance(value, tuple):
            return tuple(times(each, factor) for each in value)
        return None if value is None else value * factor

    return replace(item, **{name: times(getattr(item, name), factor) for name, factor in factors.items()})


def in_other_units(problem: Problem, length: float, amount: float, time: float, worth: float) -> Problem:
    lengths, times = dict.fromkeys(("x_s", "y_s", "x_c", "y_c", "voyage", "dis"), length), {}
    times = dict.fromkeys(("endurance", "airborne", "available_from", "available_until"), time)
    amounts = dict.fromkeys(("loadlist", "full_load"), amount)
    of_uav = {**lengths, **times, **amounts, "speed": length / time}
    of_area = {
        **{"x": length, "y": length, "level": worth, "loadlist": amount, "requested": amount},
        **dict.fromkeys(("deadline", "service_time", "earliest"), time),
    }
    objective = scaled(
        replace(problem.objective, distance_weight=problem.distance_weight),
        {
            "distance_weight": worth / length,
            "half_life": time,
            "makespan_weight": worth / time,
            "change_weight": worth,
        },
    )
    of_base = {"x": length, "y": length, "stock": amount, "turnaround": time}
    return replace(
        problem,
        uavs=tuple(scaled(each, of_uav) for each in problem.uavs),
        targets=tuple(scaled(each, of_area) for each in problem.targets),
        bases=tuple(scaled(each, of_base) for each in problem.bases),
        no_fly_zones=tuple(scaled(each, {"polygon": length}) for each in problem.no_fly_zones),
        wind=None if problem.wind is None else scaled(problem.wind, {"speed": length / time}),
        objective=objective,
    )


def test_units_do_not_matter(policy, family_problems):
    problems, plans = [*family_problems, *of_the_world()], []
    for problem in problems:
        other = in_other_units(problem, length=137.0, amount=3.0, time=0.01, worth=11.0)
        for mine, its in zip(sight(problem), sight(other), strict=True):
            np.testing.assert_allclose(mine, its, atol=1e-5)
        plans.append(greedy(policy, problem))
        assert np.array_equal(greedy(policy, other), plans[-1])
    assert flying(plans, problems) > 60


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("quarter_turns", [1, 2])
def test_rotated_and_mirrored_maps_are_the_same_map(policy, family_problems, quarter_turns, mirrored):
    def turned(point):
        at = complex(*point) * 1j**quarter_turns
        at = at.conjugate() if mirrored else at
        return at.real, at.imag

    def moved(item, *names):
        fields = {}
        for x, y in names:
            fields[x], fields[y] = turned((getattr(item, x), getattr(item, y)))
        return replace(item, **fields)

    problems, plans = [*family_problems, *of_the_world()], []
    for problem in problems:
        fixed = replace(
            problem, objective=replace(problem.objective, distance_weight=problem.distance_weight)
        )
        wind = fixed.wind
        if wind is not None:
            towards = np.radians(wind.towards)
            east, north = turned((float(np.sin(towards)), float(np.cos(towards))))
            wind = Wind(wind.speed, float(np.degrees(np.arctan2(east, north))))
        other = replace(
            fixed,
            uavs=tuple(moved(u, ("x_s", "y_s"), ("x_c", "y_c")) for u in fixed.uavs),
            targets=tuple(moved(t, ("x", "y")) for t in fixed.targets),
            bases=tuple(moved(base, ("x", "y")) for base in fixed.bases),
            no_fly_zones=tuple(
                replace(zone, polygon=tuple(map(turned, zone.polygon))) for zone in fixed.no_fly_zones
            ),
            wind=wind,
        )
        plans.append(greedy(policy, fixed))
        assert np.array_equal(greedy(policy, other), plans[-1])
    assert flying(plans, problems) > 60


def in_other_order(problem, rng):
    """The problem with areas, bases and materials in another order, and the actions by their old numbers."""
    targets, bases = rng.permutation(problem.n_targets), rng.permutation(problem.n_bases)
    materials = rng.permutation(problem.n_materials)

    def mixed(item, *names):
        return replace(
            item,
            **{
                name: tuple(getattr(item, name)[k] for k in materials)
                for name in names
                if getattr(item, name) is not None
            },
        )

    other = replace(
        problem,
        uavs=tuple(mixed(uav, "loadlist", "full_load") for uav in problem.uavs),
        targets=tuple(mixed(problem.targets[j], "loadlist", "requested") for j in targets),
        bases=tuple(mixed(problem.bases[d], "stock") for d in bases),
    )
    n = problem.n_targets
    return other, np.concatenate((targets, [n], n + 1 + bases))


def test_order_of_areas_bases_and_materials_does_not_matter(policy, family_problems):
    rng, plans = np.random.default_rng(1), []
    problems = [each for each in [*family_problems, *of_the_world()] if each.start_plan is None]
    problems = [each for each in problems if all(any(target.need) for target in each.targets)]
    for problem in problems:
        other, was = in_other_order(problem, rng)
        plans.append(greedy(policy, problem))
        assert np.array_equal(was[greedy(policy, other)], plans[-1])
    assert flying(plans, problems) > 60
    assert sum(problem.n_bases > 1 for problem in problems) >= 1


def test_order_of_uavs_does_not_matter_to_what_is_seen(family_problems):
    rng = np.random.default_rng(2)
    for problem in [*family_problems, *of_the_world()]:
        if problem.start_plan is not None:
            continue
        order = rng.permutation(problem.n_uavs)
        other = replace(problem, uavs=tuple(problem.uavs[i] for i in order))
        uavs, areas, bases, visits, reloads = sight(problem)
        for mine, its in zip(
            (uavs[order], areas, bases, visits[order], reloads[order]), sight(other), strict=True
        ):
            np.testing.assert_allclose(mine, its, atol=1e-6)


def test_order_of_uavs_does_not_matter_where_no_two_go_to_one_place(make_policy):
    """Every UAV can fill every area, so none is visited twice; otherwise numbers decide who unloads first."""
    rng, moved = np.random.default_rng(3), 0
    for seed in range(4):
        for family in ("uniform", "clustered", "deadline", "mid_mission"):
            problem = generate(family, 4, 7, 2, rng)
            uavs = tuple(replace(uav, loadlist=(1e4, 1e4)) for uav in problem.uavs)
            order = rng.permutation(4)
            policy = make_policy(seed)
            plan = greedy(policy, replace(problem, uavs=uavs))
            other = greedy(policy, replace(problem, uavs=tuple(uavs[i] for i in order)))
            assert np.array_equal(other, plan[:, order])
            moved += int((plan < 7).sum())
    assert moved > 25


def of_areas(*needs: float) -> Problem:
    """One UAV with more than any area needs, and areas that need so much."""
    places = ((1, 0), (2, 1), (1, 1))
    targets = tuple(
        Target(f"a{j}", x, y, 5.0, (need,))
        for j, ((x, y), need) in enumerate(zip(places, needs, strict=False))
    )
    uav = UAV("u", 0, 0, 0, 0, 1.0, 50.0, (9.0,))
    return Problem((uav,), targets, objective=Objective(distance_weight=0.1))


def test_no_visit_follows_itself():
    assert sight(of_areas(2.0))[3][0, 0, VisitFeature.FOLLOW_UP] == 0.0


def test_the_number_of_an_area_that_needs_nothing_changes_nothing():
    last = of_areas(2.0, 3.0, 0.0)
    first = replace(last, targets=(last.targets[2], *last.targets[:2]))
    np.testing.assert_allclose(sight(first)[3][0, 1:], sight(last)[3][0, :2])
