import itertools

import numpy as np
import pytest
from brute_force import best_reward
from problems import random_problem
from referee import Illegal, replay

from app.domain.errors import ProblemTooLarge
from app.domain.plan import Plan
from app.domain.records import problem_to_record
from app.learning.dqn import Dqn
from app.learning.paper.joint_environment import MAX_JOINT_ACTIONS, JointEnvironment, count_joint_actions
from app.learning.parameters import DqnParameters
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.stop import never


def solve(problem, seed=1, stop=never, **parameters):
    solver = Dqn(DqnParameters(**parameters), SolverContext())
    return solver.solve(problem, seed, stop, lambda progress: None)


def reward(problem, plan):
    return replay(problem_to_record(problem), [list(row) for row in plan.assignment])["reward"]


@pytest.mark.parametrize("seed", range(3))
def test_finds_the_optimum_of_a_tiny_problem(seed):
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(seed))
    solution = solve(problem, n_epochs=800, learning_starts=32, epsilon_anneal_steps=1000, lr=1e-3)
    best = best_reward(problem_to_record(problem))
    assert reward(problem, solution.plan) == pytest.approx(best)
    assert solution.history.reward[-1] >= 0.9 * best, "the greedy policy too is near it, not only exploration"
    assert solution.checkpoint is None


def test_mask_has_exactly_the_joint_actions_that_the_referee_allows():
    """Along random episodes of random problems, every joint action is tried on the referee."""
    rng = np.random.default_rng(3)
    seen = {True: 0, False: 0}
    for _ in range(25):
        problem = random_problem(rng, max_uavs=3, max_targets=3)
        record, n = problem_to_record(problem), problem.n_targets
        environment = JointEnvironment(problem)
        a = environment.sizes.n_actions
        state, mask = np.zeros(environment.sizes.state_features, np.float32), np.zeros((1, a), np.bool_)
        rows = []
        while not environment.done:
            environment.observe(state, mask)
            joints = list(itertools.product(range(n + 1), repeat=problem.n_uavs))
            home = [n in column for column in zip(*rows, strict=True)] or [u.ret for u in problem.uavs]
            for index, joint in enumerate(joints):
                returned = any(h and x != n for h, x in zip(home, joint, strict=True))
                try:
                    replay(record, [*rows, list(joint)])
                    legal = not returned
                except Illegal:
                    legal = False
                assert bool(mask[0, index]) == legal, (joint, rows)
                seen[legal] += 1
            taken = np.zeros(1, np.int64)
            before = replay(record, rows)["reward"] if rows else None
            earned = environment.step(np.zeros((1, a), np.float32), rng.random((1, 2)), 1.0, taken)
            assert mask[0, taken[0]]
            rows.append(list(joints[taken[0]]))
            if before is not None and not problem.objective.charge_return:
                assert earned == pytest.approx(replay(record, rows)["reward"] - before, abs=1e-9)
            played = np.array([[joints.index(tuple(row))] for row in rows])
            assert environment.plan(played) == Plan.of(rows, home=n)
    assert min(seen.values()) > 150


def test_joint_actions_become_the_uavs_actions():
    problem = generate("uniform", 3, 4, 1, np.random.default_rng(0))
    plan = JointEnvironment(problem).plan(np.array([[0 * 25 + 3 * 5 + 4], [4 * 25 + 0 * 5 + 1]]))
    assert plan.assignment == ((0, 3, 4), (4, 0, 1))


def test_plans_are_legal_and_never_worse_than_none():
    rng = np.random.default_rng(8)
    for seed in range(25):
        problem = random_problem(rng, max_uavs=3, max_targets=4)
        solution = solve(problem, seed, n_epochs=8, learning_starts=4)
        nothing = [[problem.n_targets] * problem.n_uavs]
        assert reward(problem, solution.plan) >= replay(problem_to_record(problem), nothing)["reward"] - 1e-12


def test_same_seed_same_answer(problem):
    answers = [solve(problem, seed, n_epochs=30, learning_starts=10) for seed in (1, 1, 2)]
    assert answers[0] == answers[1]
    assert answers[0].history != answers[2].history


def test_too_many_joint_actions_are_refused_with_their_number():
    problem = generate("uniform", 5, 10, 3, np.random.default_rng(0))
    with pytest.raises(
        ProblemTooLarge, match=r"\(N\+1\)\^M = 11\^5 = 161051 joint actions; the limit is 20000"
    ):
        solve(problem)
    with pytest.raises(ProblemTooLarge, match=r"31\^20 = about 10\^29"):
        count_joint_actions(generate("uniform", 20, 30, 3, np.random.default_rng(0)))


def test_the_largest_joint_action_space_is_learned_on():
    problem = generate("uniform", 4, 10, 2, np.random.default_rng(0))
    assert 11**4 == count_joint_actions(problem) <= MAX_JOINT_ACTIONS
    solution = solve(problem, n_epochs=12, learning_starts=4, batch_size=4, buffer_size=10)
    assert reward(problem, solution.plan) > 0
