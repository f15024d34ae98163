"""Making the library's policies for every size from nothing; every stage goes on where it stopped.

1. Near-optimal plans of generated problems are searched.
2. A policy is fitted to them: the general policy.
3. For each family plans of new problems are searched, beginning from what that policy does, and a copy of it
   is fitted to those alone: a specialised policy.
4. Each is measured on fresh problems of every family and written.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
import torch
from pydantic import Field

from app.domain.errors import InvalidCheckpoint
from app.learning.checkpoints.checkpoint import encode
from app.learning.cluster_training import connected, on_cluster
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.episodes.rollout import play
from app.learning.universal.network.architecture import UniversalConfig
from app.learning.universal.training.curriculum import Shard
from app.learning.universal.training.demonstrations import (
    Series,
    demonstrate,
    read_shard,
    save_shard,
    write_shard,
)
from app.learning.universal.training.trainer import Schedule, Watch, fit, unwatched
from app.simulation.generator import FAMILIES, generate
from app.solvers.protocol import Parameters

Item = TypeVar("Item")

Tell = Callable[[str, float, str], None]
"""Takes a stage, the share of it that is done, and a word about it."""

METRIC_SHAPE = (10, 20, 3)
"""M, N and K of the fresh problems on which a policy is measured, and of the task it is filed under."""

METRIC_MOVES = 400_000
"""Moves of the search whose plans the policy's are compared with."""

_FRESH = 1_000_003
"""Keeps the streams of the metrics' problems apart from those of the demonstrations."""

SEARCHED = Series("demonstrations")

GENERAL = "every family, every size"
"""Name of the general policy."""


class UniversalTrainingParameters(Parameters):
    """What a training of policies for every size is made with."""

    shards: int = Field(default=260, ge=1, description="Files of searched plans, up to 64 problems each")
    updates: int = Field(default=2800, ge=1, description="Steps of the optimiser on them")
    lr: float = Field(default=1e-2, gt=0, description="Highest learning rate on them")
    family_shards: int = Field(default=4, ge=1, description="Files of plans of one family")
    family_updates: int = Field(default=150, ge=1, description="Steps of the optimiser on a family")
    family_lr: float = Field(default=1e-3, gt=0, description="Highest learning rate on a family")
    td_weight: float = Field(default=0.2, ge=0, description="Weight of the TD loss beside the cross-entropy")
    width: int = Field(default=64, ge=4, multiple_of=4, description="Width of a token")
    layers: int = Field(default=2, ge=1, description="Attention layers")
    qmix_hidden_dim: int = Field(default=32, ge=1, description="Hidden units of the mixing network")
    metric_problems: int = Field(default=32, ge=1, description="Fresh problems a family to measure on")
    search: float = Field(default=1.0, gt=0, le=1, description="Share of a full search's moves for each plan")
    seed: int = Field(default=123, ge=0, description="Source of all randomness")

    @property
    def config(self) -> UniversalConfig:
        """Sizes of the networks."""
        return UniversalConfig(self.width, self.layers, self.qmix_hidden_dim)


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
    """One making of policies.

    Parameters
    ----------
    work
        Folder of what the stages leave behind: demonstrations, and states of trainings. One for each set of
        parameters.
    parameters
        What to make.
    workers
        Processes, or threads, that work at the same time.
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

    def run(self, folder: Path, name: str) -> list[Path]:
        """Make the policies and write them as checkpoints, the general one first.

        Parameters
        ----------
        folder
            Where to; made where missing.
        name
            Stem of the general policy's file, which becomes its id; a family's has the family behind it.
        """
        self.work.mkdir(parents=True, exist_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        p = self.parameters
        # The same processes for all stages: each loads torch and compiled code before its first job.
        with self._processes() as processes:
            searched = self._shards(processes, replace(SEARCHED, search=p.search), p.shards)
            general = self._fit("general", searched, Schedule(p.updates, p.lr, p.td_weight, p.seed))
            specialised = self._specialise(processes, general)
            measured = self._measured(processes)
        files = [self._write(folder / f"{name}.safetensors", general, GENERAL, tuple(FAMILIES), measured)]
        for family, state in specialised.items():
            file = folder / f"{name}-{family.replace('_', '-')}.safetensors"
            files.append(self._write(file, state, f"{family}, every size", (family,), measured))
        return files

    @contextmanager
    def _processes(self) -> Iterator[_Processes]:
        if self.cluster is not None:
            with connected(self.cluster):
                yield on_cluster
        else:
            with ProcessPoolExecutor(self.workers, multiprocessing.get_context("spawn")) as pool:
                yield partial(_in_pool, pool)

    def _shards(self, processes: _Processes, series: Series, count: int) -> list[Path]:
        job = partial(write_shard, self.work, series, self.parameters.seed)
        return self._all(processes, series.name, job, range(count))

    def _fit(self, stage: str, shards: list[Path], schedule: Schedule) -> Path:
        """Fit in this process, with all threads; return the state."""
        state = self.work / f"{stage}.safetensors"
        before = torch.get_num_threads()
        torch.set_num_threads(self.workers)
        try:
            watch = partial(self._watch, stage, schedule)
            _fit(None, shards, schedule, state, self.parameters.config, watch)
        finally:
            torch.set_num_threads(before)
        return state

    def _specialise(self, processes: _Processes, general: Path) -> dict[str, Path]:
        """Fit a copy to each family, families side by side; return the states."""
        job = partial(_specialise, self.work, self.parameters, general)
        return dict(zip(FAMILIES, self._all(processes, "families", job, tuple(FAMILIES)), strict=True))

    def _measured(self, processes: _Processes) -> dict[str, Path]:
        """Search plans of the fresh problems on which policies are measured."""
        job = partial(_write_measured, self.work, self.parameters)
        files = self._all(processes, "fresh problems", job, tuple(FAMILIES))
        return dict(zip(FAMILIES, files, strict=True))

    def _write(
        self, file: Path, state: Path, name: str, families: tuple[str, ...], measured: dict[str, Path]
    ) -> Path:
        p, policy = self.parameters, UniversalPolicy.of_training(state, self.parameters.config)
        metrics: dict[str, float | int] = {
            f"greedy_ratio_{family}": round(greedy_ratio(policy, path), 4)
            for family, path in measured.items()
        }
        data = encode(
            policy,
            config=policy.config,
            task=generate(families[0], *METRIC_SHAPE, np.random.default_rng([p.seed, _FRESH])),
            algorithm="qmix",
            seed=p.seed,
            parameters=p,
            metrics=metrics,
            name=name,
            families=list(families),
        )
        if data is None:
            raise InvalidCheckpoint(f"the training of {name} has diverged")
        part = file.with_suffix(".part")
        part.write_bytes(data)
        os.replace(part, file)
        self.tell("metrics", 1.0, name)
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

    def _watch(self, stage: str, schedule: Schedule, update: int, losses: dict[str, float]) -> None:
        words = ", ".join(f"{name} {loss:.4f}" for name, loss in losses.items())
        self.tell(stage, update / schedule.updates, words)


def greedy_ratio(policy: UniversalPolicy, measured: Path) -> float:
    """Mean share of a searched plan's reward that a greedy roll-out earns, on the problems of a shard."""
    shown = read_shard(measured)
    played = play(policy.agent, shown.arrays, np.arange(len(shown.rewards)))
    return float(np.mean(played.rewards / shown.rewards))


def _fit(
    start: Path | None,
    shards: list[Path],
    schedule: Schedule,
    state: Path,
    config: UniversalConfig,
    watch: Watch = unwatched,
) -> None:
    policy = UniversalPolicy.of_seed(config, schedule.seed)
    if start is not None:
        policy = UniversalPolicy.of_training(start, config)
    fit(policy.agent, policy.mixer, shards, schedule, state, watch)


def _specialise(work: Path, parameters: UniversalTrainingParameters, general: Path, family: str) -> Path:
    """Make a family's demonstrations and fit a copy of the general policy to them, in one thread."""
    torch.set_num_threads(1)
    p, state = parameters, work / f"family-{family}.safetensors"
    agent = UniversalPolicy.of_training(general, p.config).agent
    series = Series(f"demonstrations-{family}", (2, *family.encode()), (family,), p.search)
    shards = [write_shard(work, series, p.seed, number, agent) for number in range(p.family_shards)]
    schedule = Schedule(p.family_updates, p.family_lr, p.td_weight, p.seed)
    _fit(general, shards, schedule, state, p.config)
    return state


def _write_measured(work: Path, parameters: UniversalTrainingParameters, family: str) -> Path:
    count = parameters.metric_problems
    path = work / f"fresh-{family}-{count}.npz"
    if not path.exists():
        m, n, _ = METRIC_SHAPE
        rng = np.random.default_rng([_FRESH, *family.encode()])
        problems = [generate(family, *METRIC_SHAPE, rng) for _ in range(count)]
        save_shard(path, demonstrate(Shard(m, n, problems, round(parameters.search * METRIC_MOVES)), rng))
    return path
