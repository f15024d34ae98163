"""Markets: bundles against a sequential auction and the optimum by brute force; messages, ranges, losses."""

from dataclasses import replace

import numpy as np
import pytest
from problems import random_problem
from referee import replay
from sequential_auction import best_reward, plan_of, sequential_auction

from app.domain.records import problem_to_record
from app.simulation.evaluation import reward_of
from app.simulation.generator import generate
from app.solvers.comparison_parameters import BundleParameters, ContractNetParameters
from app.solvers.markets.contract_net import try_exchange
from app.solvers.markets.network import network_of
from app.solvers.markets.solver import BundleSolver, ContractNetSolver, by_level
from app.solvers.protocol import SolverContext
from app.solvers.stop import never


def unshared(rng, **objective):
    """A small problem in which every UAV carries enough for all areas, so that no need is shared."""
    family = str(rng.choice(["uniform", "clustered", "deadline"]))
    problem = generate(family, int(rng.integers(2, 5)), int(rng.integers(3, 6)), 2, rng)
    uavs = tuple(replace(uav, loadlist=(1000.0, 1000.0)) for uav in problem.uavs)
    objective = replace(problem.objective, **objective)
    return replace(problem, uavs=uavs, max_steps=int(rng.integers(1, 4)), objective=objective)


def agreed(problem, kind=BundleSolver, seed=1, **parameters):
    """What UAVs agree in one market."""
    model = {BundleSolver: BundleParameters, ContractNetSolver: ContractNetParameters}[kind]
    solver = kind(model(**parameters), SolverContext())
    agreement = solver.agreement(problem, np.random.default_rng(seed))
    agreement.agree(by_level(problem), never)
    return agreement


def routes(agreement):
    market = agreement.market
    return [list(map(int, market.path[i, :length])) for i, length in enumerate(market.length)]


def test_bundles_are_what_a_sequential_auction_awards():
    rng = np.random.default_rng(27)
    for _ in range(200):
        problem = unshared(rng)
        _, expected = sequential_auction(problem)
        found = agreed(problem)
        assert routes(found) == expected
        assert reward_of(problem, found.plan()) == pytest.approx(
            reward_of(problem, plan_of(problem, expected))
        )
        assert found.method.conflicts == 0


def test_a_chain_of_neighbours_agrees_on_the_same_as_all_together():
    rng = np.random.default_rng(28)
    for _ in range(40):
        problem = unshared(rng)
        chain = agreed(problem)
        m = problem.n_uavs
        apart = np.abs(np.subtract.outer(np.arange(m), np.arange(m)))
        solver = BundleSolver(BundleParameters(), SolverContext())
        chained = solver.agreement(problem, np.random.default_rng(1))
        chained.network.hears[:] = apart == 1
        chained.agree(by_level(problem), never)
        assert routes(chained) == routes(chain)
        assert chained.method.rounds >= chain.method.rounds


def test_with_discounted_rewards_bundles_earn_at_least_half_of_the_optimum():
    """Where what an area earns falls with time and nothing else counts, marginal gains diminish."""
    rng = np.random.default_rng(29)
    least = 1.0
    for _ in range(200):
        problem = unshared(
            rng, distance_weight=0.0, return_to_base=False, half_life=float(rng.uniform(0.2, 20))
        )
        problem = replace(
            problem,
            uavs=tuple(replace(uav, voyage=1e6) for uav in problem.uavs),
            targets=tuple(replace(target, deadline=None) for target in problem.targets),
        )
        best = best_reward(problem)
        least = min(least, reward_of(problem, agreed(problem).plan()) / best)
    assert 0.5 <= least <= 1.0 + 1e-9


@pytest.mark.parametrize("kind", [BundleSolver, ContractNetSolver])
def test_an_area_whose_need_is_shared_is_bid_for_again(kind):
    """One area needs what three UAVs carry together."""
    problem = generate("uniform", 3, 1, 1, np.random.default_rng(3))
    uavs = tuple(replace(uav, loadlist=(2.0,), voyage=100.0) for uav in problem.uavs)
    target = replace(problem.targets[0], loadlist=(6.0,), level=10.0)
    problem = replace(problem, uavs=uavs, targets=(target,), max_steps=1)
    found = agreed(problem, kind)
    assert routes(found) == [[0], [0], [0]]
    assert found.market.left.sum() == 0


@pytest.mark.parametrize("kind", [BundleSolver, ContractNetSolver])
def test_what_routes_deliver_and_what_is_left_is_what_was_needed(kind):
    """Also after exchanges that did not come about, and after contracts were cancelled."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        problem = random_problem(rng)
        found = agreed(problem, kind)
        found.cancel(0.4, rng)
        found.agree(rng.permutation(problem.n_targets), never)
        market = found.market
        needed = market.arrays.need[0].copy()
        for i, length in enumerate(market.settled_length):
            for place in range(length):
                if market.settled[i, place] < problem.n_targets:
                    needed[market.settled[i, place]] -= market.delivered[i, place]
        np.testing.assert_allclose(market.left, needed, atol=1e-9)


def test_an_exchange_that_gains_nothing_leaves_everything_as_it_was():
    rng = np.random.default_rng(5)
    refused = 0
    for _ in range(30):
        found = agreed(generate("uniform", 4, 6, 2, rng), ContractNetSolver)
        market = found.market
        before = [np.array(column) for column in (market.path, market.length, market.worth, market.left)]
        for i in range(4):
            for number in np.unique(market.contract[i, : market.length[i]]):
                for other in set(range(4)) - {i}:
                    refused += not try_exchange(market, i, int(number), other, 0, 1_000_000)
        for was, column in zip(before, (market.path, market.length, market.worth, market.left), strict=True):
            np.testing.assert_allclose(column, was, atol=1e-9)
    assert refused > 100


def test_who_hears_whom_follows_from_where_uavs_are():
    problem = generate("uniform", 3, 2, 1, np.random.default_rng(6))
    places = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.4))
    uavs = tuple(
        replace(uav, x_s=x, y_s=y, x_c=x, y_c=y) for uav, (x, y) in zip(problem.uavs, places, strict=True)
    )
    problem = replace(problem, uavs=uavs)

    def links(reach):
        network = network_of(problem, reach, 0.0, 0, np.random.default_rng(0))
        return {tuple(map(int, link)) for link in np.argwhere(network.hears)}

    assert links(0.25) == set()
    assert links(0.35) == {(0, 1), (1, 0)}
    assert links(0.45) == {(0, 1), (1, 0), (1, 2), (2, 1)}
    assert links(None) == links(0.5) == {(i, k) for i in range(3) for k in range(3) if i != k}


def test_messages_of_bundles_are_rounds_times_links():
    problem = generate("uniform", 3, 4, 2, np.random.default_rng(7))
    m = problem.n_uavs
    found = agreed(problem)
    assert found.network.sent == found.method.rounds * m * (m - 1) > 0
    alone = agreed(problem, communication_range=0.0)
    assert alone.network.sent == 0


def test_messages_of_the_contract_net_by_hand():
    """Two UAVs, one area, an exchange that nobody gains by: announced, bid for, awarded, offered once."""
    problem = generate("uniform", 2, 1, 1, np.random.default_rng(8))
    near, far = problem.uavs
    area = replace(problem.targets[0], x=0.5, y=0.5, level=10.0, loadlist=(1.0,))
    near = replace(near, x_s=0.4, y_s=0.5, x_c=0.4, y_c=0.5, loadlist=(5.0,), voyage=100.0)
    far = replace(far, x_s=0.0, y_s=0.5, x_c=0.0, y_c=0.5, loadlist=(5.0,), voyage=100.0)
    problem = replace(problem, uavs=(near, far), targets=(area,))
    found = agreed(problem, ContractNetSolver)
    assert routes(found) == [[0], []]
    # The announcement, the other's bid; the nearest is the manager and awards itself. Nothing is left, so the
    # second announcement gets no bid. Then the contract is offered, and the other's answer is no.
    assert found.network.sent == 2 + 1 + 2


def test_without_messages_uavs_fly_to_the_same_areas():
    rng = np.random.default_rng(9)
    conflicts, lost = 0, 0
    for _ in range(30):
        problem = unshared(rng)
        together, alone = agreed(problem), agreed(problem, communication_range=0.0)
        conflicts += alone.method.conflicts
        lost += reward_of(problem, alone.plan()) < reward_of(problem, together.plan()) - 1e-9
        assert together.method.conflicts == 0
    assert conflicts > 20
    assert lost > 5


@pytest.mark.parametrize("kind", [BundleSolver, ContractNetSolver])
@pytest.mark.parametrize("trouble", [{"message_loss": 0.4}, {"message_delay": 3}])
def test_with_lost_and_late_messages_plans_are_legal_and_mostly_as_good(kind, trouble):
    rng = np.random.default_rng(10)
    shares = []
    for _ in range(20):
        problem = random_problem(rng)
        troubled = agreed(problem, kind, **trouble).plan()
        earned = replay(problem_to_record(problem), troubled.assignment)["reward"]
        calm = reward_of(problem, agreed(problem, kind).plan())
        assert earned == pytest.approx(reward_of(problem, troubled))
        if calm > 1e-6:
            shares.append(earned / calm)
    assert len(shares) > 10
    assert np.mean(shares) > 0.8


def test_late_messages_change_the_rounds_and_not_the_agreement():
    rng = np.random.default_rng(11)
    for _ in range(20):
        problem = unshared(rng)
        soon, late = agreed(problem), agreed(problem, message_delay=2)
        assert routes(late) == routes(soon)
        assert late.method.rounds > soon.method.rounds
