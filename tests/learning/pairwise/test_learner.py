"""The learner: a task with one obvious answer is learned, values are what is earned, targets follow."""

import copy

import numpy as np
import pytest
import torch
from problems import random_plan
from stopping import After
from worlds import random_sorties

from app.domain.problem import UAV, Objective, Problem, Target
from app.learning.pairwise.learner import Learner, allowed, joint_values, make_batch, make_decisions
from app.learning.pairwise.rollout import play
from app.learning.pairwise.states import UNKNOWN, all_turns, some_states
from app.learning.universal.updates.returns import lambda_returns
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate

CPU = torch.device("cpu")


def beside(rng: np.random.Generator, m: int) -> tuple[Problem, np.ndarray]:
    """A problem whose best plan is plain: every UAV flies to the one area beside it, of as many far ones."""
    places = np.stack([10.0 * np.arange(m), rng.uniform(0, 3, m)], axis=1)
    beside_uav, numbers = rng.permutation(m), rng.permutation(m + 2)
    uavs = tuple(UAV(f"u{i}", x, y, x, y, 1.0, 100.0, (3.0,)) for i, (x, y) in enumerate(places.tolist()))
    areas: list[Target | None] = [None] * (m + 2)
    plan = np.empty((1, m), np.int64)
    for i in beside_uav:
        x, y = (places[i] + rng.uniform(-0.5, 0.5, 2)).tolist()
        areas[numbers[i]] = Target(f"a{i}", x, y, 5.0, (3.0,))
        plan[0, i] = numbers[i]
    for far in range(2):
        areas[numbers[m + far]] = Target(f"far{far}", 5.0 + 10 * far, 30.0, 5.0, (3.0,))
    return Problem(uavs, tuple(areas), max_steps=1, objective=Objective(distance_weight=0.1)), plan


def make_states(count, rng, m=4):
    problems = [beside(rng, m) for _ in range(count)]
    return problems, [some_states(compile_problem(problem), plan, 2, rng) for problem, plan in problems]


def test_a_task_with_one_obvious_answer_is_learned_and_played(make_policy):
    rng, policy = np.random.default_rng(1), make_policy(1)
    _, states = make_states(24, rng)
    decisions = [
        all_turns(compile_problem(problem), plan) for problem, plan in (beside(rng, 4) for _ in range(8))
    ]
    batch, episodes = make_batch(states, CPU), make_decisions(decisions, CPU)
    fresh = [beside(rng, m) for m in (3, 4, 5, 6) for _ in range(3)]

    def right():
        plans = [
            play(policy.agent, compile_problem(each), np.zeros(1, np.int64)).plans[0] for each, _ in fresh
        ]
        return sum(np.array_equal(plan, best) for plan, (_, best) in zip(plans, fresh, strict=True))

    before = right()
    learner = Learner(policy.agent, policy.mixer, lr=1e-2, td_weight=0.2)
    losses = [learner.update(1.0, batch, episodes if update % 2 == 0 else None) for update in range(60)]
    assert losses[0]["imitation"] > 0.5
    assert losses[-2]["imitation"] < 0.1
    assert losses[-2]["td"] < 0.3 * losses[0]["td"]
    assert set(losses[1]) == {"imitation"}
    assert before < 3
    assert right() == len(fresh), "also swarms of other sizes than those it has learned from"


@pytest.fixture(scope="module")
def world():
    """States and whole episodes of problems of many sizes, with and without bases."""
    rng, states, turns = np.random.default_rng(2), [], []
    while len(states) < 8:
        problem = random_sorties(rng) if len(states) % 2 else generate("uniform", 3, 5, 2, rng)
        plan = np.array(random_plan(problem, rng).assignment)
        arrays = compile_problem(problem)
        found = some_states(arrays, plan, 3, rng)
        if len(found.action) and len((whole := all_turns(arrays, plan)).step):
            states.append(found)
            turns.append(whole)
    return states, turns


def test_a_batch_has_every_state_and_what_was_done(world):
    states, _ = world
    batch = make_batch(states, CPU)
    m, n, d = batch.sight.uavs.shape[1], batch.sight.areas.shape[1], batch.sight.bases.shape[1]
    row = 0
    for part in states:
        count, uavs = part.action.shape
        areas, bases = part.seen.areas.shape[1], part.seen.bases.shape[1]
        rows = slice(row, row + count)
        assert np.array_equal(batch.sight.visits[rows, :uavs, :areas].numpy(), part.seen.visits)
        assert np.array_equal(batch.sight.reloads[rows, :uavs, :bases].numpy(), part.seen.reloads)
        places = np.r_[0:areas, n : n + bases]
        for distance in batch.sight.distance[rows].numpy():
            assert np.array_equal(distance[places][:, places], part.distance)
        present = batch.sight.present[rows]
        assert (present.sum(dim=1) == uavs + areas + bases).all()
        assert present[:, np.r_[0:uavs, m + places]].all()
        # Actions by what they are: a visit, "return", or a reload.
        theirs = part.action
        ours = batch.action[rows, :uavs].numpy()
        assert np.array_equal(ours[theirs < areas], theirs[theirs < areas])
        assert (ours[theirs == areas] == n).all()
        assert np.array_equal(ours[theirs > areas] - n, theirs[theirs > areas] - areas)
        assert (batch.action[rows, uavs:] == UNKNOWN).all()
        row += count
    assert row == len(batch.action)
    assert batch.sight.bases.shape[1] == d > 0
    known = batch.action != UNKNOWN
    assert allowed(batch.sight)[known].gather(1, batch.action[known][:, None]).all()


def test_what_a_batch_says_of_a_state_is_what_it_says_alone(world, make_policy):
    states, _ = world
    agent = make_policy(3).agent
    with torch.inference_mode():
        together = make_batch(states, CPU)
        values, _ = agent(together.sight)
        logits = agent.logits(values).masked_fill(~allowed(together.sight), -torch.inf)
        known = together.action != UNKNOWN
        chances = logits[known].log_softmax(dim=1).gather(1, together.action[known][:, None])[:, 0]
        alone = []
        for part in states:
            batch = make_batch([part], CPU)
            mine = agent.logits(agent(batch.sight)[0]).masked_fill(~allowed(batch.sight), -torch.inf)
            some = batch.action != UNKNOWN
            alone.append(mine[some].log_softmax(dim=1).gather(1, batch.action[some][:, None])[:, 0])
    assert torch.allclose(chances, torch.cat(alone), atol=1e-4)


def test_q_tot_rises_with_the_value_of_every_agent(world, make_policy):
    _, turns = world
    policy, decisions = make_policy(4), make_decisions(turns, CPU)
    with torch.no_grad():
        values, hidden = policy.agent(decisions.batch.sight)
    acting = (torch.arange(len(decisions.uav)), decisions.uav)
    chosen = values[acting].gather(1, decisions.batch.action[acting][:, None])[:, 0].requires_grad_()
    joint, running = joint_values(decisions, chosen, hidden[acting], policy.mixer)
    for episode, step in zip(*torch.nonzero(running, as_tuple=True), strict=True):
        (slope,) = torch.autograd.grad(joint[episode, step], chosen, retain_graph=True)
        own = (decisions.episode == episode) & (decisions.step == step)
        assert own.any()
        assert (slope[own] > 0).all(), "the value of each that acted in the step counts"
        assert (slope[~own] == 0).all(), "and of nobody else"


def test_values_are_those_of_the_episodes_that_were_flown(world, make_policy):
    """Without bootstrapping, Q_tot becomes what the rest of the episode earns."""
    _, turns = world
    policy, decisions = make_policy(5), make_decisions(turns, CPU)
    learner = Learner(policy.agent, policy.mixer, lr=5e-3, td_weight=1.0, td_lambda=1.0)

    def error():
        with torch.inference_mode():
            values, hidden = policy.agent(decisions.batch.sight)
            acting = (torch.arange(len(decisions.uav)), decisions.uav)
            chosen = values[acting].gather(1, decisions.batch.action[acting][:, None])[:, 0]
            joint, running = joint_values(decisions, chosen, hidden[acting], policy.mixer)
            returns = lambda_returns(decisions.reward, joint, running, 0.99, 1.0)
        wrong = ((joint - returns) * running).square().sum() / running.sum()
        return float(wrong / returns[running > 0].var())

    before = error()
    for _ in range(120):
        learner.update(1.0, decisions=decisions)
    assert before > 0.5
    assert error() < 0.1


def test_targets_follow_slowly_and_only_where_values_are_learned(world, make_policy):
    states, turns = world
    policy = make_policy(6)
    learner = Learner(policy.agent, policy.mixer, lr=1e-3, td_weight=0.2, polyak=0.1)
    batch, decisions = make_batch(states, CPU), make_decisions(turns, CPU)
    start = [p.clone() for p in learner.target_agent.parameters()]
    learner.update(1.0, batch)
    assert all(map(torch.equal, learner.target_agent.parameters(), start))
    learner.update(1.0, batch, decisions)
    parts = zip(learner.target_agent.parameters(), start, policy.agent.parameters(), strict=True)
    for slow, before, fast in parts:
        assert torch.allclose(slow, before + 0.1 * (fast - before), atol=1e-6)
        assert slow.grad is None


def test_every_weight_is_trained(world, make_policy):
    states, turns = world
    policy = make_policy(7)
    before = {name: p.clone() for name, p in policy.named_parameters()}
    learner = Learner(policy.agent, policy.mixer, lr=1e-3, td_weight=0.2)
    for _ in range(2):
        learner.update(1.0, make_batch(states, CPU), make_decisions(turns, CPU))
    assert [name for name, p in policy.named_parameters() if torch.equal(p, before[name])] == []


@pytest.mark.parametrize("asked", [1, 2, 3])
def test_an_update_that_is_stopped_changes_nothing(world, make_policy, asked):
    states, turns = world
    policy = make_policy(8)
    learner = Learner(policy.agent, policy.mixer, lr=1e-2, td_weight=0.2)
    before = copy.deepcopy(learner.networks.state_dict())
    stop = After(asked - 1)
    assert learner.update(1.0, make_batch(states, CPU), make_decisions(turns, CPU), stop) == {}
    after = learner.networks.state_dict()
    assert all(torch.equal(after[name], tensor) for name, tensor in before.items())
    assert stop.asked == asked, "it went on after it was told to stop"
