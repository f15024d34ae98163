import numpy as np
from problems import random_problem

from app.learning.paper.architecture import TARGET_FIELDS, UAV_FIELDS
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.observations import features_of, write_states
from app.library.description import task_description
from app.simulation.arrays import compile_problem
from app.simulation.simulator import act, end_step, new_episodes, verdict
from app.simulation.visit import ALLOWED


def test_state_at_the_beginning_is_the_task_description():
    rng = np.random.default_rng(0)
    for _ in range(50):
        problem = random_problem(rng)
        arrays, features = compile_problem(problem), features_of(problem)
        state = np.full((1, len(task_description(problem))), np.nan, np.float32)
        write_states(features, new_episodes(arrays, 1), state)
        np.testing.assert_allclose(state[0], task_description(problem).astype(np.float32), rtol=1e-6)


def test_state_follows_positions_distances_and_amounts():
    """Random legal actions; after each, the changing fields are looked up in the simulator's own state."""
    rng = np.random.default_rng(1)
    visits, homes = 0, 0
    for _ in range(40):
        problem = random_problem(rng)
        m, n, k = problem.n_uavs, problem.n_targets, problem.n_materials
        arrays, features = compile_problem(problem), features_of(problem)
        episodes = new_episodes(arrays, 1)
        description = task_description(problem)
        uavs = description[: m * (UAV_FIELDS + k)].reshape(m, -1).copy()
        targets = description[m * (UAV_FIELDS + k) :].reshape(n, TARGET_FIELDS + k).copy()
        voyage = max(u.voyage for u in problem.uavs)
        amount = max(max(item.loadlist) for item in (*problem.uavs, *problem.targets)) or 1.0
        state = np.zeros((1, len(description)), np.float32)
        while not episodes.done[0]:
            for i in range(m):
                allowed = [j for j in range(n) if verdict(arrays, episodes, 0, i, j) == ALLOWED]
                action = int(rng.choice([*allowed, n]))
                was_out = not episodes.ret[0, i]
                act(arrays, episodes, 0, i, action)
                if action < n:
                    visits += 1
                    uavs[i, 2:4] = targets[action, :2]
                elif was_out:
                    homes += 1
                    uavs[i, 2:4] = uavs[i, :2]
            uavs[:, 6] = np.minimum(episodes.flown[0] / voyage, 1e6)
            uavs[:, 7] = episodes.ret[0]
            uavs[:, 8:] = episodes.load[0] / amount
            targets[:, 3:] = episodes.need[0] / amount
            write_states(features, episodes, state)
            expected = np.concatenate([uavs.ravel(), targets.ravel()])
            np.testing.assert_allclose(state[0], expected.astype(np.float32), rtol=1e-5, atol=1e-6)
            end_step(arrays, episodes, 0)
    assert visits > 100
    assert homes > 80


def test_an_agents_observation_is_its_own_row_and_all_target_rows(problem):
    sizes = SwarmEnvironment(problem).sizes
    assert sizes.own_features == UAV_FIELDS + problem.n_materials
    assert sizes.common_features == problem.n_targets * (TARGET_FIELDS + problem.n_materials)
    assert sizes.state_features == len(task_description(problem))
