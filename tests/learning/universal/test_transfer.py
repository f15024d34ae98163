"""Transfer in service mode, end to end with a library: which source, what is done, what comes back."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from problems import random_problem
from referee import replay
from sqlalchemy import text
from stopping import After

from app.domain.errors import InvalidParameters, NoCompatibleSource, ProblemTooLarge
from app.domain.records import problem_to_record
from app.learning.checkpoints.checkpoint import decode, encode, verify
from app.learning.checkpoints.source_policies import preload
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.pairwise.rollout import play
from app.learning.parameters import MAX_SAMPLES, QmixParameters, TransferQmixParameters
from app.learning.qmix import Qmix
from app.learning.transfer import TransferQmix
from app.learning.universal.episodes.effort import effort
from app.learning.universal.request.transfer import fill_in
from app.library.entries import new_policy
from app.library.summary import task_summary
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan
from app.solvers.protocol import SolverContext
from app.solvers.stop import never
from policy_store.database import Database
from policy_store.library import PolicyLibrary

BARE = {"n_epochs": 0, "samples": 0, "polish": False}
SOME = {"n_epochs": 2, "samples": 5, "polish_moves": 2000}
FAMILIES = ("uniform", "clustered", "scarce", "corridor", "deadline", "mid_mission")


def checkpoint(policy, task):
    return encode(
        policy,
        config=policy.config,
        task=task,
        algorithm="qmix",
        seed=1,
        parameters=QmixParameters(),
        metrics={},
        name="a name",
        families=["uniform"],
    )


def source_task(family):
    return generate(family, 6, 9, 2, np.random.default_rng(20))


@pytest.fixture(scope="module")
def policies(make_policy):
    return {family: make_policy(number) for number, family in enumerate(FAMILIES)}


@pytest.fixture(scope="module")
def store(tmp_path_factory, policies):
    """A policy for every size from each of some families, and one for the size 3 x 5 x 2 only."""
    database = Database(f"sqlite:///{tmp_path_factory.mktemp('store') / 'library.db'}")
    library = PolicyLibrary(database)
    library.migrate()
    for family, policy in policies.items():
        task = source_task(family)
        library.add(new_policy(family, task, checkpoint(policy, task), policy_id=family))
    task = generate("uniform", 3, 5, 2, np.random.default_rng(21))
    parameters = QmixParameters(mode="paper", n_epochs=30, learning_starts=10)
    learned = Qmix(parameters, SolverContext()).solve(task, 1, never, lambda _progress: None).checkpoint
    library.add(new_policy("one size", task, learned, policy_id="one-size"))
    yield database.url
    database.dispose()


def solve(store, problem, *, seed=1, stop=never, report=lambda _progress: None, **parameters):
    solver = TransferQmix(TransferQmixParameters(**parameters), SolverContext(store))
    return solver.solve(problem, seed, stop, report)


def greedy_reward(policy, problem):
    return float(play(policy.agent, compile_problem(problem), np.zeros(1, np.int64)).rewards[0])


def nearest(problem):
    def distance(family):
        difference = task_summary(source_task(family)) - task_summary(problem)
        return float((difference**2).sum())

    return sorted(FAMILIES, key=distance), distance


@pytest.fixture
def one_order(monkeypatch):
    """Each policy is rolled out once."""
    for most in ("_ORDERS", "_MOST_ORDERS"):
        monkeypatch.setattr(f"app.learning.universal.episodes.effort.{most}", 1)


@pytest.mark.parametrize(("tried", "given"), [(2, {}), (3, {"samples": 1})])
@pytest.mark.parametrize("family", FAMILIES)
def test_the_best_of_the_nearest_few_is_transferred(store, policies, one_order, family, tried, given):
    problem = generate(family, 7, 11, 3, np.random.default_rng(22))
    order, distance = nearest(problem)
    rewards = {name: greedy_reward(policies[name], problem) for name in order[:tried]}
    solution = solve(store, problem, **{**BARE, **given})
    assert solution.source_policy.id == max(rewards, key=rewards.get)
    assert solution.source_policy.distance == pytest.approx(distance(solution.source_policy.id), rel=1e-5)
    assert solution.history.epoch == [0]
    assert solution.history.reward == [pytest.approx(max(rewards.values()))]


def test_other_roll_outs_can_only_help(store, policies):
    gained = 0.0
    for number in range(6):
        problem = generate("uniform", 6, 9, 2, np.random.default_rng(33 + number))
        solution = solve(store, problem, source="uniform", recombine=False, **BARE)
        earned = reward_of(problem, solution.plan)
        assert earned == pytest.approx(max(*solution.history.reward, 0.0))
        together = solve(store, problem, source="uniform", **BARE)
        assert together.history == solution.history
        assert reward_of(problem, together.plan) >= earned - 1e-9
        assert earned >= greedy_reward(policies["uniform"], problem) - 1e-9
        gained += earned - greedy_reward(policies["uniform"], problem)
    assert gained > 0.01


def test_what_is_put_together_is_never_below_the_greedy_rule(store):
    """Policies with random weights lose to it; alone they have nothing of it."""
    lost = 0
    for number in range(6):
        problem = generate("uniform", 6, 9, 2, np.random.default_rng(53 + number))
        by_rule = reward_of(problem, greedy_plan(problem))
        assert reward_of(problem, solve(store, problem, **BARE).plan) >= by_rule - 1e-9
        lost += reward_of(problem, solve(store, problem, recombine=False, **BARE).plan) < by_rule
    assert lost > 0


def test_one_order_is_one_policy_rolled_out_once(store, policies):
    for number in range(6):
        problem = generate("uniform", 6, 9, 2, np.random.default_rng(33 + number))
        order, _ = nearest(problem)
        solution = solve(store, problem, orders=1, **BARE)
        played = play(policies[order[0]].agent, compile_problem(problem), np.zeros(1, np.int64))
        assert solution.source_policy.id == order[0]
        assert solution.history.reward == [pytest.approx(float(played.rewards[0]))]
        assert reward_of(problem, solution.plan) == pytest.approx(max(float(played.rewards[0]), 0.0))
        assert solution.parameters.orders == 1
        more = solve(store, problem, source=order[0], orders=9, **BARE)
        assert reward_of(problem, more.plan) >= reward_of(problem, solution.plan)
        assert more.parameters.orders == 9


def test_what_was_used_is_answered_and_recorded(store):
    problem = generate("uniform", 3, 5, 2, np.random.default_rng(44))
    solution = solve(store, problem, samples=2, n_epochs=1, polish=False)
    used, recorded = solution.parameters, decode(solution.checkpoint).metadata["parameters"]
    assert recorded == used.model_dump(mode="json")
    assert (used.lr, used.grad_norm_clip, used.epsilon_end, used.buffer_size) == (1e-4, 1.0, 0.2, None)
    named = solve(store, problem, source="one-size", n_epochs=3, polish=False).parameters
    assert (named.lr, named.grad_norm_clip, named.epsilon_start, named.buffer_size) == (5e-4, 10.0, 0.05, 100)
    assert (named.orders, named.samples, named.n_epochs, named.drqn_hidden_dim) == (1, 0, 3, 64)


def test_bare_is_the_policys_greedy_roll_out(store, policies, one_order):
    for number in range(6):
        problem = generate("uniform", 6, 9, 2, np.random.default_rng(23 + number))
        for family in FAMILIES[:3]:
            solution = solve(store, problem, source=family, recombine=False, **BARE)
            played = play(policies[family].agent, compile_problem(problem), np.zeros(1, np.int64))
            earned = reward_of(problem, solution.plan)
            assert solution.source_policy.id == family
            assert earned == pytest.approx(max(played.rewards[0], 0.0))
            if played.rewards[0] > 0:
                rows = solution.plan.as_array()
                assert np.array_equal(played.plans[0][: len(rows)], rows)
            assert solution.checkpoint is None


@pytest.mark.parametrize("given", [SOME, {**SOME, "n_epochs": 0}, {**SOME, "samples": 0, "polish": False}])
def test_never_below_the_source_nor_the_greedy_rule(store, given):
    rng = np.random.default_rng(24)
    for _ in range(5):
        problem = random_problem(rng)
        solution = solve(store, problem, **given)
        rows = [list(row) for row in solution.plan.assignment]
        earned = replay(problem_to_record(problem), rows)["reward"]
        at_home = replay(problem_to_record(problem), [[problem.n_targets] * problem.n_uavs])["reward"]
        floor = max(*solution.history.reward, reward_of(problem, greedy_plan(problem)), at_home)
        assert earned >= floor - 1e-9


def test_each_part_can_only_help(store):
    problem = generate("uniform", 8, 12, 2, np.random.default_rng(25))
    sampled = {**BARE, "samples": 30, "replans": 0}
    replanned = {**sampled, "replans": 90}
    given = [BARE, sampled, replanned, {**replanned, "polish": True, "polish_moves": 20_000}]
    earned = [reward_of(problem, solve(store, problem, **each).plan) for each in given]
    assert earned == sorted(earned)
    assert len(set(earned)) == 4


def test_same_seed_same_answer(store):
    problem = generate("uniform", 5, 8, 2, np.random.default_rng(26))
    first, again, other = (solve(store, problem, seed=seed, **SOME) for seed in (3, 3, 4))
    assert first == again
    assert first.checkpoint != other.checkpoint


@pytest.mark.parametrize("given", [BARE, SOME])
def test_idle_cores_change_nothing_but_the_time(store, given):
    problem = generate("uniform", 9, 24, 2, np.random.default_rng(31))
    parameters = TransferQmixParameters(**given)
    alone, together = (
        TransferQmix(parameters, context).solve(problem, 1, never, lambda _progress: None)
        for context in (SolverContext(store), SolverContext(store, threads=2, spare_threads=lambda: 2))
    )
    assert together == alone


def test_fine_tuned_policies_are_checkpoints_and_sources(store, policies, tmp_path):
    problem = generate("uniform", 5, 8, 2, np.random.default_rng(27))
    solution = solve(store, problem, source="uniform", **SOME)
    verify(solution.checkpoint, problem)
    verify(solution.checkpoint, generate("scarce", 9, 4, 5, np.random.default_rng(28)))
    learned = decode(solution.checkpoint)
    assert learned.metadata["metrics"]["epochs"] == 2
    assert solution.history.epoch == [0, 1, 2]
    assert learned.metadata["parameters"]["samples"] == 5
    before = policies["uniform"].state_dict()
    after = learned.network.state_dict()
    same = {name for name in before if torch.equal(before[name], after[name])}
    # The problem has no bases.
    assert same == {name for name in before if ".base_" in name or ".reload_" in name}
    # The source itself, which the process keeps decoded, has not changed.
    assert solve(store, problem, source="uniform", **SOME) == solution

    database = Database(f"sqlite:///{tmp_path / 'other.db'}")
    library = PolicyLibrary(database)
    library.migrate()
    library.add(new_policy("learned", problem, solution.checkpoint, policy_id="learned"))
    database.dispose()
    carried = solve(database.url, problem, orders=1, **BARE)
    assert (carried.source_policy.id, carried.source_policy.distance) == ("learned", 0.0)
    assert carried.history.reward == [pytest.approx(solution.history.reward[-1])]


def test_stopped_at_any_time_it_returns_a_plan(store):
    problem = generate("uniform", 8, 12, 2, np.random.default_rng(29))
    floor = reward_of(problem, greedy_plan(problem))
    for allowed in (0, 1, 10, 60, 200, 500):
        solution = solve(store, problem, stop=After(allowed), n_epochs=5, samples=20, polish_moves=10**9)
        assert reward_of(problem, solution.plan) >= floor - 1e-9
        assert solution.history.epoch[0] == 0


def test_progress_rises_and_tells_the_truth(store):
    problem, told = generate("uniform", 6, 9, 2, np.random.default_rng(30)), []
    solution = solve(store, problem, report=told.append, **SOME)
    assert len(told) > 5
    assert [p.fraction for p in told] == sorted(p.fraction for p in told)
    assert [p.best_reward for p in told] == sorted(p.best_reward for p in told)
    assert told[-1].fraction == 1.0
    assert told[-1].incumbent == solution.plan
    for progress in told:
        assert reward_of(problem, progress.incumbent) == pytest.approx(progress.best_reward)


def test_what_was_used_comes_back(store):
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(31))
    default = effort(compile_problem(problem))
    used = solve(store, problem).parameters
    assert (used.samples, used.n_epochs, used.polish) == (default.samples, default.n_epochs, True)
    assert used.replans == 0
    assert used.polish_moves == default.polish_moves
    some = {**SOME, "replans": 0, "polish": True, "orders": default.orders, "recombine": True}
    assert solve(store, problem, **SOME).parameters == TransferQmixParameters(**some).in_service()
    assert solve(store, problem, **SOME, replans=4).parameters.replans == 4
    assert solve(store, problem, **{**BARE, "samples": 5}).parameters.replans == 15
    most = fill_in(TransferQmixParameters(samples=MAX_SAMPLES), default).parameters
    assert TransferQmixParameters.model_validate(most.model_dump()) == most
    bare = {**BARE, "replans": 0, "polish_moves": 0, "orders": default.orders, "recombine": True}
    assert solve(store, problem, **BARE).parameters == TransferQmixParameters(**bare).in_service()


def test_a_preloaded_library_is_asked_for_no_weights_and_a_damaged_policy_costs_no_other(
    tmp_path, policies, caplog
):
    problem = generate("uniform", 4, 6, 2, np.random.default_rng(37))
    database = Database(f"sqlite:///{tmp_path / 'damaged.db'}")
    library = PolicyLibrary(database)
    library.migrate()
    for number, family in enumerate(("uniform", "scarce")):
        # Weights that no other test has had decoded.
        policy = PairwisePolicy.of_seed(policies[family].config, 100 + number)
        task = source_task(family)
        library.add(new_policy(family, task, checkpoint(policy, task), policy_id=family))
    with database.write() as connection:
        damaged = "UPDATE checkpoints SET data = :data WHERE sha256 = :sha256"
        sha256 = library.get("scarce").checkpoint_sha256
        connection.execute(text(damaged), {"data": b"not what was stored", "sha256": sha256})

    preload(database.url, problem)
    assert [record.policy_id for record in caplog.records] == ["scarce"]
    with database.write() as connection:
        connection.execute(text("UPDATE checkpoints SET data = :data"), {"data": b"gone"})
    assert solve(database.url, problem, source="uniform", **BARE).source_policy.id == "uniform"
    with pytest.raises(InvalidParameters, match="'scarce' cannot be used"):
        solve(database.url, problem, source="scarce", **BARE)
    database.dispose()


def test_policy_for_one_size_may_be_asked_for_where_it_fits(store):
    problem = generate("uniform", 3, 5, 2, np.random.default_rng(32))
    solution = solve(store, problem, source="one-size", n_epochs=3, polish_moves=2000)
    assert solution.source_policy.id == "one-size"
    assert decode(solution.checkpoint).metadata["architecture"] == "qmix-paper-1"
    assert reward_of(problem, solution.plan) >= reward_of(problem, greedy_plan(problem)) - 1e-9
    bare = solve(store, problem, source="one-size", **BARE)
    assert reward_of(problem, bare.plan) == pytest.approx(max(bare.history.reward[0], 0.0))
    assert bare.checkpoint is None
    with pytest.raises(InvalidParameters, match=r"'one-size' .*does not fit a task of 4x5x2"):
        solve(store, generate("uniform", 4, 5, 2, np.random.default_rng(33)), source="one-size")


def test_policy_for_every_size_is_no_source_of_the_paper(store):
    problem = generate("uniform", 6, 9, 2, np.random.default_rng(34))
    with pytest.raises(NoCompatibleSource, match="no source policy for 6x9x2"):
        solve(store, problem, mode="paper")
    with pytest.raises(InvalidParameters, match="'uniform' is for every size"):
        solve(store, problem, mode="paper", source="uniform")


def test_without_a_policy_for_every_size_there_is_no_source(tmp_path):
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(35))
    with pytest.raises(NoCompatibleSource, match="there is no library"):
        solve(None, problem)
    database = Database(f"sqlite:///{tmp_path / 'empty.db'}")
    PolicyLibrary(database).migrate()
    with pytest.raises(NoCompatibleSource, match="the library has no policy for every size") as caught:
        solve(database.url, problem)
    assert caught.value.details == {"sizes": []}
    database.dispose()
    with pytest.raises(InvalidParameters, match="no policy 'nobody'"):
        solve(database.url, problem, source="nobody")


def test_large_problems_are_searched_without_a_policy(store):
    problem = generate("uniform", 300, 700, 2, np.random.default_rng(36))
    solution = solve(store, problem, polish_moves=20_000)
    assert solution.source_policy is None
    assert solution.parameters.samples == 0
    assert solution.history.reward == [pytest.approx(reward_of(problem, greedy_plan(problem)))]
    assert reward_of(problem, solution.plan) > solution.history.reward[0]
    with pytest.raises(ProblemTooLarge, match="fine-tuning on 300 UAVs and 700 targets"):
        solve(store, problem, n_epochs=1)


def test_where_nothing_can_be_flown_everybody_stays_at_home(store):
    problem = generate("uniform", 2, 3, 2, np.random.default_rng(37))
    grounded = replace(problem, uavs=tuple(replace(u, ret=True) for u in problem.uavs))
    solution = solve(store, grounded, **SOME)
    assert solution.plan.assignment == ((3, 3),)
    assert solution.history.reward == [0.0]
