"""Train policies, and write them to files."""

from __future__ import annotations

import hashlib
import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from app.cli.common import DataDir, open_library, read_settings, refusals
from app.cli.progress import bar
from app.library.seeding import add_policies, read_policies, seed_library
from app.settings import Settings
from policy_store.errors import PolicyNotFound


class ExportFormat(StrEnum):
    """What a policy can be written as."""

    ONNX = "onnx"
    CHECKPOINT = "checkpoint"


class Executor(StrEnum):
    """Where trainings run."""

    LOCAL = "local"
    RAY = "ray"


def train(
    folder: Annotated[
        Path | None, typer.Option(help="Write the checkpoints here, instead of registering them.")
    ] = None,
    data_dir: DataDir = None,
    n_epochs: Annotated[int, typer.Option(min=1, help="Epochs of Algorithm 1 a source task.")] = 5000,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = os.cpu_count() or 1,
    executor: Annotated[
        Executor, typer.Option(help="local: processes of this machine; ray: the cluster of the settings.")
    ] = Executor.LOCAL,
) -> None:
    """Train source tasks of the paper's sizes, and of the examples that paper mode takes, into a library.

    A run that was interrupted goes on where it stopped.
    """
    # Loads torch, which the other commands need not wait for.
    from app.learning.train_library import source_tasks, train_library  # noqa: PLC0415 - slow to load

    settings = read_settings(data_dir=data_dir)
    target = folder or settings.data_dir / "training"
    tasks = source_tasks()
    fractions: dict[str, float] = {}
    with bar("source tasks", total=float(len(tasks))) as advance:
        cluster = settings.ray_address if executor is Executor.RAY else None
        for progress in train_library(tasks, target, n_epochs, workers, cluster):
            fractions[progress.task.id] = progress.fraction
            advance(sum(fractions.values()), progress.task.name if progress.finished else "")
    if folder is None:
        with open_library(settings) as (library, database):
            added = add_policies(library, database, read_policies(target))
        typer.echo(f"{added} of {len(tasks)} policies are new in the library", err=True)


def train_universal(
    folder: Annotated[Path, typer.Option(help="Where the checkpoint is written.")],
    work: Annotated[Path, typer.Option(help="Folder for searched plans and states of the training.")],
    name: Annotated[str, typer.Option(help="Id of the policy, and stem of its file.")],
    workers: Annotated[int, typer.Option(min=1, help="Processes or threads.")] = os.cpu_count() or 1,
    executor: Annotated[
        Executor,
        typer.Option(
            help="local; or ray: the cluster of the settings; all its machines see the folder WORK."
        ),
    ] = Executor.LOCAL,
) -> None:
    """Train the policy for every number of UAVs, areas and materials.

    Plans of generated problems are searched, and a network learns from them; then it plays, what it should
    have done is searched, and it learns from that too. A run that was interrupted goes on where it stopped.
    """
    # Loads torch, which the other commands need not wait for.
    from app.learning.universal.training import production  # noqa: PLC0415 - slow to load

    with bar("policy for every size", total=1.0) as advance:

        def tell(stage: str, share: float, said: str) -> None:
            advance(share, f"{stage} {said}")

        parameters = production.UniversalTrainingParameters()
        cluster = read_settings().ray_address if executor is Executor.RAY else None
        production.Production(work.absolute(), parameters, workers, tell, cluster).run(folder, name)


def export(
    policy: Annotated[str, typer.Argument(help="Id of a policy in the library, or a checkpoint file.")],
    out: Annotated[Path, typer.Option(help="Where to.")],
    format: Annotated[
        ExportFormat, typer.Option(help="onnx: the agent network, to run on board; or the checkpoint.")
    ] = ExportFormat.ONNX,
    data_dir: DataDir = None,
) -> None:
    """Write a policy of the library to a file, by default for a computer on board.

    What that computer has to feed is in app/learning/ON_BOARD.md.
    """
    settings = read_settings(data_dir=data_dir)
    with refusals():
        data = _checkpoint(policy, settings)
        digest = hashlib.sha256(data).hexdigest()
        if format is ExportFormat.ONNX:
            # Loads torch, which the other commands need not wait for.
            from app.learning.checkpoints.export import to_onnx  # noqa: PLC0415 - slow to load

            data = to_onnx(data)
        out.write_bytes(data)
    typer.echo(f"{out}: {len(data)} bytes, of the checkpoint with the SHA-256 {digest}", err=True)


def _checkpoint(policy: str, settings: Settings) -> bytes:
    """Read the checkpoint of a policy, from a file or else from the library."""
    if Path(policy).is_file():
        return Path(policy).read_bytes()
    with open_library(settings) as (library, database):
        seed_library(library, database)
        try:
            return library.checkpoint(policy)
        except PolicyNotFound:
            raise ValueError(f"{policy!r} is neither a file nor a policy in the library") from None
