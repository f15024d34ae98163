"""Making the library's policy for every size from nothing; every stage goes on where it stopped.

1. Plans of generated problems are searched.
2. A policy is fitted to them.
3. It plays other problems up to some step, and the rest of each is searched: corrections.
4. The fit goes on with both; 3 and 4 are repeated.
5. The policy is measured on fresh problems of every family, and of none.
6. It is written.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
import torch
from pydantic import Field

from app.domain.errors import InvalidCheckpoint
from app.domain.problem import Problem
from app.learning.checkpoints.checkpoint import encode
from app.learning.cluster_training import connected, on_cluster
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.universal.training.corrections import correct
from app.learning.universal.training.curriculum import with_greedy_unloading
from app.learning.universal.training.demonstrations import (
    Demonstration,
    Series,
    demonstrate,
    moves_for,
    read_demonstrations,
    write_demonstrations,
)
from app.learning.universal.training.trainer import Schedule, fit, trained, updates_done
from app.simulation.arrays import compile_problem
from app.simulation.drawn_generator import drawn, drawn_size
from app.simulation.generator import FAMILIES, generate
from app.solvers.protocol import Parameters

Item = TypeVar("Item")

Tell = Callable[[str, float, str], None]
"""Takes a stage, the share of it that is done, and a word about it."""

METRIC_SHAPE = (10, 20, 3)
"""M, N and K of the fresh problems of families on which a policy is measured, and of the task it is filed
under."""

METRIC_MOVES = 400_000
"""Moves of the search whose plans the policy's are compared with."""

DRAWN = "drawn"
"""What problems of no family are called where families are listed."""

CORRECTION_MOVES = 0.6
"""Share of the moves of a full search that a correction is searched with: its beginning is known."""

_CORRECTIONS, _FRESH = 1, 1_000_003
"""Keep the streams of corrections, and of the metrics' problems, apart from that of searched plans."""

NAME = "every family and none, every size"
"""Name of the policy, for people."""


class UniversalTrainingParameters(Parameters):
    """What a training of the policy for every size is made with."""

    plans: int = Field(default=600, ge=1, description="Files of searched plans")
    rounds: int = Field(default=3, ge=0, description="How often the policy is corrected")
    corrections: int = Field(default=100, ge=1, description="Files of corrections a round")
    size: int = Field(default=100, ge=1, description="Plans a file")
    first_updates: int = Field(default=10_000, ge=1, description="Steps of the optimiser before corrections")
    round_updates: int = Field(default=9_000, ge=1, description="Steps of the optimiser after each round's")
    lr: float = Field(default=1e-2, gt=0, description="Highest learning rate")
    td_weight: float = Field(default=0.2, ge=0, description="Weight of the TD loss beside the cross-entropy")
    width: int = Field(default=64, ge=4, multiple_of=4, description="Width of a token")
    layers: int = Field(default=3, ge=1, description="Attention layers")
    qmix_hidden_dim: int = Field(default=32, ge=1, description="Hidden units of the mixing network")
    metric_problems: int = Field(default=32, ge=1, description="Fresh problems a family to measure on")
    search: float = Field(default=1.0, gt=0, le=1, description="Share of a full search's moves for each plan")
    seed: int = Field(default=123, ge=0, description="Source of all randomness")

    @property
    def config(self) -> PairwiseConfig:
        """Sizes of the networks."""
        return PairwiseConfig(self.width, self.layers, self.qmix_hidden_dim)

    @property
    def schedule(self) -> Schedule:
        """Of all fits together."""
        return Schedule(
            self.first_updates + self.rounds * self.round_updates, self.lr, self.td_weight, self.seed
        )


class _Processes(Protocol):
    """Do a job for every item, in processes here or on a cluster; an item's place and result as they end."""

    def __call__(self, job: Callable[[Item], Path], items: Sequence[Item]) -> Iterator[tuple[int, Path]]: ...


def _in_pool(
    pool: ProcessPoolExecutor, job: Callable[[Item], Path], items: Sequence[Item]
) -> Iterator[tuple[int, Path]]:
    places = {pool.submit(job, item): place for place, item in enumerate(items)}
    for future in as_completed(places):
        yield places[future], future.result()


@dataclass(frozen=True, slots=True)
class Production:
    """One making of a policy.

    Parameters
    ----------
    work
        Folder of what the stages leave behind: demonstrations, and states of the training. One for each set
        of parameters.
    parameters
        What to make.
    workers
        Processes, or threads, that work at the same time. With another number of threads sums are added up
        in another order, so the last digits of the weights are others.
    tell
        Told about progress.
    cluster
        Address of a Ray cluster that does what processes do otherwise; all its machines see the folder
        ``work``. What is fitted with all threads stays in this process, so the result is the same.
    """

    work: Path
    parameters: UniversalTrainingParameters
    workers: int
    tell: Tell
    cluster: str | None = None

    def run(self, folder: Path, name: str) -> Path:
        """Make the policy and write it as a checkpoint.

        Parameters
        ----------
        folder
            Where to; made where missing.
        name
            Stem of the file, which becomes the policy's id.
        """
        self.work.mkdir(parents=True, exist_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        p = self.parameters
        # The same processes for all stages: each loads torch and compiled code before its first job.
        with self._processes() as processes:
            plans = partial(_write_plans, self.work, p)
            files = self._all(processes, "plans", plans, range(p.plans))
            state = self._fit(0, files, None)
            for number in range(1, p.rounds + 1):
                corrections = partial(_write_corrections, self.work, p, state, number)
                files += self._all(processes, f"corrections {number}", corrections, range(p.corrections))
                state = self._fit(number, files, state)
            kinds = (*FAMILIES, DRAWN)
            fresh = self._all(processes, "fresh problems", partial(_write_fresh, self.work, p), kinds)
        return self._write(folder / f"{name}.safetensors", state, dict(zip(kinds, fresh, strict=True)))

    @contextmanager
    def _processes(self) -> Iterator[_Processes]:
        if self.cluster is not None:
            with connected(self.cluster):
                yield on_cluster
        else:
            with ProcessPoolExecutor(self.workers, multiprocessing.get_context("spawn")) as pool:
                yield partial(_in_pool, pool)

    def _fit(self, number: int, files: list[Path], before: Path | None) -> Path:
        """Do a part of the schedule in this process, with one thread less than it may; return the state."""
        p, state = self.parameters, self.work / f"fit-{number}.safetensors"
        until = p.first_updates + number * p.round_updates
        if updates_done(state) == until:
            return state
        shown = [each for file in files for each in read_demonstrations(file)]
        threads = torch.get_num_threads()
        # Another thread makes the batches.
        torch.set_num_threads(max(1, self.workers - 1))
        try:
            watch = partial(self._watch, f"fit {number}", until)
            policy = PairwisePolicy.of_seed(p.config, p.seed)
            fit(policy, shown, p.schedule, state, until=until, before=before, watch=watch)
        finally:
            torch.set_num_threads(threads)
        return state

    def _write(self, file: Path, state: Path, measured: dict[str, Path]) -> Path:
        p, policy = self.parameters, trained(state, self.parameters.config)
        metrics: dict[str, float | int] = {
            f"greedy_ratio_{kind}": round(greedy_ratio(policy, path), 4) for kind, path in measured.items()
        }
        data = encode(
            policy,
            config=policy.config,
            task=generate(next(iter(FAMILIES)), *METRIC_SHAPE, np.random.default_rng([p.seed, _FRESH])),
            algorithm="qmix",
            seed=p.seed,
            parameters=p,
            metrics=metrics,
            name=NAME,
            families=list(FAMILIES),
        )
        if data is None:
            raise InvalidCheckpoint("the training of the policy for every size has diverged")
        part = file.with_suffix(".part")
        part.write_bytes(data)
        os.replace(part, file)
        self.tell("metrics", 1.0, file.name)
        return file

    def _all(
        self, processes: _Processes, stage: str, job: Callable[[Item], Path], items: Sequence[Item]
    ) -> list[Path]:
        """Do a job for every item and tell how far that is; results in the items' order."""
        results: dict[int, Path] = {}
        for place, path in processes(job, items):
            results[place] = path
            self.tell(stage, len(results) / len(items), "")
        return [results[place] for place in range(len(items))]

    def _watch(self, stage: str, until: int, update: int, losses: dict[str, float]) -> None:
        words = ", ".join(f"{name} {loss:.4f}" for name, loss in losses.items())
        self.tell(stage, update / until, words)


def greedy_ratio(policy: PairwisePolicy, measured: Path) -> float:
    """Mean share of a searched plan's reward that one greedy roll-out earns, or staying at home: 0."""
    ratios = []
    for problem, _, reward, *_ in read_demonstrations(measured):
        played = policy.play(compile_problem(problem), np.zeros(1, np.int64))
        ratios.append(max(0.0, float(played.rewards[0])) / reward)
    return float(np.mean(ratios))


def _write_plans(work: Path, parameters: UniversalTrainingParameters, number: int) -> Path:
    p = parameters

    def make(problem: Problem, rng: np.random.Generator) -> Demonstration | None:
        return demonstrate(problem, moves_for(problem, p.search), rng)

    return Series("plans", (), p.size).write(work, p.seed, number, make)


def _write_corrections(
    work: Path, parameters: UniversalTrainingParameters, state: Path, number_of_round: int, number: int
) -> Path:
    torch.set_num_threads(1)
    p, policy = parameters, trained(state, parameters.config)

    def make(problem: Problem, rng: np.random.Generator) -> Demonstration | None:
        return correct(problem, policy, moves_for(problem, p.search * CORRECTION_MOVES), rng)

    series = Series(f"corrections-{number_of_round}", (_CORRECTIONS, number_of_round), p.size)
    return series.write(work, p.seed, number, make)


def _write_fresh(work: Path, parameters: UniversalTrainingParameters, kind: str) -> Path:
    """Search plans of the fresh problems of a family, or of none, on which the policy is measured."""
    p = parameters
    path = work / f"fresh-{kind}-{p.metric_problems}.jsonl"
    if not path.exists():
        rng = np.random.default_rng([_FRESH, *kind.encode()])
        shown: list[Demonstration] = []
        while len(shown) < p.metric_problems:
            made = demonstrate(_fresh(kind, rng), round(p.search * METRIC_MOVES), rng)
            if made is not None:
                shown.append(made)
        write_demonstrations(path, shown)
    return path


def _fresh(kind: str, rng: np.random.Generator) -> Problem:
    if kind != DRAWN:
        return generate(kind, *METRIC_SHAPE, rng)
    return with_greedy_unloading(drawn(*drawn_size(rng), rng))
