"""States of known plans: what is labelled is what the plan does, and could be done in the state."""

import numpy as np
import pytest
import torch
from problems import random_plan, random_problem
from referee import replay
from worlds import random_sorties

from app.domain.records import problem_to_record
from app.learning.pairwise.features import ReloadFeature, UavFeature, VisitFeature
from app.learning.pairwise.gains import nearness
from app.learning.pairwise.learner import allowed, make_batch
from app.learning.pairwise.rollout import most_likely, play
from app.learning.pairwise.states import UNKNOWN, all_turns, some_states
from app.learning.universal.episodes.observation import scales
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate


def cases(seed, count):
    """Problems with and without bases, each with any plan that is allowed."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        problem = (random_problem, random_sorties)[number % 2](rng)
        yield problem, compile_problem(problem), np.array(random_plan(problem, rng).assignment), rng


def steps_of(states, problem):
    """The step of each state, counted from 0, by what is seen."""
    left = states.seen.uavs[:, 0, UavFeature.STEPS_LEFT] * problem.max_steps
    return problem.max_steps - np.rint(left).astype(int)


def is_allowed(states, t, i, action, n):
    if action == n:
        return True
    if action < n:
        return states.seen.visits[t, i, action, VisitFeature.ALLOWED] == 1.0
    return states.seen.reloads[t, i, action - n - 1, ReloadFeature.ALLOWED] == 1.0


def test_labels_are_what_the_plan_does_and_allowed_in_their_states():
    labels = reloads = late = 0
    for problem, arrays, plan, rng in cases(1, 40):
        states, n = some_states(arrays, plan, 8, rng), problem.n_targets
        steps = steps_of(states, problem)
        for t, row in enumerate(states.action):
            assert (row != UNKNOWN).any(), "a state without a label teaches nothing"
            for i, action in enumerate(row):
                acted = states.seen.uavs[t, i, UavFeature.ACTED] == 1.0
                if acted:
                    assert action == UNKNOWN
                    late += states.seen.uavs[t, i, UavFeature.OUT] == 1.0
                if action != UNKNOWN:
                    assert action == plan[steps[t], i]
                    assert is_allowed(states, t, i, action, n)
                    labels += 1
                    reloads += action > n
    assert labels > 150
    assert reloads > 5
    assert late > 20, "hardly any state in which somebody has acted"


def test_a_uav_without_a_label_has_acted_or_has_no_choice_or_does_what_the_state_forbids():
    for problem, arrays, plan, rng in cases(2, 20):
        states, n = some_states(arrays, plan, 6, rng), problem.n_targets
        for t, step in enumerate(steps_of(states, problem)):
            for i in np.flatnonzero(states.action[t] == UNKNOWN):
                acted = states.seen.uavs[t, i, UavFeature.ACTED] == 1.0
                choices = [
                    j for j in range(n + 1 + problem.n_bases) if j != n and is_allowed(states, t, i, j, n)
                ]
                assert acted or not choices or not is_allowed(states, t, i, plan[step, i], n)


def test_steps_before_the_first_are_not_drawn_and_draws_follow_from_the_seed():
    problem = generate("uniform", 3, 12, 2, np.random.default_rng(3))
    arrays, rng = compile_problem(problem), np.random.default_rng(4)
    plan = np.array(random_plan(problem, rng).assignment)
    whole = steps_of(some_states(arrays, plan, 50, rng), problem)
    late = steps_of(some_states(arrays, plan, 50, rng, first=2), problem)
    assert whole.min() == 0
    assert late.min() == 2
    first, again = (some_states(arrays, plan, 6, np.random.default_rng(5)) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first.seen, again.seen, strict=True))
    assert np.array_equal(first.action, again.action)
    assert np.array_equal(first.distance, nearness(arrays, scales(arrays)[0])[0])


def test_in_states_of_its_own_plan_the_surest_uav_does_what_is_labelled(make_policy):
    """Roll-outs, states and the network that is trained agree on what is seen and who acts first."""
    rng, found = np.random.default_rng(6), 0
    for seed in range(12):
        problem = (random_sorties, random_problem)[seed % 2](rng)
        policy, arrays = make_policy(seed), compile_problem(problem)
        plan = play(policy.agent, arrays, np.zeros(1, np.int64)).plans[0]
        states = some_states(arrays, plan, 12, rng)
        if not len(states.action):
            continue
        batch = make_batch([states], torch.device("cpu"))
        with torch.inference_mode():
            values, _ = policy.agent(batch.sight)
            logits = policy.agent.logits(values).masked_fill(~allowed(batch.sight), -torch.inf)
            best = torch.from_numpy(most_likely(logits.numpy(), problem.n_targets))
            chances = logits.softmax(dim=2).gather(2, best[:, :, None])[:, :, 0]
        idle = batch.action == UNKNOWN
        for t, step in enumerate(steps_of(states, problem)):
            landed = [uav.ret for uav in problem.uavs] | (plan[:step] == problem.n_targets).any(axis=0)
            if not np.array_equal(states.seen.uavs[t, :, UavFeature.ACTED] == 1.0, landed):
                continue  # not the first to act in the step
            surest = int(chances[t].masked_fill(idle[t], -1.0).argmax())
            assert best[t, surest] == batch.action[t, surest]
            found += 1
    assert found > 15


def test_who_can_do_nothing_has_returned_before_others_are_asked():
    """As in a roll-out, which does not ask them: what they carry and their clocks count no more."""
    found = returned = 0
    for _, arrays, plan, rng in cases(8, 20):
        for states in (some_states(arrays, plan, 8, rng), all_turns(arrays, plan).states):
            seen = states.seen
            waits = (seen.uavs[..., UavFeature.OUT] == 1.0) & (seen.uavs[..., UavFeature.ACTED] == 0.0)
            reaches = (seen.reloads[..., ReloadFeature.DISTANCE] < 10).any(axis=2)
            assert (reaches | (seen.uavs[..., UavFeature.VISITS] > 0))[waits].all()
            found += int(waits.sum())
            returned += int((seen.uavs[..., UavFeature.OUT] == 0.0).sum())
    assert found > 60
    assert returned > 20


def test_every_decision_of_a_plan_is_a_turn_and_rewards_add_up():
    turns = 0
    for problem, arrays, plan, rng in cases(7, 30):
        n, found = problem.n_targets, all_turns(arrays, plan)
        acting = np.arange(len(found.uav)), found.uav
        assert (np.diff(found.step * problem.n_uavs + found.uav) > 0).all(), "the order of the simulator"
        assert np.array_equal(found.states.action[acting], plan[found.step, found.uav])
        assert ((found.states.action != UNKNOWN).sum(axis=1) == 1).all()
        assert np.array_equal(steps_of(found.states, problem), found.step)
        for t, (step, i) in enumerate(zip(found.step, found.uav, strict=True)):
            assert is_allowed(found.states, t, i, plan[step, i], n)
        flown = {(s, i) for s, row in enumerate(plan) for i, action in enumerate(row) if action != n}
        assert flown <= set(zip(found.step.tolist(), found.uav.tolist(), strict=True))
        turns += len(found.step)
        # Rewards are in a unit of the problem, which is the same for all its plans.
        judged = replay(problem_to_record(problem), plan.tolist())["reward"]
        other = np.array(random_plan(problem, rng).assignment)
        its = replay(problem_to_record(problem), other.tolist())["reward"]
        mine, theirs = found.reward.sum(), all_turns(arrays, other).reward.sum()
        assert mine * its == pytest.approx(theirs * judged, abs=1e-9)
        assert mine * judged >= 0
    assert turns > 60
