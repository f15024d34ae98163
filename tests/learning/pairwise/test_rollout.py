"""Roll-outs: legal plans that earn what was said, chance that follows from a seed, the surest acts first."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hand_made_agent import HOME, SHARPNESS, by_net
from plain_sight import reload_row, visit_row
from plain_state import PlainState
from problems import random_problem
from referee import replay
from stopping import After
from worlds import random_sorties, random_world

from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.learning.pairwise.rollout import play
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.simulation.stacks import stack
from app.simulation.world_generator import WORLD_FAMILIES

ONE = np.zeros(1, np.int64)


@pytest.mark.parametrize("kind", [random_problem, random_world, random_sorties])
def test_plans_are_legal_and_earn_what_was_played(make_policy, kind):
    rng, flown = np.random.default_rng(4), 0
    for number in range(25):
        problem = kind(rng)
        chance = rng if number % 2 else None
        played = play(make_policy(number % 4).agent, compile_problem(problem), np.zeros(3, np.int64), chance)
        for plan, reward in zip(played.plans, played.rewards, strict=True):
            judged = replay(problem_to_record(problem), plan.tolist())
            assert reward == pytest.approx(judged["reward"], abs=1e-9)
            flown += sum(map(len, judged["stops"]))
    assert flown > 15


def test_where_nobody_may_fly_the_end_costs_what_it_costs(policy):
    """The start plan has a visit that is out of range now: not to make it costs the weight of a change."""
    uav, target = UAV("u", 0, 0, 3, 0, 1.0, 1.0, (1.0,)), Target("a", 9, 0, 5.0, (1.0,))
    objective = Objective(distance_weight=0.1, change_weight=0.25, charge_return=True, return_to_base=False)
    problem = Problem((uav,), (target,), objective=objective, start_plan=((0,),))
    played = play(policy.agent, compile_problem(problem), np.zeros(2, np.int64))
    assert (played.plans == 1).all()
    assert played.rewards.tolist() == pytest.approx([-0.25 - 0.3] * 2)


def plain_play(problem: Problem, at_once: int = 1) -> tuple[list[list[int]], int]:
    """The plan of the hand-made agent in plain Python, and how often another than the first UAV acted first.

    In every state the UAVs are asked that are out and have not acted; those whose most likely action has the
    highest probability act, one of every `at_once` that are out, no two at the same place.
    """
    state, plan, others = PlainState(problem), [], 0
    actions = state.n + 1 + state.d
    while state.step < state.steps and any(can(state, i) for i in range(state.m)):
        row = [state.n] * state.m
        send_idle_home(state)
        while len(state.acted) < state.m:
            sure = {}
            for i in set(range(state.m)) - state.acted:
                values = {state.n: HOME}
                for action in range(actions):
                    if action != state.n and state.possible(i, action):
                        seen = (
                            visit_row(state, i, action)
                            if action < state.n
                            else reload_row(state, i, action - state.n - 1)
                        )
                        if seen["ALLOWED"]:
                            values[action] = seen["NET"] if action < state.n else seen["BEST_THEN"] / 2
                best = plain_choice(values, state.n)
                total = sum(math.exp(SHARPNESS * (value - values[best])) for value in values.values())
                sure[i] = (-math.log(total), best)
            out = sum(craft.out for craft in state.flight.fleet)
            order = sorted(sure, key=lambda i: -sure[i][0])
            others += order[0] != min(sure)
            taken = set()
            for i in order:
                action = sure[i][1]
                if (
                    len(taken) < max(1, out // at_once)
                    and (action == state.n or state.in_order(i, action))
                    and not repeated(action, taken, state)
                ):
                    row[i] = action
                    state.act(i, action)
                    taken.add((action, i))
            send_idle_home(state)
        plan.append(row)
        state.end_step()
    return plan, others


def plain_choice(values, home):
    """Home from a probability of 0.75; otherwise the place with the highest value, if there is one."""
    total = sum(math.exp(SHARPNESS * value) for value in values.values())
    if math.exp(SHARPNESS * values[home]) / total >= 0.75:
        return home
    return max((action for action in values if action != home), key=values.get)


def repeated(action, taken, state):
    """Whether another has chosen the area on the same answer."""
    return action < state.n and action in {each for each, _ in taken}


def can(state, i):
    actions = [j for j in range(state.n + 1 + state.d) if j != state.n]
    return state.flight.fleet[i].out and any(state.possible(i, j) for j in actions)


def send_idle_home(state):
    for i in range(state.m):
        if i not in state.acted and not can(state, i):
            state.act(i, state.n)


@pytest.mark.parametrize("kind", ["uniform", "scarce", "deadline", "sorties", "windows"])
def test_the_surest_acts_first_and_the_others_are_asked_again(kind):
    rng, others = np.random.default_rng(12), 0
    for _ in range(2):
        make = WORLD_FAMILIES.get(kind)
        problem = generate(kind, 4, 6, 2, rng) if make is None else make(4, 6, 2, rng)
        plan, before_others = plain_play(problem, at_once=12)
        found = play(by_net(), compile_problem(problem), ONE).plans[0]
        assert found[: len(plan)].tolist() == plan
        assert (found[len(plan) :] == problem.n_targets).all()
        others += before_others
    assert others > 0, "the UAVs acted in the order of their numbers, so nothing was proved"


def test_of_many_several_act_at_once_but_not_at_one_place():
    rng = np.random.default_rng(13)
    problem = replace(generate("uniform", 40, 8, 1, rng), max_steps=1)
    plan, _ = plain_play(problem, at_once=12)  # three at once, of up to 47
    one_by_one, _ = plain_play(problem, at_once=1000)
    assert play(by_net(), compile_problem(problem), ONE).plans[0].tolist() == plan
    assert plan != one_by_one, "two at once made no difference, so nothing was proved"


def test_who_has_a_stale_answer_does_not_take_what_is_gone():
    """Two UAVs, an area that one of them fills: the surer one gets it, and the other finds something else."""
    near, far = UAV("near", 0, 0, 0, 0, 1, 100, (5.0,)), UAV("far", 4, 0, 4, 0, 1, 100, (5.0,))
    targets = (Target("a", 1, 0, 10.0, (5.0,)), Target("b", 9, 0, 1.0, (5.0,)))
    for swarm, plan in (((near, far), [0, 1]), ((far, near), [1, 0])):
        problem = Problem(swarm, targets, max_steps=1)
        assert play(by_net(), compile_problem(problem), ONE).plans[0].tolist() == [plan]


def test_sampling_is_by_the_generator_alone(policy, family_problems):
    arrays = compile_problem(family_problems[0])
    first, again, other = (
        play(policy.agent, arrays, np.zeros(8, np.int64), np.random.default_rng(seed)).plans
        for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert len(np.unique(first, axis=0)) > 1
    cold = play(policy.agent, arrays, np.zeros(8, np.int64), np.random.default_rng(1), temperature=1e-6)
    assert len(np.unique(cold.plans, axis=0)) == 1, "chance is left where there should be none"


def test_first_actions_are_drawn_as_likely_as_the_agent_says():
    """One UAV and the hand-made agent: how often each area comes first is the softmax of known values."""
    rng, count = np.random.default_rng(3), 4000
    problem = replace(generate("uniform", 1, 4, 1, rng), max_steps=1)
    state = PlainState(problem)
    values = np.array([*(visit_row(state, 0, j)["NET"] for j in range(4)), HOME])
    for temperature in (1.0, 0.5):
        plans = play(by_net(), compile_problem(problem), np.zeros(count, np.int64), rng, temperature).plans
        odds = np.exp(SHARPNESS * values / temperature)
        expected = count * odds / odds.sum()
        found = np.bincount(plans[:, 0, 0], minlength=5)
        assert (np.abs(found - expected) < 5 * np.sqrt(expected)).all()


def test_exploring_actions_are_any_that_is_allowed_and_others_the_policys(make_policy):
    rng, count = np.random.default_rng(8), 3000
    arrays = compile_problem(replace(generate("uniform", 1, 4, 2, rng), max_steps=1))
    epsilon = np.where(np.arange(count) % 2, 1.0, 0.0)
    plans = play(make_policy().agent, arrays, np.zeros(count, np.int64), rng, 1e-6, epsilon=epsilon).plans
    assert len(np.unique(plans[::2], axis=0)) == 1
    _, firsts = np.unique(plans[1::2, 0, 0], return_counts=True)
    expected = count / 2 / 5  # every area, and home
    assert len(firsts) == 5
    assert np.abs(firsts - expected).max() < 5 * np.sqrt(expected)


@pytest.mark.parametrize("seed", [None, 6])
def test_the_number_of_threads_changes_nothing(policy, family_problems, seed):
    arrays = stack([compile_problem(problem) for problem in family_problems])
    which = np.arange(len(family_problems)).repeat(2)

    def plans(spare):
        rng = None if seed is None else np.random.default_rng(seed)
        return play(policy.agent, arrays, which, rng, spare=lambda: spare)

    alone, shared = plans(0), plans(3)
    assert np.array_equal(alone.plans, shared.plans)
    assert alone.rewards.tobytes() == shared.rewards.tobytes()


def test_stopped_episodes_end_at_home(policy, family_problems):
    problem, lengths = family_problems[0], []
    arrays = compile_problem(problem)
    for allowed in (0, 1, 3, 8, 1000):
        stop = After(allowed)
        played = play(policy.agent, arrays, ONE, stop=stop)
        judged = replay(problem_to_record(problem), played.plans[0].tolist())
        assert played.rewards[0] == pytest.approx(judged["reward"])
        lengths.append(sum(map(len, judged["stops"])))
    assert lengths[0] == 0
    assert lengths == sorted(lengths)
    assert lengths[-1] > lengths[2]
    assert np.array_equal(played.plans, play(policy.agent, arrays, ONE).plans)
    assert stop.left > 0


def test_problems_in_a_stack_are_played_as_alone(make_policy):
    """Of as many UAVs and areas each, but of other numbers of materials, and of other needs and times."""
    rng = np.random.default_rng(2)
    families = ("mid_mission", "deadline", "scarce", "uniform")
    problems = [generate(family, 4, 6, k, rng) for family, k in zip(families, (1, 2, 3, 5), strict=True)]
    arrays = stack([compile_problem(problem) for problem in problems])
    for seed in range(3):
        agent = make_policy(seed).agent
        together = play(agent, arrays, np.arange(4))
        for number, problem in enumerate(problems):
            alone = play(agent, compile_problem(problem), ONE)
            steps = len(alone.plans[0])
            assert np.array_equal(together.plans[number][:steps], alone.plans[0])
            assert (together.plans[number][steps:] == 6).all()
            assert together.rewards[number] == pytest.approx(alone.rewards[0])


def test_every_size_is_played(policy):
    for m, n, k in ((1, 1, 1), (1, 9, 2), (9, 1, 2), (12, 30, 6), (30, 12, 64)):
        problem = generate("uniform", m, n, k, np.random.default_rng(3))
        played = play(policy.agent, compile_problem(problem), ONE)
        judged = replay(problem_to_record(problem), played.plans[0].tolist())
        assert played.rewards[0] == pytest.approx(judged["reward"])
