"""Training the shipped source tasks: the "representative set" of section 4.3, in parallel and resumable."""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from app.domain.errors import InvalidCheckpoint
from app.domain.problem import Problem
from app.domain.records import problem_to_record
from app.learning.checkpoints.checkpoint import read_metadata, with_name
from app.learning.cluster_training import train_on_cluster
from app.learning.paper.observed import unobserved
from app.learning.parameters import QmixParameters
from app.learning.source_training import SEED, train_source
from app.simulation.generator import generate
from app.solvers.protocol import Progress
from app.solvers.stop import WhenSet

PAPER_SHAPES = tuple((m, n, 3) for m in (5, 10, 20) for n in (5, 10, 20, 30))
"""Sizes of section 5.2.4: UAVs, targets, materials."""

FAMILIES = ("uniform", "clustered")
"""Task families of the shipped sources, one task a shape and family."""

_POLL_S = 0.5

Shape = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class SourceTask:
    """A task to be trained on; `id` names its file and its policy, `name` is for people."""

    id: str
    name: str
    problem: Problem


@dataclass(frozen=True, slots=True)
class SourceProgress:
    """How far the training of a source task is.

    Attributes
    ----------
    task
        Which.
    fraction
        0 to 1.
    finished
        Whether its file is there.
    kept
        Whether it was there already, with the same parameters.
    """

    task: SourceTask
    fraction: float
    finished: bool = False
    kept: bool = False


def example_shapes() -> list[Shape]:
    """List the sizes of the bundled examples, but for those that the paper's networks cannot take."""
    shapes = []
    for file in sorted((resources.files("app") / "examples").iterdir(), key=lambda item: item.name):
        if file.name.endswith(".json"):
            problem = json.loads(file.read_text(encoding="utf-8"))
            if not any(_says(problem, *name.split(".")) for name in unobserved()):
                shapes.append(
                    (len(problem["uavs"]), len(problem["targets"]), len(problem["uavs"][0]["loadlist"]))
                )
    return shapes


def _says(part: Any, name: str, *inner: str) -> bool:
    """Return whether a request, or a part of it, has a field, or its parts have an inner one."""
    if isinstance(part, list):
        return any(_says(each, name, *inner) for each in part)
    return name in part and (not inner or _says(part[name], *inner))


def source_tasks(
    shapes: Sequence[Shape] | None = None, families: Sequence[str] = FAMILIES
) -> list[SourceTask]:
    """Generate the source tasks.

    Parameters
    ----------
    shapes
        Sizes (M, N, K); by default the paper's and those of the bundled examples that paper mode takes.
    families
        Names in :data:`app.simulation.generator.FAMILIES`.

    Returns
    -------
    list
        Largest first, so that parallel training ends at about one time.
    """
    chosen = sorted(set(shapes if shapes is not None else (*PAPER_SHAPES, *example_shapes())))
    tasks = []
    for m, n, k in sorted(chosen, key=lambda shape: -shape[0] * shape[1]):
        for family in families:
            # Each task has a stream of its own, so that a shape more or less changes no other task.
            words = [SEED, m, n, k, *family.encode()]
            rng = np.random.default_rng(np.random.SeedSequence(words))
            name = f"{family.replace('_', ' ')} {m} x {n} x {k}"
            tasks.append(SourceTask(f"{family}-{m}x{n}x{k}", name, generate(family, m, n, k, rng)))
    return tasks


def source_parameters(task: SourceTask, n_epochs: int) -> QmixParameters:
    """Return Table 1 with another number of epochs, over whose first half the exploration is annealed."""
    steps = max(1, n_epochs * task.problem.max_steps // 2)
    return QmixParameters(mode="paper", n_epochs=n_epochs, epsilon_anneal_steps=steps)


def train_library(
    tasks: Sequence[SourceTask], folder: Path, n_epochs: int, workers: int, cluster: str | None = None
) -> Iterator[SourceProgress]:
    """Train source tasks, each to a file ``{id}.safetensors``.

    A file that is there and was trained on the same task with the same parameters and seed is kept. Files
    appear complete or not at all; closing the iterator early leaves those that are finished.

    Parameters
    ----------
    tasks
        What to train on.
    folder
        Where the files go; made where it is missing.
    n_epochs
        Epochs of Algorithm 1 a task.
    workers
        Processes, each with one thread.
    cluster
        Address of a Ray cluster that trains instead, as many tasks at a time as it has CPUs. A task that is
        lost with its machine begins anew; files are the same wherever they were trained.

    Yields
    ------
    SourceProgress
        Kept files first, then whatever has changed, about twice a second; a cluster tells only the ends.
    """
    folder.mkdir(parents=True, exist_ok=True)
    left = []
    for task in tasks:
        if _is_trained(_file(folder, task), task, source_parameters(task, n_epochs)):
            yield SourceProgress(task, 1.0, finished=True, kept=True)
        else:
            left.append(task)
    if not left:
        return
    if cluster is None:
        yield from _train(left, folder, n_epochs, workers)
        return
    trainings = [(problem_to_record(task.problem), source_parameters(task, n_epochs)) for task in left]
    for place, checkpoint in train_on_cluster(trainings, cluster):
        task = left[place]
        _write(_file(folder, task), with_name(checkpoint, task.name))
        yield SourceProgress(task, 1.0, finished=True)


def _file(folder: Path, task: SourceTask) -> Path:
    return folder / f"{task.id}.safetensors"


def _is_trained(file: Path, task: SourceTask, parameters: QmixParameters) -> bool:
    if not file.exists():
        return False
    try:
        metadata = read_metadata(file.read_bytes())
    except InvalidCheckpoint:
        return False
    wanted = {
        "task": problem_to_record(task.problem),
        "parameters": parameters.model_dump(mode="json"),
        "seed": SEED,
        "name": task.name,
    }
    # Both sides as JSON has them: tuples are lists there.
    return bool(json.loads(json.dumps(wanted)) == {key: metadata.get(key) for key in wanted})


def _train(
    tasks: Sequence[SourceTask], folder: Path, n_epochs: int, workers: int
) -> Iterator[SourceProgress]:
    # Spawned, not forked: a child forked after torch has run in the parent hangs.
    context = multiprocessing.get_context("spawn")
    fractions, stopped = context.Array("d", len(tasks), lock=False), context.Event()
    pool = ProcessPoolExecutor(workers, context, _initialise, (fractions, stopped))
    futures: dict[Future[bytes], int] = {
        pool.submit(
            _train_one, index, problem_to_record(task.problem), source_parameters(task, n_epochs)
        ): index
        for index, task in enumerate(tasks)
    }
    told = [0.0] * len(tasks)
    try:
        pending = set(futures)
        while pending:
            done, pending = wait(pending, timeout=_POLL_S)
            for future in done:
                task = tasks[futures[future]]
                _write(_file(folder, task), with_name(future.result(), task.name))
                yield SourceProgress(task, 1.0, finished=True)
            for index in (futures[future] for future in pending):
                if fractions[index] != told[index]:
                    told[index] = fractions[index]
                    yield SourceProgress(tasks[index], told[index])
    finally:
        stopped.set()
        pool.shutdown(cancel_futures=True)


def _write(file: Path, data: bytes) -> None:
    partial = file.with_suffix(".partial")
    partial.write_bytes(data)
    os.replace(partial, file)


_shared: dict[str, Any] = {}
"""What a worker process shares with the parent: the fractions done, and whether to stop."""


def _initialise(fractions: Any, stopped: Any) -> None:
    _shared.update(fractions=fractions, stopped=stopped)


def _train_one(index: int, record: dict[str, Any], parameters: QmixParameters) -> bytes:
    def report(progress: Progress) -> None:
        _shared["fractions"][index] = progress.fraction

    return train_source(record, parameters, WhenSet(_shared["stopped"]), report)
