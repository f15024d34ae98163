import math

import numpy as np
import pytest
import torch
from stopping import When, at_once

from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.learning.checkpoints.checkpoint_time import CheckpointReserve
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import Actor
from app.learning.paper.learner import Learner
from app.learning.paper.random_streams import random_streams
from app.learning.paper.replay_buffer import ReplayBuffer
from app.learning.paper.trainer import Incumbent, Trainer
from app.learning.parameters import TableParameters, TransferQmixParameters
from app.simulation.evaluation import reward_of
from app.solvers.stop import never


class Recorder:
    """A learner that notes when it is told to do what."""

    def __init__(self, learner, calls):
        self._learner, self._calls = learner, calls

    @property
    def updates(self):
        return self._learner.updates

    def update(self, batch, stop):
        self._calls.append(("update", batch.rewards.shape[1]))
        return self._learner.update(batch, stop)

    def update_target(self):
        self._calls.append(("target", self.updates))
        self._learner.update_target()


def train(problem, network, parameters, *, calls=None, seed=1, stop=never, report=None):
    streams = random_streams(seed)
    environment = SwarmEnvironment(problem)
    learner = Learner(network, parameters.lr, parameters.gamma, parameters.grad_norm_clip)
    trainer = Trainer(
        explorer=Actor(environment, network),
        evaluator=Actor(SwarmEnvironment(problem), network),
        learner=learner if calls is None else Recorder(learner, calls),
        buffer=ReplayBuffer(parameters.buffer_size, environment.sizes, problem.max_steps),
        parameters=parameters,
        streams=streams,
    )
    return trainer.run(Incumbent.empty(problem), stop, report or (lambda progress: None)), streams


def weights(network):
    return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])


def test_evaluating_changes_nothing_for_the_training(problem, make_network):
    """Trap: statistics, random numbers or episodes that evaluation shares with training."""
    sizes = SwarmEnvironment(problem).sizes
    outcomes = []
    for evaluate_per_epoch in (1, 1000):
        network = make_network(sizes)
        parameters = TableParameters(
            n_epochs=60, learning_starts=10, evaluate_per_epoch=evaluate_per_epoch, epsilon_anneal_steps=200
        )
        _, streams = train(problem, network, parameters)
        outcomes.append((weights(network), streams.exploration.random(), streams.replay.random()))
    assert torch.equal(outcomes[0][0], outcomes[1][0])
    assert outcomes[0][1:] == outcomes[1][1:]


def test_updates_begin_with_a_full_buffer_and_come_once_an_epoch(problem, network):
    calls = []
    train(problem, network, TableParameters(n_epochs=25, buffer_size=20, batch_size=8), calls=calls)
    assert calls == [("update", 8)] * 6


def test_updates_can_begin_earlier(problem, network):
    calls = []
    train(problem, network, TableParameters(n_epochs=7, learning_starts=3, batch_size=4), calls=calls)
    assert calls == [("update", 3)] + [("update", 4)] * 4


def test_target_network_is_copied_every_so_many_epochs(problem, network):
    calls = []
    parameters = TableParameters(n_epochs=9, learning_starts=3, update_target_params=4)
    train(problem, network, parameters, calls=calls)
    assert [call for call in calls if call[0] == "target"] == [("target", 2), ("target", 6)]


def test_warm_start_explores_as_a_trained_policy_does(problem, network):
    """Trap: epsilon restarted at 1 destroys what was transferred."""
    parameters = TransferQmixParameters(mode="paper").table()
    assert parameters.epsilon_start == parameters.epsilon_end == 0.05
    epsilons = []
    environment = SwarmEnvironment(problem)
    step = environment.step

    def noting(values, draws, epsilon, actions):
        epsilons.append(epsilon)
        return step(values, draws, epsilon, actions)

    environment.step = noting
    trainer = Trainer(
        explorer=Actor(environment, network),
        evaluator=Actor(SwarmEnvironment(problem), network),
        learner=Learner(network, 5e-4, 0.99, 10.0),
        buffer=ReplayBuffer(100, environment.sizes, problem.max_steps),
        parameters=TransferQmixParameters(mode="paper", n_epochs=20).table(),
        streams=random_streams(0),
    )
    trainer.run(Incumbent.empty(problem), never, lambda progress: None)
    assert set(epsilons) == {0.05}


def test_exploration_is_annealed_over_environment_steps(problem, network):
    epsilons = []
    environment = SwarmEnvironment(problem)
    step = environment.step

    def noting(values, draws, epsilon, actions):
        epsilons.append(epsilon)
        return step(values, draws, epsilon, actions)

    environment.step = noting
    trainer = Trainer(
        explorer=Actor(environment, network),
        evaluator=Actor(SwarmEnvironment(problem), network),
        learner=Learner(network, 5e-4, 0.99, 10.0),
        buffer=ReplayBuffer(100, environment.sizes, problem.max_steps),
        parameters=TableParameters(n_epochs=60, epsilon_anneal_steps=100),
        streams=random_streams(0),
    )
    training = trainer.run(Incumbent.empty(problem), never, lambda progress: None)
    assert len(epsilons) == training.steps > 120
    expected = [1 - 0.95 * min(1, step / 100) for step in range(training.steps)]
    assert epsilons == pytest.approx(expected)


def test_history_has_the_evaluations_and_the_last_epoch(problem, network):
    training, _ = train(problem, network, TableParameters(n_epochs=25, evaluate_per_epoch=10))
    assert training.history.epoch == [0, 10, 20, 25]
    assert training.epochs == 25


def test_incumbent_is_the_best_of_all_evaluations_and_explorations(problem, network):
    """Its reward is the plan's, and progress never tells of a worse one."""
    told = []
    parameters = TableParameters(n_epochs=80, evaluate_per_epoch=5, learning_starts=20)
    training, _ = train(problem, network, parameters, report=told.append)
    best = training.incumbent
    assert reward_of(problem, best.plan) == pytest.approx(best.reward, abs=1e-9)
    assert best.reward >= max(training.history.reward)
    rewards = [progress.best_reward for progress in told]
    assert rewards == sorted(rewards)
    assert [progress.epoch for progress in told] == list(range(1, 81))
    assert told[-1].fraction == 1.0
    for progress in told:
        assert reward_of(problem, progress.incumbent) == pytest.approx(progress.best_reward, abs=1e-9)


def test_best_plan_may_come_from_exploration(problem, network):
    training, _ = train(problem, network, TableParameters(n_epochs=90, evaluate_per_epoch=1000))
    assert training.incumbent.reward > max(0.0, *training.history.reward)


def test_stopping_at_once_evaluates_and_returns_a_legal_plan(problem, network):
    training, _ = train(problem, network, TableParameters(), stop=at_once())
    assert training.epochs == 0
    assert training.history.epoch == [0]
    assert reward_of(problem, training.incumbent.plan) == pytest.approx(training.incumbent.reward)


def test_stop_is_asked_before_every_epoch(problem, network):
    told = []
    training, _ = train(
        problem, network, TableParameters(), stop=When(lambda: len(told) == 7), report=told.append
    )
    assert training.epochs == 7


def test_nothing_to_fly_is_nothing_to_learn(make_network):
    """Every visit is out of range, and the leg home is charged: sending the UAV home earns less than 0."""
    problem = Problem(
        (UAV("u", 0, 0, 3, 4, 1, 1, (5.0,)),),
        (Target("t", 100, 0, 1, (5.0,)),),
        objective=Objective(1.0, charge_return=True),
    )
    network = make_network(SwarmEnvironment(problem).sizes)
    training, _ = train(problem, network, TableParameters())
    assert training.incumbent.plan == Plan.empty(1, 1)
    assert training.incumbent.reward == pytest.approx(-5)
    assert training.history.reward == pytest.approx([-5])
    assert training.epochs == 0


def test_result_is_never_worse_than_sending_everybody_home(make_network):
    """Visits cost more than they earn, and a UAV flown away would pay for its way back."""
    problem = Problem(
        (UAV("u", 0, 0, 0, 0, 1, 100, (5.0,)), UAV("v", 0, 0, 1, 0, 1, 100, (5.0,))),
        (Target("t", 10, 0, 1, (9.0,)),),
        objective=Objective(1.0, charge_return=True),
    )
    network = make_network(SwarmEnvironment(problem).sizes)
    training, _ = train(problem, network, TableParameters(n_epochs=30, learning_starts=5))
    assert training.incumbent.reward >= -1.0
    assert reward_of(problem, training.incumbent.plan) == pytest.approx(training.incumbent.reward)


def test_streams_of_a_seed_are_independent_and_repeatable():
    first, again, other = random_streams(5), random_streams(5), random_streams(6)
    draws = [
        (s.initialisation.initial_seed(), s.exploration.random(), s.replay.random())
        for s in (first, again, other)
    ]
    assert draws[0] == draws[1]
    assert len({*draws[0], *draws[2]}) == 6
    state = np.random.get_state()[1].copy()
    random_streams(9)
    assert np.array_equal(np.random.get_state()[1], state)


def test_stop_is_asked_within_an_epoch(problem, network):
    """The third question comes in the midst of the first episode: before its third step."""
    asked = []

    def stop():
        asked.append(len(asked))
        return len(asked) == 3

    training, _ = train(problem, network, TableParameters(), stop=When(stop))
    assert len(asked) == 3
    assert (training.epochs, training.steps) == (0, 0)
    assert reward_of(problem, training.incumbent.plan) == pytest.approx(training.incumbent.reward)


class OneQuestion:
    """A criterion with so many seconds left."""

    def __init__(self, left):
        self.left = left

    def __call__(self):
        return self.left <= 0

    def seconds_left(self):
        return self.left


def test_time_is_left_for_the_checkpoint_where_it_is_worth_it(network):
    ample = CheckpointReserve(OneQuestion(10.0), network)
    needed = 10.0 - ample.seconds_left()
    # 1 to 100 MB a second.
    assert 1e-8 < needed / sum(4 * parameter.numel() for parameter in network.parameters()) < 1e-6
    assert (ample(), ample.checkpoint) == (False, True)
    short, none = (CheckpointReserve(OneQuestion(s), network) for s in (2 * needed, math.inf))
    assert (short.checkpoint, short.seconds_left()) == (False, 2 * needed)
    assert (none.checkpoint, none.seconds_left(), none()) == (True, math.inf, False)
