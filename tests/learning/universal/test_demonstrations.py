"""Searched plans, corrections of what the policy did, and their files."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from referee import replay

from app.domain.records import problem_to_record
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.universal.training.corrections import continued, correct, draw_step, first_difference
from app.learning.universal.training.curriculum import SHAPES, draw_problem
from app.learning.universal.training.demonstrations import (
    Series,
    demonstrate,
    moves_for,
    read_demonstrations,
    write_demonstrations,
)
from app.simulation.drawn_generator import drawn
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan

HOME = 9
SERIES = Series("some", (4,), 3)


class Recorded(PairwisePolicy):
    """Keeps what it played last."""

    def play(self, *arguments, **named):
        self.played = super().play(*arguments, **named)
        return self.played


@pytest.fixture(scope="module")
def policy():
    """Random weights, with which it never returns as long as something else is allowed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(1)
        policy = Recorded(PairwiseConfig(width=8, layers=1, qmix_hidden_dim=4))
    agent = policy.agent
    with torch.no_grad():
        # What GELU gives is least here, and every unit of it counts for the action.
        agent.home_head.weight.zero_()
        agent.home_head.bias.fill_(-0.7518)
        agent.score.weight.abs_()
        agent.sharpness.fill_(6.0)
    return policy


def problems(count):
    """Of a family, and of none: some with bases."""
    rng = np.random.default_rng(5)
    for _ in range(count):
        yield generate("mid_mission", 4, 8, 2, rng)
        yield drawn(3, 8, 2, rng)


def test_demonstrations_are_legal_and_better_than_the_greedy_rule():
    rng = np.random.default_rng(10)
    gained = 0.0
    for _ in range(4):
        problem = generate("single_base", 5, 8, 2, rng)
        shown = demonstrate(problem, 20_000, rng)
        record = problem_to_record(problem)
        assert replay(record, shown.plan.tolist())["reward"] == pytest.approx(shown.reward)
        gained += shown.reward - replay(record, greedy_plan(problem).as_array().tolist())["reward"]
    assert gained > 0.1


def test_where_nothing_can_be_earned_nothing_is_shown():
    problem = generate("uniform", 2, 3, 1, np.random.default_rng(1))
    problem = replace(problem, uavs=tuple(replace(uav, loadlist=(0.0,)) for uav in problem.uavs))
    assert demonstrate(problem, 1000, np.random.default_rng(1)) is None


def test_drawn_problems_are_of_families_and_of_none_and_plan_no_amounts():
    rng = np.random.default_rng(9)
    found = [draw_problem(rng) for _ in range(60)]
    shapes = {(m, n) for m, n, _ in SHAPES}
    assert not any(problem.plans_unloading or problem.plans_loading for problem in found)
    assert 10 <= sum((problem.n_uavs, problem.n_targets) not in shapes for problem in found) < 60
    assert any(problem.bases for problem in found)


def test_corrections_begin_where_the_policy_was(policy):
    rng, firsts, gained = np.random.default_rng(6), [], []
    for problem in problems(12):
        made = correct(problem, policy, 2000, rng)
        if made is None:
            continue
        plan = policy.played.plans[0]
        assert made.problem == problem
        assert np.array_equal(made.plan[: made.first], plan[: made.first])
        assert made.first < len(made.plan)
        assert made.played == policy.played.rewards[0]
        told = replay(problem_to_record(problem), made.plan.tolist())
        assert told["reward"] == pytest.approx(made.reward)
        assert made.reward >= made.played - 1e-9
        firsts.append(made.first)
        gained.append(made.reward - made.played)
    assert {0, 1} <= set(firsts)
    assert max(gained) > 0.1


def test_what_was_flown_and_what_was_promised_before_stays():
    problem = generate("uniform", 2, 9, 1, np.random.default_rng(2))
    first, second = problem.uavs
    areas = [target.id for target in problem.targets]
    problem = replace(problem, uavs=(replace(first, committed=(areas[4], areas[2])), second))
    plan = np.array([[4, 7], [2, HOME], [1, HOME], [HOME, HOME]])
    committed = [
        tuple(uav.committed for uav in continued(problem, plan, step).uavs) for step in range(len(plan))
    ]
    promised = (areas[4], areas[2])
    assert committed == [
        (promised, ()),
        (promised, (areas[7],)),
        (promised, (areas[7],)),
        ((*promised, areas[1]), (areas[7],)),
    ]
    assert continued(problem, plan, 1).start_plan == ((4, 7), (2, HOME), (1, HOME))


def test_steps_are_drawn_up_to_the_last_action_and_the_first_reload():
    rng = np.random.default_rng(3)

    def steps(*rows):
        return {draw_step(np.array(rows), HOME, rng) for _ in range(60)}

    assert steps([1, 2], [3, HOME], [HOME, HOME], [HOME, HOME]) == {0, 1}
    assert steps([1, 2], [HOME + 1, 3], [4, 5]) == {0, 1}
    assert steps([HOME, HOME], [HOME, HOME]) == {0}


def test_first_difference():
    plan = np.array([[1, 2], [3, 4], [HOME, HOME]])
    assert first_difference(plan, plan[:2]) == 2
    assert first_difference(plan, np.array([[1, 2], [3, 5], [0, 0]])) == 1


def make(problem, rng):
    """Demonstrate small problems only, so that it takes no time."""
    return demonstrate(problem, 100, rng) if problem.n_uavs * problem.n_targets < 60 else None


def test_file_is_decided_by_seed_and_number_and_made_once(tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    for folder in (one, two):
        folder.mkdir()
    first, again = (SERIES.write(folder, 7, 1, make) for folder in (one, two))
    assert first.read_bytes() == again.read_bytes()
    other = [SERIES.write(one, 7, 2, make), SERIES.write(one, 8, 1, make)]
    other.append(Series("others", (5,), 3).write(one, 7, 1, make))
    assert len({path.read_bytes() for path in (first, *other)}) == 4
    assert len(read_demonstrations(first)) == 3
    written = first.stat().st_mtime_ns
    assert SERIES.write(one, 7, 1, make).stat().st_mtime_ns == written


def test_what_is_read_is_what_was_written(policy, tmp_path):
    rng = np.random.default_rng(8)
    shown = [correct(problem, policy, 200, rng) for problem in problems(3)]
    shown = [each for each in shown if each is not None]
    write_demonstrations(tmp_path / "file.jsonl", shown)
    for one, two in zip(shown, read_demonstrations(tmp_path / "file.jsonl"), strict=True):
        assert np.array_equal(one.plan, two.plan)
        assert one._replace(plan=two.plan) == two._replace(plan=two.plan)
    assert [path.name for path in tmp_path.iterdir()] == ["file.jsonl"]


def test_larger_problems_are_searched_longer_within_limits():
    rng = np.random.default_rng(1)
    small, middle, large = (generate("uniform", *size, 1, rng) for size in [(2, 3), (10, 20), (50, 100)])
    assert [moves_for(each, 1.0) for each in (small, middle, large)] == [9_000, 36_000, 180_000]
    assert moves_for(middle, 0.5) == 18_000
