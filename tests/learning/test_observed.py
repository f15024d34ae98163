"""Which problems the paper's learners take: what their observation carries, and what the masks keep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from problems import random_problem
from referee import replay
from worlds import random_world

from app.domain.errors import InvalidCheckpoint, InvalidParameters, InvalidProblem
from app.domain.matrices import Matrix
from app.domain.records import problem_to_record
from app.domain.surroundings import Base, NoFlyZone
from app.domain.world_use import later_fields, used_fields, uses_world
from app.learning.checkpoints.checkpoint import verify
from app.learning.checkpoints.source_policies import SourcePolicies
from app.learning.dqn import Dqn
from app.learning.paper.architecture import QMIX_PAPER_1
from app.learning.paper.observed import unobserved
from app.learning.parameters import DqnParameters, QmixParameters
from app.learning.qmix import Qmix, qmix_config
from app.library.entries import new_policy
from app.solvers.protocol import SolverContext
from app.solvers.registry import ALGORITHMS, parse_parameters, require_supported, unusable_architecture
from app.solvers.stop import never
from policy_store.database import Database
from policy_store.library import PolicyLibrary

QUICK = {"n_epochs": 6, "buffer_size": 4, "batch_size": 4, "learning_starts": 2, "evaluate_per_epoch": 3}
ZONE = NoFlyZone("prison", ((0.4, 0.4), (0.6, 0.4), (0.5, 0.6)))
PAPER_MODES = [("qmix", {"mode": "paper"}), ("transfer_qmix", {"mode": "paper"}), ("dqn", {})]


def solve(problem, seed=1):
    parameters = QmixParameters(mode="paper", **QUICK)
    return Qmix(parameters, SolverContext()).solve(problem, seed, never, lambda _: None)


def barred(problem):
    """The same problem with each field, alone, that the reward depends on beyond what is observed."""
    r = 2 * problem.n_uavs + problem.n_targets
    straight = Matrix(np.ones((r, r)) - np.eye(r))
    own = ((problem.n_targets,) * problem.n_uavs,)
    located = {
        "uavs": tuple(replace(uav, location=i) for i, uav in enumerate(problem.uavs)),
        "targets": tuple(
            replace(target, location=problem.n_uavs + j) for j, target in enumerate(problem.targets)
        ),
    }
    return {
        "bases": replace(problem, bases=(Base("base-1", 0.5, 0.5),)),
        "no_fly_zones": replace(problem, no_fly_zones=(ZONE,)),
        "matrices": replace(problem, matrices={"road": straight}, **located),
        "objective.half_life": replace(problem, objective=replace(problem.objective, half_life=1.0)),
        "objective.makespan_weight": replace(
            problem, objective=replace(problem.objective, makespan_weight=0.1)
        ),
        "objective.change_weight": replace(
            problem, start_plan=own, objective=replace(problem.objective, change_weight=0.1)
        ),
    }


def carried(problem):
    """A problem without what is refused."""
    if problem.matrices is not None:
        return None
    objective = replace(problem.objective, half_life=None, makespan_weight=0.0, change_weight=0.0)
    return replace(problem, objective=objective, no_fly_zones=())


def test_fields_that_are_refused_are_these(problem):
    assert unobserved().keys() == barred(problem).keys()
    assert unobserved().keys() <= set(later_fields())


@pytest.mark.parametrize(("algorithm", "parameters"), PAPER_MODES)
def test_each_is_refused_by_name_with_what_to_do_instead(problem, algorithm, parameters):
    given = parse_parameters(algorithm, parameters)
    require_supported(algorithm, given, problem)
    for name, with_it in barred(problem).items():
        with pytest.raises(InvalidProblem) as refused:
            require_supported(algorithm, given, with_it)
        (violation,) = refused.value.violations
        assert violation.pointer == "/" + name.replace(".", "/")
        assert name.rpartition(".")[2] in violation.detail
        assert violation.detail.endswith("; `auto` takes it")


def test_all_of_them_are_named_at_once(problem):
    objective = replace(problem.objective, half_life=1.0)
    with pytest.raises(InvalidProblem) as refused:
        require_supported("dqn", DqnParameters(), replace(problem, no_fly_zones=(ZONE,), objective=objective))
    assert {v.pointer for v in refused.value.violations} == {"/no_fly_zones", "/objective/half_life"}


def test_other_algorithms_and_modes_take_every_field(problem):
    for name in ALGORITHMS.keys() - {"dqn"}:
        for with_it in barred(problem).values():
            require_supported(name, parse_parameters(name, {}), with_it)


def test_what_is_refused_is_listed_mode_by_mode():
    listed = {
        name: {(row.field, row.mode) for row in each.unsupported()} for name, each in ALGORITHMS.items()
    }
    assert listed.pop("dqn") == {(name, None) for name in unobserved()}
    for name in ("qmix", "transfer_qmix"):
        assert listed.pop(name) == {(field, "paper") for field in unobserved()}
    assert not any(listed.values())


@pytest.mark.parametrize("name", unobserved())
def test_the_networks_themselves_refuse_it_too(problem, name):
    """Also where service mode has come to them, because of the size of a problem."""
    with_it = barred(problem)[name]
    with pytest.raises(InvalidProblem, match=r"`auto` takes it"):
        solve(with_it)
    with pytest.raises(InvalidProblem, match=r"`auto` takes it"):
        Dqn(DqnParameters(**QUICK), SolverContext()).solve(with_it, 1, never, lambda _: None)


def test_what_is_taken_is_flown_legally_and_earns_what_is_told():
    """Every mixture of the other fields of the world, against the referee; most use some."""
    rng, used = np.random.default_rng(3), set()
    for seed in range(120):
        problem = carried(random_world(rng, max_uavs=3, max_targets=4))
        if problem is None:
            continue
        used |= {each.name for each in used_fields(problem)}
        solution = solve(problem, seed)
        told = replay(problem_to_record(problem), solution.plan.assignment)["reward"]
        assert max(solution.history.reward) <= told + 1e-9
        nothing = [[problem.n_targets] * problem.n_uavs]
        assert told >= replay(problem_to_record(problem), nothing)["reward"] - 1e-12
    taken = set(later_fields()) - unobserved().keys()
    of_matrices = {"uavs.location", "uavs.home_location", "uavs.profile", "targets.location"}
    # A capacity bounds what planned loading takes aboard, no flight; the others are nothing without bases.
    of_bases = {"uavs.capacity", "uavs.full_load", "uavs.bases", "objective.loading"}
    assert used == taken - of_matrices - of_bases


def test_a_used_field_is_told_at_its_first_place():
    problem = random_problem(np.random.default_rng(0), max_uavs=6)
    assert not uses_world(problem)
    *others, last = problem.targets
    later = replace(problem, targets=(*others, replace(last, earliest=0.5)))
    assert list(used_fields(later)) == [("targets.earliest", f"/targets/{len(others)}/earliest")]


@pytest.fixture
def library(tmp_path, problem):
    """A library with one policy for the size of the problem."""
    database = Database(f"sqlite:///{tmp_path / 'library.sqlite3'}")
    library = PolicyLibrary(database)
    library.migrate()
    library.add(new_policy("a town", problem, solve(problem).checkpoint, policy_id="one-size"))
    yield library, database.url
    database.dispose()


def test_a_source_that_cannot_serve_a_problem_is_not_offered(library, problem):
    _, url = library
    policies, config = SourcePolicies(url), qmix_config(problem, QmixParameters(mode="paper").table())
    found = policies.asked_for("one-size", problem, config=config, any_size=True)
    assert (found.policy.id, unusable_architecture(problem)) == ("one-size", None)
    for name, with_it in barred(problem).items():
        assert unusable_architecture(with_it) == QMIX_PAPER_1, name
        with pytest.raises(InvalidParameters, match="does not observe all") as refused:
            policies.asked_for("one-size", with_it, config=config, any_size=True)
        assert refused.value.violations[0].pointer == "/parameters/source"


def test_weights_are_not_registered_for_a_task_that_they_cannot_serve(problem):
    checkpoint = solve(problem).checkpoint
    verify(checkpoint, problem)
    with pytest.raises(InvalidCheckpoint, match="do not observe the task: /no_fly_zones"):
        verify(checkpoint, replace(problem, no_fly_zones=(ZONE,)))
