"""Episodes of a few UAVs in what the others leave: a smaller problem, and better plans of the whole one."""

from dataclasses import replace

import numpy as np
import pytest
from referee import replay
from stopping import at_once
from worlds import some_with_bases

from app.domain.records import problem_to_record
from app.learning.universal.request.replanning import groups_of, replan, residual_of, round_of
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import rewards_of
from app.simulation.generator import FAMILIES, generate
from app.solvers.greedy import greedy_plan


def whole(problem):
    """The greedy rule's plan (S, M), and what it earns."""
    arrays = compile_problem(problem)
    plan = np.full((problem.max_steps, problem.n_uavs), problem.n_targets, np.int64)
    rows = greedy_plan(problem).as_array()
    plan[: len(rows)] = rows
    return plan, float(rewards_of(arrays, plan[None]).reward[0])


def visits(plan, uav, home):
    return [int(j) for j in plan[:, uav] if j != home]


def test_groups_are_of_two_to_six_uavs_that_may_fly():
    problem = generate("mid_mission", 12, 20, 3, np.random.default_rng(71))
    arrays = compile_problem(problem)
    arrays = arrays._replace(ret=np.arange(12)[None] < 3)
    plan, _ = whole(problem)
    plan[:, :3] = 20
    groups = groups_of(arrays, plan, 200, np.random.default_rng(1))
    assert groups.shape == (200, 12)
    assert set(groups.sum(axis=1)) == {2, 3, 4, 5, 6}
    assert not groups[:, :3].any()
    assert groups[:, 3:].any(axis=0).all()


@pytest.mark.parametrize("flying", [0, 1])
def test_nobody_is_planned_anew_where_fewer_than_two_may_fly(policy, flying):
    problem = generate("uniform", 4, 6, 2, np.random.default_rng(72))
    arrays = compile_problem(problem)._replace(ret=np.arange(4)[None] >= flying)
    plans = replan(policy, arrays, np.full((problem.max_steps, 4), 6), 8, np.random.default_rng(1))
    assert plans.shape == (0, problem.max_steps, 4)


def test_most_groups_fly_near_each_other():
    problem = generate("uniform", 8, 16, 2, np.random.default_rng(73))
    # Two swarms, a thousand extents apart; each has half of the targets.
    far = 1000.0 * max(t.x for t in problem.targets)
    uavs = [
        replace(u, x_s=u.x_s + far * (i % 2), x_c=u.x_c + far * (i % 2)) for i, u in enumerate(problem.uavs)
    ]
    targets = [replace(t, x=t.x + far * (j % 2)) for j, t in enumerate(problem.targets)]
    problem = replace(problem, uavs=tuple(uavs), targets=tuple(targets))
    plan, _ = whole(problem)
    groups = groups_of(compile_problem(problem), plan, 300, np.random.default_rng(1))
    apart = groups[groups.sum(axis=1) <= 4]
    together = (~apart[:, ::2].any(axis=1)) | (~apart[:, 1::2].any(axis=1))
    assert 0.7 < together.mean() < 0.95


@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_left_is_what_the_others_do_not_fly(family):
    problem = generate(family, 6, 9, 3, np.random.default_rng([74, *family.encode()]))
    arrays = compile_problem(problem)
    plan, _ = whole(problem)
    groups = groups_of(arrays, plan, 10, np.random.default_rng(2))
    left, uavs, targets = residual_of(arrays, plan, groups, np.random.default_rng(3))
    for g, group in enumerate(groups):
        assert sorted(uavs[g][~left.ret[g]]) == sorted(np.flatnonzero(group & ~arrays.ret[0]))
        held = plan.copy()
        held[:, group] = 9
        remaining = np.array(replay(problem_to_record(problem), held.tolist())["remaining"])
        needed = {int(j) for j, need in zip(targets[g], left.need[g], strict=True) if need.any()}
        for place, j in enumerate(targets[g]):
            if j in needed:
                assert left.need[g, place] == pytest.approx(remaining[j])
        gone = {j for i in np.flatnonzero(group) for j in visits(plan, i, 9)}
        assert {j for j in gone if (remaining[j] > 1e-6).any()} <= needed


def test_a_groups_episode_earns_what_it_adds_to_the_whole_plan(policy):
    compared = 0
    for number in range(100):
        problem = generate("uniform", 7, 10, 2, np.random.default_rng([75, number]))
        arrays = compile_problem(problem)
        plan, _ = whole(problem)
        groups = groups_of(arrays, plan, 4, np.random.default_rng(number))
        left, uavs, targets = residual_of(arrays, plan, groups, np.random.default_rng(number))
        played = policy.play(left, np.arange(4), np.random.default_rng(number))
        for g, group in enumerate(groups):
            held = plan.copy()
            held[:, group] = 10
            merged = held.copy()
            for place in np.flatnonzero(~left.ret[g]):
                actions = played.plans[g, :, place]
                merged[:, uavs[g, place]] = np.append(targets[g], 10)[actions]
            both = rewards_of(arrays, np.stack([held, merged]))
            theirs = [j for i in range(7) if group[i] for j in visits(merged, i, 10)]
            others = {j for i in range(7) if not group[i] for j in visits(held, i, 10)}
            # What a target brings to each of several UAVs depends on the order in which they come.
            if len(set(theirs)) == len(theirs) and not others & set(theirs):
                assert both.rule[1] == 0
                assert both.reward[1] - both.reward[0] == pytest.approx(played.rewards[g])
                compared += 1
    assert compared > 10


@pytest.mark.parametrize("family", FAMILIES)
def test_plans_are_allowed_and_the_last_is_never_worse(policy, family):
    problem = generate(family, 6, 9, 3, np.random.default_rng([76, *family.encode()]))
    arrays, record = compile_problem(problem), problem_to_record(problem)
    plan, reward = whole(problem)
    plans = replan(policy, arrays, plan, 29, np.random.default_rng(1))
    assert plans.shape == (30, problem.max_steps, 6)
    replayed = rewards_of(arrays, plans)
    assert (replayed.rule == 0).all()
    assert replayed.reward[-1] >= max(reward, replayed.reward[:-1].max()) - 1e-9
    assert replay(record, plans[-1].tolist())["reward"] == pytest.approx(replayed.reward[-1])


def test_groups_reload_from_what_the_others_leave(policy):
    reloads, gained = 0, 0
    for problem in some_with_bases(12):
        arrays, record = compile_problem(problem), problem_to_record(problem)
        plan = policy.play(arrays, np.zeros(1, np.int64), np.random.default_rng(1)).plans[0]
        reward = rewards_of(arrays, plan[None]).reward[0]
        plans = replan(policy, arrays, plan, 64, np.random.default_rng(1))
        if not len(plans):
            continue
        replayed = rewards_of(arrays, plans)
        assert (replayed.rule == 0).all()
        assert replay(record, plans[-1].tolist())["reward"] == pytest.approx(replayed.reward[-1])
        assert replayed.reward[-1] >= reward - 1e-9
        gained += replayed.reward[-1] > reward + 1e-9
        reloads += int((plans > problem.n_targets).sum())
    assert reloads > 100
    assert gained > 4


def test_a_plan_gets_better_group_by_group(policy):
    gained = []
    for number in range(6):
        problem = generate("uniform", 10, 16, 2, np.random.default_rng([77, number]))
        arrays = compile_problem(problem)
        plan = policy.play(arrays, np.zeros(1, np.int64), np.random.default_rng(number)).plans[0]
        reward = rewards_of(arrays, plan[None]).reward[0]
        rewards = rewards_of(arrays, replan(policy, arrays, plan, 192, np.random.default_rng(1))).reward
        gained.append((rewards[:-1].max() - reward, rewards[-1] - reward))
    single, together = np.mean(gained, axis=0)
    assert together > 1.2 * single > 0.0


def test_of_a_large_problem_only_what_is_worth_most_is_seen():
    problem = generate("uniform", 30, 120, 2, np.random.default_rng(78))
    arrays = compile_problem(problem)
    plan, _ = whole(problem)
    groups = groups_of(arrays, plan, 12, np.random.default_rng(1))
    left, uavs, targets = residual_of(arrays, plan, groups, np.random.default_rng(1))
    assert (uavs.shape, targets.shape) == ((12, 6), (12, 48))
    assert left.shape == (6, 48, 2)
    for g, group in enumerate(groups):
        assert len(set(targets[g])) == 48
        assert {j for i in np.flatnonzero(group) for j in visits(plan, i, 120)} <= set(targets[g])


def test_same_numbers_same_plans_on_any_number_of_cores(policy):
    problem = generate("uniform", 9, 24, 2, np.random.default_rng(79))
    arrays = compile_problem(problem)
    plan, _ = whole(problem)
    alone = replan(policy, arrays, plan, 64, np.random.default_rng(1))
    together = replan(policy, arrays, plan, 64, np.random.default_rng(1), spare=lambda: 2)
    other = replan(policy, arrays, plan, 64, np.random.default_rng(2))
    assert np.array_equal(alone, together)
    assert not np.array_equal(alone, other)


def test_once_time_is_up_the_others_fly_on(policy):
    problem = generate("uniform", 6, 9, 2, np.random.default_rng(80))
    arrays = compile_problem(problem)
    plan, reward = whole(problem)
    plans = replan(policy, arrays, plan, 8, np.random.default_rng(1), stop=at_once())
    assert rewards_of(arrays, plans).reward[-1] == pytest.approx(reward)


@pytest.mark.parametrize(("episodes", "expected"), [(1, 64), (192, 64), (400, 128), (576, 192), (10**5, 192)])
def test_there_are_three_rounds_at_least_but_for_few_episodes(episodes, expected):
    assert round_of(episodes) == expected
