"""Transfer-QMIX in service mode: a policy for every size, rolled out, sampled, fine-tuned and polished.

Each part only ever adds plans; the best by its true reward is kept. The features of the policy do not change
when a map is rotated or mirrored, so trying a problem in its eight positions would give eight times the same;
the order in which UAVs act does change what it does, so that is what is tried.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from app.domain.problem import Problem
from app.learning.checkpoints.checkpoint import encode, has_finite_weights
from app.learning.checkpoints.source_policies import Source
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.parameters import FINE_TUNING_LR, REPLANS_A_SAMPLE, TransferQmixParameters
from app.learning.universal.episodes.best_plan import BestPlan
from app.learning.universal.episodes.effort import Effort, batch_of, effort
from app.learning.universal.episodes.played import AnySizePolicy
from app.learning.universal.episodes.temperature import Temperature
from app.learning.universal.episodes.variety import roll_outs, samples
from app.learning.universal.network.parallel import in_parallel
from app.learning.universal.request.fine_tuning import FineTuning, require_memory
from app.learning.universal.request.polishing import polish
from app.learning.universal.request.recombination import Recombination
from app.learning.universal.request.replanning import replan, round_of
from app.simulation.arrays import Integers, ProblemArrays, compile_problem
from app.simulation.simulator import new_episodes
from app.simulation.stacks import without_reloads
from app.solvers.greedy import greedy_plan
from app.solvers.protocol import History, Progress, Report, Solution, StopCriterion, no_spare_threads
from app.solvers.seeds import seed_sequence

_TRIED_AT_SIGHT = 2
"""Policies of the shortlist that are tried where a greedy roll-out is all that is asked for."""

_SHARES = {"roll-out": 0.05, "samples": 0.25, "replans": 0.35, "fine-tuning": 0.55, "polish": 1.0}
"""Share of the work that is done at the end of each part."""


@dataclass(frozen=True, slots=True)
class Used:
    """The parameters with all defaults filled in."""

    parameters: TransferQmixParameters
    orders: int
    samples: int
    replans: int
    n_epochs: int
    polish_moves: int
    recombine: bool

    @property
    def is_bare(self) -> bool:
        """Whether the policy's greedy roll-out is all that is asked for."""
        return not (self.samples or self.replans or self.n_epochs or self.polish_moves)


class UniversalTransfer:
    """Solves one problem.

    Parameters
    ----------
    problem, seed, stop, report
        As :class:`~app.solvers.protocol.Solver` has them.
    parameters
        Of service mode.
    spare
        How many threads more its roll-outs may use at this moment; they are the same with any number.
    """

    def __init__(
        self,
        problem: Problem,
        parameters: TransferQmixParameters,
        seed: int,
        stop: StopCriterion,
        report: Report,
        spare: Callable[[], int] = no_spare_threads,
    ) -> None:
        self._spare = spare
        self._problem, self._seed, self._stop, self._report = problem, seed, stop, report
        self._arrays = compile_problem(problem)
        self._effort = effort(self._arrays)
        self._used = fill_in(parameters, self._effort)
        self._asked_once = parameters.orders == 1
        self._best = BestPlan(self._arrays)
        self._recombination = Recombination(self._arrays, self._best)
        self._history = History()
        root = seed_sequence(seed)
        streams = map(np.random.default_rng, root.spawn(5))
        self._sampling, self._tuning, self._polishing, self._ordering, self._replanning = streams

    def run(self, sources: Sequence[Source]) -> Solution:
        """Solve it from the best of some policies for every size, nearest first.

        Raises
        ------
        ProblemTooLarge
            If fine-tuning is asked for and would not fit into memory.
        """
        used, checkpoint = self._used, None
        if used.n_epochs:
            require_memory(self._arrays)
        if new_episodes(self._arrays, 1).done[0]:
            # Nobody can fly anywhere: every policy would stay at home.
            self._history.add(0, self._best.reward)
            return Solution(self._best.plan, self._history, used.parameters, sources[0].policy)
        if used.recombine or not used.is_bare:
            self._best.consider(greedy_plan(self._problem, self._stop).as_array()[None])
            self._consider(self._best.actions[None])
        source = None
        policy_plays = self._effort.policy or used.is_bare or used.parameters.source is not None
        if policy_plays:
            source, reward = self._roll_out(sources)
            self._history.add(0, reward)
            self._tell("roll-out", 1.0)
            policy = cast(AnySizePolicy, source.network)
            self._sample(policy)
            self._replan(policy)
            checkpoint = self._fine_tune(policy)
        else:
            self._history.add(0, self._best.reward)
        polish(
            self._arrays,
            self._best,
            used.polish_moves,
            self._polishing,
            self._stop,
            lambda share: self._tell("polish", share),
        )
        found = None if source is None else source.policy
        return Solution(self._best.plan, self._history, used.parameters, found, checkpoint)

    def _played(self, policy: AnySizePolicy) -> ProblemArrays:
        """Return the problem as a policy plays it: where it knows no reloads, up to the first of them."""
        return self._arrays if policy.knows_reloads else without_reloads(self._arrays)

    def _consider(self, plans: Integers) -> None:
        """Look at plans, and at what can be put together of their routes."""
        if not self._used.recombine:
            self._best.consider(plans)
        else:
            self._recombination.consider(plans, self._stop)

    def _roll_out(self, sources: Sequence[Source]) -> tuple[Source, float]:
        """Play each policy greedily; return the best, among equals the nearest, and what it earned."""
        found: list[tuple[Source, float]] = []
        tried, count = sources[: self._effort.policies], self._used.orders
        if self._used.is_bare:
            # As many roll-outs as of one policy in all orders, which earn no more.
            tried = tried[: 1 if self._asked_once else _TRIED_AT_SIGHT]
            count = -(-count // len(tried))
        seeds = self._ordering.integers(2**63, size=len(tried))

        def play_from(place: int) -> Integers:
            policy = cast(AnySizePolicy, tried[place].network)
            rng = np.random.default_rng(seeds[place])
            return roll_outs(policy, self._played(policy), count, rng, self._stop, within)

        # Where policies are played side by side, there is no core left for the turns of one of them.
        spare = self._spare()
        within = self._spare if len(tried) == 1 else no_spare_threads
        for source, plans in zip(tried, in_parallel(play_from, range(len(tried)), spare), strict=False):
            found.append((source, self._best.consider(plans)))
            self._consider(plans)
            if self._stop():
                break
        return max(found, key=lambda each: each[1])

    def _sample(self, policy: AnySizePolicy) -> None:
        done, wanted = 0, self._used.samples
        while done < wanted and not self._stop():
            count = batch_of(self._arrays, wanted - done)
            plans = samples(
                policy,
                self._played(policy),
                count,
                self._used.orders,
                self._sampling,
                self._stop,
                self._spare,
            )
            self._consider(plans)
            done += count
            self._tell("samples", done / wanted)

    def _replan(self, policy: AnySizePolicy) -> None:
        # A group's problem has the reloads of the whole one.
        able = policy.knows_reloads or not self._problem.bases
        done, replans = 0, self._used.replans if able else 0
        while done < replans and not self._stop():
            plans = replan(
                policy,
                self._arrays,
                self._best.actions,
                min(round_of(replans), replans - done),
                self._replanning,
                self._stop,
                self._spare,
            )
            if not len(plans):
                return
            self._consider(plans)
            done += round_of(replans)
            self._tell("replans", min(1.0, done / replans))

    def _fine_tune(self, policy: AnySizePolicy) -> bytes | None:
        """Fine-tune a copy; its checkpoint, or None where no epoch was done."""
        used, best = self._used, self._best
        if not used.n_epochs or self._stop() or not isinstance(policy, PairwisePolicy):
            # Policies of the architecture before are played, and not trained any more.
            return None
        parameters = used.parameters
        tuning = FineTuning(
            policy,
            self._arrays,
            batch_size=parameters.batch_size,
            lr=FINE_TUNING_LR,
            gamma=parameters.gamma,
            rng=self._tuning,
            spare=self._spare,
        )
        done, temperature = 0, Temperature(self._arrays)
        while done < used.n_epochs and not self._stop():
            plans = tuning.epoch(best.actions, self._stop, temperature=temperature.value)
            if not has_finite_weights(tuning.policy):
                # It would play at random and could not be kept; the plans so far are as good as ever.
                break
            temperature.follow(plans, best.reward)
            self._consider(plans)
            done += 1
            if done % parameters.evaluate_per_epoch == 0 or done == used.n_epochs:
                played = tuning.policy.play(self._arrays, np.zeros(1, np.int64), stop=self._stop)
                best.consider(played.plans)
                if not self._stop():
                    self._history.add(done, float(played.rewards[0]))
            self._tell("fine-tuning", done / used.n_epochs, done)
        return encode(
            tuning.policy,
            config=policy.config,
            task=self._problem,
            algorithm="transfer_qmix",
            seed=self._seed,
            parameters=parameters,
            metrics={"reward": best.reward, "greedy_reward": self._history.reward[-1], "epochs": done},
        )

    def _tell(self, part: str, share: float, epoch: int | None = None) -> None:
        begin = max((done for done in _SHARES.values() if done < _SHARES[part]), default=0.0)
        fraction = begin + share * (_SHARES[part] - begin)
        epoch = self._history.epoch[-1] if epoch is None else epoch
        self._report(Progress(fraction, epoch, self._best.reward, self._best.plan))


def fill_in(parameters: TransferQmixParameters, default: Effort) -> Used:
    """Fill in what a request leaves open, and what service mode has whatever is asked for."""
    orders = default.orders if parameters.orders is None else parameters.orders
    samples = default.samples if parameters.samples is None else parameters.samples
    n_epochs = default.n_epochs if parameters.n_epochs is None else parameters.n_epochs
    polished = parameters.polish is not False
    moves = default.polish_moves if parameters.polish_moves is None else parameters.polish_moves
    moves = moves if polished else 0
    # A local search finds what they would, in less time.
    replans = 0 if moves else REPLANS_A_SAMPLE * samples
    replans = replans if parameters.replans is None else parameters.replans
    single = orders == 1 and not (samples or replans or n_epochs)
    recombine = not single if parameters.recombine is None else parameters.recombine
    filled = parameters.in_service().model_copy(
        update={
            "orders": orders,
            "samples": samples,
            "replans": replans,
            "n_epochs": n_epochs,
            "polish": polished,
            "polish_moves": moves,
            "recombine": recombine,
        }
    )
    return Used(filled, orders, samples, replans, n_epochs, moves, recombine)
