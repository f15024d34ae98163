"""What every algorithm in the registry owes, whatever it does inside."""

from dataclasses import replace

import numpy as np
import pytest
from problems import random_problem
from referee import replay
from stopping import at_once

from app.domain.plan import Plan
from app.domain.records import problem_to_record
from app.learning.checkpoints.checkpoint import encode
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.parameters import QmixParameters
from app.library.entries import new_policy
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.registry import ALGORITHMS, create_solver, parse_parameters
from app.solvers.stop import never
from policy_store.database import Database
from policy_store.library import PolicyLibrary

SERVICE = "transfer_qmix in service mode"
SCRATCH = "qmix in service mode"
LEARNING = {"n_epochs": 12, "evaluate_per_epoch": 3, "buffer_size": 4, "batch_size": 4}
QUICK = {
    SERVICE: {
        "mode": "service",
        "samples": 3,
        "replans": 9,
        "n_epochs": 2,
        "polish": True,
        "polish_moves": 1000,
    },
    SCRATCH: {"mode": "service", "n_epochs": 12, "batch_size": 4, "evaluate_per_epoch": 4},
    "transfer_qmix": {**LEARNING, "mode": "paper"},
    "qmix": {**LEARNING, "mode": "paper"},
    "dqn": LEARNING,
    "ga": {"num_total": 8, "iteration": 10},
    "local_search": {"moves": 3000, "restarts": 1},
    "exact": {"nodes": 20},
    "auto": {"moves": 3000, "restarts": 1, "policy": True},
    **{
        name: {"evaluations": 300}
        for name in (
            "particle_swarm",
            "grey_wolf",
            "beetle_antennae",
            "ant_colony",
            "contract_net",
            "bundles",
            "semi_random_q",
        )
    },
}
SHAPES = ((2, 3, 2), (3, 4, 1))


def problems():
    """Problems of the contract's shapes with every option of the specification."""
    rng = np.random.default_rng(31)
    found = []
    while len(found) < 4:
        problem = random_problem(rng, max_uavs=3, max_targets=4)
        if (problem.n_uavs, problem.n_targets, problem.n_materials) in SHAPES:
            found.append(problem)
    return found


PROBLEMS = problems()


@pytest.fixture(scope="module")
def context(tmp_path_factory):
    """A library with one source policy for each of the shapes, and one for every size."""
    url = f"sqlite:///{tmp_path_factory.mktemp('library') / 'library.sqlite3'}"
    database = Database(url)
    library = PolicyLibrary(database)
    library.migrate()
    for shape in SHAPES:
        task = generate("uniform", *shape, np.random.default_rng(1))
        solution = solve("qmix", task, SolverContext())
        library.add(new_policy("source", task, solution.checkpoint))
    library.add(new_policy("every size", task, for_every_size(task)))
    database.dispose()
    return SolverContext(url)


def for_every_size(task):
    """A checkpoint of random weights."""
    config = PairwiseConfig(width=8, layers=1, qmix_hidden_dim=4)
    return encode(
        PairwisePolicy.of_seed(config, 1),
        config=config,
        task=task,
        algorithm="qmix",
        seed=1,
        parameters=QmixParameters(),
        metrics={},
    )


def quick(name):
    """Parameters with which an algorithm is quick, and its name in the registry."""
    algorithm = {SERVICE: "transfer_qmix", SCRATCH: "qmix"}.get(name, name)
    return algorithm, parse_parameters(algorithm, QUICK.get(name, {}))


def solve(name, problem, context, stop=never, report=lambda progress: None, seed=7):
    return create_solver(*quick(name), context).solve(problem, seed, stop, report)


every_algorithm = pytest.mark.parametrize("name", [*ALGORITHMS, SERVICE, SCRATCH])


@every_algorithm
def test_plans_are_legal_and_never_worse_than_staying_at_home(name, context):
    for problem in PROBLEMS:
        solution = solve(name, problem, context)
        expected = replay(problem_to_record(problem), solution.plan.assignment)
        at_home = reward_of(problem, Plan.empty(problem.n_uavs, problem.n_targets))
        assert reward_of(problem, solution.plan) == pytest.approx(expected["reward"], abs=1e-9)
        assert expected["reward"] >= at_home - 1e-9
        assert len(solution.history.epoch) == len(solution.history.reward) > 0
        assert solution.history.epoch == sorted(solution.history.epoch)


@every_algorithm
def test_the_same_seed_gives_the_same_solution(name, context):
    first, again = (solve(name, PROBLEMS[0], context) for _ in range(2))
    assert (first.plan, first.history, first.checkpoint) == (again.plan, again.history, again.checkpoint)


@every_algorithm
def test_stopped_at_once_it_still_answers(name, context):
    for problem in PROBLEMS:
        plan = solve(name, problem, context, stop=at_once()).plan
        assert replay(problem_to_record(problem), plan.assignment)


@every_algorithm
def test_progress_rises_and_tells_the_truth(name, context):
    for problem in PROBLEMS:
        told = []
        solution = solve(name, problem, context, report=told.append)
        assert [p.fraction for p in told] == sorted(p.fraction for p in told)
        assert [p.best_reward for p in told] == sorted(p.best_reward for p in told)
        for progress in told:
            assert 0 <= progress.fraction <= 1
            assert reward_of(problem, progress.incumbent) == pytest.approx(progress.best_reward, abs=1e-9)
        if told:
            assert reward_of(problem, solution.plan) >= told[-1].best_reward - 1e-9


@every_algorithm
@pytest.mark.parametrize("change", [{"ret": True}, {"voyage": 0.0}, {"loadlist": (0.0, 0.0)}])
def test_where_nothing_can_be_done_everybody_stays_at_home(name, context, change):
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(2))
    problem = replace(problem, uavs=tuple(replace(uav, **change) for uav in problem.uavs))
    assert solve(name, problem, context).plan == Plan.empty(2, 3)


@every_algorithm
def test_the_parameters_that_were_used_come_back(name, context):
    algorithm, given = quick(name)
    used = solve(name, PROBLEMS[0], context).parameters
    left_open = {field for field, value in given.model_dump().items() if value is None}
    assert used.model_dump(exclude=left_open) == given.model_dump(exclude=left_open)
    assert parse_parameters(algorithm, used.model_dump()) == used
