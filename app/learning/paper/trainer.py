"""The loop of Algorithm 1: play, store, update, evaluate; the best plan ever seen is kept."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.learning.paper.episode import Actor, EpisodeRecord
from app.learning.paper.exploration import EpsilonSchedule
from app.learning.paper.learner import Learner
from app.learning.paper.random_streams import RandomStreams
from app.learning.paper.replay_buffer import ReplayBuffer
from app.learning.parameters import LearningParameters
from app.simulation.evaluation import reward_of
from app.solvers.protocol import History, Progress, Report, StopCriterion
from app.solvers.stop import never


@dataclass
class Incumbent:
    """The best plan so far, by its true reward."""

    plan: Plan
    reward: float

    @classmethod
    def empty(cls, problem: Problem) -> Incumbent:
        """Begin with the plan that sends everybody home: what is returned is never worse."""
        plan = Plan.empty(problem.n_uavs, problem.n_targets)
        return cls(plan, reward_of(problem, plan))


@dataclass
class Training:
    """What a run of the trainer left behind, beside the network.

    Attributes
    ----------
    incumbent
        The best plan of all evaluations and all episodes of exploration.
    history
        Reward of the greedy evaluations.
    epochs
        Epochs begun and ended.
    steps
        Environment steps of exploration.
    """

    incumbent: Incumbent
    history: History = field(default_factory=History)
    epochs: int = 0
    steps: int = 0


class Trainer:
    """Algorithm 1, one episode and at most one update an epoch.

    Parameters
    ----------
    explorer, evaluator
        Actors of the learner's network, each with an environment of its own, so that evaluating changes
        nothing for the exploration.
    learner
        Updates the network.
    buffer
        Stores the explorer's episodes.
    parameters
        The schedule.
    streams
        Random numbers; the evaluations draw none.
    """

    def __init__(
        self,
        *,
        explorer: Actor,
        evaluator: Actor,
        learner: Learner,
        buffer: ReplayBuffer,
        parameters: LearningParameters,
        streams: RandomStreams,
    ) -> None:
        self._explorer = explorer
        self._evaluator = evaluator
        self._learner = learner
        self._buffer = buffer
        self._parameters = parameters
        self._streams = streams
        self._schedule = EpsilonSchedule(
            parameters.epsilon_start, parameters.epsilon_end, parameters.epsilon_anneal_steps
        )

    def run(self, incumbent: Incumbent, stop: StopCriterion, report: Report) -> Training:
        """Train until the epochs are used up or `stop` says so.

        The network is evaluated before the first epoch, which is epoch 0 of the history, also when `stop`
        is true from the beginning; then every `evaluate_per_epoch` epochs and after the last.

        Parameters
        ----------
        incumbent
            A plan to begin with; replaced in the result by any better one.
        stop
            Asked before every epoch, every step of an episode and every part of a large update. An epoch that
            it ends early is not counted; a plan that was completed in it is.
        report
            Told after every epoch.
        """
        parameters = self._parameters
        training = Training(incumbent)
        first = self._evaluate(training, never)
        if first is None or first.length == 0:
            return training  # Nothing can be flown, so there is nothing to learn.
        while training.epochs < parameters.n_epochs and not stop():
            if not self._play_and_learn(training, training.epochs + 1, stop):
                break
            training.epochs += 1
            if training.epochs % parameters.evaluate_per_epoch == 0 or training.epochs == parameters.n_epochs:
                self._evaluate(training, stop)
            best = training.incumbent
            report(Progress(training.epochs / parameters.n_epochs, training.epochs, best.reward, best.plan))
        return training

    def _play_and_learn(self, training: Training, epoch: int, stop: StopCriterion) -> bool:
        """Do an epoch; False if it was stopped."""
        record = self._explorer.play(self._schedule, training.steps, self._streams.exploration, stop)
        if record is None:
            return False
        training.steps += record.length
        self._consider(record, training)
        self._buffer.add(record)
        learner, period = self._learner, self._parameters.update_target_params
        if len(self._buffer) >= self._parameters.first_update:
            if stop():
                return False
            batch = self._buffer.sample(self._parameters.batch_size, self._streams.replay)
            if not learner.update(batch, stop):
                return False
        if epoch % period == 0:
            learner.update_target()
        return True

    def _evaluate(self, training: Training, stop: StopCriterion) -> EpisodeRecord | None:
        """Play greedily and note what that earns; None if it was stopped, and nothing is noted."""
        record = self._evaluator.play_greedily(stop)
        if record is None:
            return None
        self._consider(record, training)
        training.history.add(training.epochs, record.reward if record.length else training.incumbent.reward)
        return record

    def _consider(self, record: EpisodeRecord, training: Training) -> None:
        if record.length and record.reward > training.incumbent.reward:
            plan = self._evaluator.environment.plan(record.actions[: record.length])
            training.incumbent = Incumbent(plan, record.reward)
