"""The command line: start the service and look after it, allocate without it, train source tasks."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
import uvicorn
from pydantic import ValidationError
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from sqlalchemy import make_url

from app.api.access.keys import KeyStore, Role
from app.api.allocation_models import Allocation, AllocationRequest
from app.api.application import create_application
from app.api.problem_models import to_problem
from app.api.receipt_deadline import protocol_with_deadline
from app.domain.errors import AllocatorError
from app.domain.records import problem_to_record
from app.jobs import model
from app.jobs.work_context import WorkContext
from app.library.seeding import add_policies, read_policies, seed_library
from app.logs import configure_logs
from app.reproduction.errors import ReproductionError
from app.settings import Settings
from app.solvers.registry import parse_parameters
from policy_store.backup import back_up
from policy_store.database import Database
from policy_store.errors import BackupFailed, PolicyNotFound
from policy_store.library import PolicyLibrary

PLAIN_LINE_EVERY_S = 2.0
"""Seconds between two lines of progress where there is no terminal."""

application = typer.Typer(
    help="Task allocation of UAV swarms with relief materials.", no_args_is_help=True, add_completion=False
)
keys = typer.Typer(help="API keys: make, list, revoke.", no_args_is_help=True)
application.add_typer(keys, name="keys")

Advance = Callable[[float, str], None]
"""Takes how much of the total is done, and a word about it."""


class ExportFormat(StrEnum):
    """What a policy can be written as."""

    ONNX = "onnx"
    CHECKPOINT = "checkpoint"


class Executor(StrEnum):
    """Where trainings run."""

    LOCAL = "local"
    RAY = "ray"


Host = Annotated[str | None, typer.Option(help="Address to listen on.")]
Port = Annotated[int | None, typer.Option(help="Port to listen on.")]
DataDir = Annotated[Path | None, typer.Option(help="Folder of the database; made where it is missing.")]


@application.command()
def serve(
    host: Host = None,
    port: Port = None,
    data_dir: DataDir = None,
    no_keys: Annotated[
        bool | None,
        typer.Option("--no-keys", help="Take requests without API keys from everybody.", show_default=False),
    ] = None,
) -> None:
    """Start the service with everything that POST /allocate needs."""
    settings = _settings(host=host, port=port, data_dir=data_dir, no_keys=no_keys)
    if settings.always_needs_keys:
        with _keys(settings) as store:
            usable = any(key.revoked_at is None for key in store.all())
        if not usable:
            typer.echo(
                f"others can reach {settings.host}, and there is no API key yet: make one with "
                "`python -m app keys create`, or say --no-keys to serve everybody",
                err=True,
            )
            raise typer.Exit(2)
    configure_logs(settings.log_level)
    uvicorn.run(
        create_application(settings),
        host=settings.host,
        port=settings.port,
        log_config=None,
        access_log=False,
        http=protocol_with_deadline(settings.receive_timeout_s),
        timeout_graceful_shutdown=int(settings.shutdown_grace_s),
    )


@application.command()
def allocate(
    file: Annotated[Path, typer.Argument(help="A request of POST /allocate as JSON; - for standard input.")],
    algorithm: Annotated[str | None, typer.Option(help="Instead of the request's.")] = None,
    parameters: Annotated[str | None, typer.Option(help="JSON object, instead of the request's.")] = None,
    seed: Annotated[int | None, typer.Option(help="Instead of the request's.")] = None,
    time_limit_s: Annotated[float | None, typer.Option(help="Instead of the request's.")] = None,
    data_dir: DataDir = None,
) -> None:
    """Answer as POST /allocate does, without a server; the answer goes to standard output."""
    started = time.monotonic()
    settings = _settings(data_dir=data_dir)
    with _refusals():
        body = json.loads(sys.stdin.read() if str(file) == "-" else file.read_text(encoding="utf-8"))
        given = {"algorithm": algorithm, "seed": seed, "time_limit_s": time_limit_s}
        body |= {name: value for name, value in given.items() if value is not None}
        if parameters is not None:
            body["parameters"] = json.loads(parameters)
        request = AllocationRequest.model_validate(body)
        payload = {
            "problem": problem_to_record(to_problem(request, settings)),
            "algorithm": request.algorithm,
            "parameters": parse_parameters(request.algorithm, request.parameters).model_dump(mode="json"),
            "seed": request.seed,
            "library_url": settings.resolved_database_url,
            "threads": settings.threads_per_job,
            "bound_time_limit_s": request.bound_seconds,
        }
        with _library(settings) as (library, database):
            seed_library(library, database)
        # Loads compiled code and torch, which a call for help or a mistake need not wait for.
        from app.jobs import work  # noqa: PLC0415 - slow to load

        with _bar(request.algorithm, total=1.0) as advance:

            def report(progress: model.Progress) -> None:
                advance(progress.fraction, f"best reward {progress.best_reward or 0:.4f}")

            context = WorkContext.in_process(report, time_limit_s=request.time_limit_s)
            result = work.allocate(payload, context).result
    answer = Allocation(job_id="", elapsed_s=time.monotonic() - started, **result)
    sys.stdout.write(answer.model_dump_json(indent=2, exclude={"job_id"}) + "\n")


@application.command()
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
    """Train the source tasks of the paper's sizes and of the bundled examples into a library.

    A run that was interrupted goes on where it stopped.
    """
    # Loads torch, which the other commands need not wait for.
    from app.learning.train_library import source_tasks, train_library  # noqa: PLC0415 - slow to load

    settings = _settings(data_dir=data_dir)
    target = folder or settings.data_dir / "training"
    tasks = source_tasks()
    fractions: dict[str, float] = {}
    with _bar("source tasks", total=float(len(tasks))) as advance:
        cluster = settings.ray_address if executor is Executor.RAY else None
        for progress in train_library(tasks, target, n_epochs, workers, cluster):
            fractions[progress.task.id] = progress.fraction
            advance(sum(fractions.values()), progress.task.name if progress.finished else "")
    if folder is None:
        with _library(settings) as (library, database):
            added = add_policies(library, database, read_policies(target))
        typer.echo(f"{added} of {len(tasks)} policies are new in the library", err=True)


@application.command()
def train_universal(
    folder: Annotated[Path, typer.Option(help="Where the checkpoints are written.")],
    work: Annotated[Path, typer.Option(help="Folder for demonstrations and states of trainings.")],
    name: Annotated[str, typer.Option(help="Id of the general policy; a family's has the family behind it.")],
    workers: Annotated[int, typer.Option(min=1, help="Processes or threads.")] = os.cpu_count() or 1,
    executor: Annotated[
        Executor,
        typer.Option(
            help="local; or ray: the cluster of the settings; all its machines see the folder WORK."
        ),
    ] = Executor.LOCAL,
) -> None:
    """Train the policies for every number of UAVs, areas and materials: a general one and one a family.

    Near-optimal plans of generated problems are searched, a network learns from them and from its own
    episodes, plans are searched from what it does, and it learns on; then copies of it are fitted to each
    family. A run that was interrupted goes on where it stopped.
    """
    # Loads torch, which the other commands need not wait for.
    from app.learning.universal import production  # noqa: PLC0415 - slow to load

    with _bar("policies for every size", total=1.0) as advance:

        def tell(stage: str, share: float, said: str) -> None:
            advance(share, f"{stage} {said}")

        parameters = production.UniversalTrainingParameters()
        cluster = _settings().ray_address if executor is Executor.RAY else None
        production.Production(work.absolute(), parameters, workers, tell, cluster).run(folder, name)


@application.command()
def reproduce(
    out: Annotated[
        Path,
        typer.Option(help="Folder for records, tables and figures; a run that is there is not repeated."),
    ] = Path("data/reproduction"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Every experiment on one or two problems, in a few minutes.")
    ] = False,
    problems: Annotated[int | None, typer.Option(min=1, help="Problems a size.")] = None,
    seeds: Annotated[int | None, typer.Option(min=1, help="Seeds a problem.")] = None,
    epochs: Annotated[
        int | None,
        typer.Option(min=1, help="Epochs of QMIX from scratch at the sizes of the paper's figures."),
    ] = None,
    grid_epochs: Annotated[int | None, typer.Option(min=1, help="Epochs of QMIX and DQN elsewhere.")] = None,
    service_epochs: Annotated[int | None, typer.Option(min=1, help="Epochs of qmix in service mode.")] = None,
    learning_problems: Annotated[
        int | None, typer.Option(min=1, help="Problems a size of what learns from nothing.")
    ] = None,
    learning_seeds: Annotated[
        int | None, typer.Option(min=1, help="Seeds a problem of what learns from nothing.")
    ] = None,
    timed_problems: Annotated[
        int | None, typer.Option(min=0, help="Problems a size that general optimisers get too.")
    ] = None,
    cells: Annotated[
        str | None, typer.Option(help="Sizes, UAVs x areas, such as '5x10 10x5'; default: the whole grid.")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = os.cpu_count() or 1,
    for_minutes: Annotated[
        float | None,
        typer.Option(min=0, help="Begin no run after this time; the same command goes on later."),
    ] = None,
) -> None:
    """Repeat the paper's experiments, and write tables and figures.

    The full protocol, ten problems a size and five seeds a problem with 50,000 epochs each, takes more than a
    hundred core hours; the options say less. A run that was interrupted goes on where it stopped.
    """
    # Loads compiled code, which the other commands need not wait for.
    from app.reproduction import command  # noqa: PLC0415 - slow to load

    given = {
        "problems": problems,
        "seeds": seeds,
        "epochs": epochs,
        "grid_epochs": grid_epochs,
        "service_epochs": service_epochs,
        "learning_problems": learning_problems,
        "learning_seeds": learning_seeds,
        "timed_problems": timed_problems,
    }
    with _refusals():
        scale = command.scale_of(quick, {k: v for k, v in given.items() if v is not None}, cells)
        for package in command.missing_packages():
            typer.echo(f"{package} is not installed, so it is not compared with (extra: compare)", err=True)
        with _bar("runs", total=float(command.count_runs(scale))) as advance:
            complete = command.reproduce(scale, out, workers, for_minutes, advance)
    if not complete:
        typer.echo("not all runs are done: the same command goes on", err=True)
        raise typer.Exit(3)
    typer.echo(f"tables and figures are in {out}", err=True)


@application.command()
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
    settings = _settings(data_dir=data_dir)
    with _refusals():
        data = _checkpoint(policy, settings)
        digest = hashlib.sha256(data).hexdigest()
        if format is ExportFormat.ONNX:
            # Loads torch, which the other commands need not wait for.
            from app.learning.export import to_onnx  # noqa: PLC0415 - slow to load

            data = to_onnx(data)
        out.write_bytes(data)
    typer.echo(f"{out}: {len(data)} bytes, of the checkpoint with the SHA-256 {digest}", err=True)


@keys.command("create")
def create_key(
    role: Annotated[Role, typer.Option(help="allocate; or library: policies may be changed too.")],
    name: Annotated[str, typer.Option(help="Who or what it is for.")],
    data_dir: DataDir = None,
) -> None:
    """Make a key and print it; it is not kept and cannot be shown again."""
    with _keys(_settings(data_dir=data_dir)) as store:
        key, token = store.create(name, role)
    typer.echo(token)
    typer.echo(f"key {key.id} of the role {role} for {name!r}: this is the only time it is shown", err=True)


@keys.command("list")
def list_keys(data_dir: DataDir = None) -> None:
    """List the keys without their secrets, a line each, with tabs between id, role, dates and name."""
    with _keys(_settings(data_dir=data_dir)) as store:
        for key in store.all():
            revoked = "in use" if key.revoked_at is None else f"revoked {key.revoked_at:%Y-%m-%d %H:%M}"
            typer.echo(f"{key.id}\t{key.role}\t{key.created_at:%Y-%m-%d %H:%M}\t{revoked}\t{key.name}")


@keys.command("revoke")
def revoke_key(key_id: Annotated[str, typer.Argument(help="As listed.")], data_dir: DataDir = None) -> None:
    """Revoke a key; a running service refuses it a second later."""
    with _keys(_settings(data_dir=data_dir)) as store:
        if not store.revoke(key_id):
            typer.echo(f"no key that is in use has the id {key_id!r}", err=True)
            raise typer.Exit(1)


@application.command()
def backup(
    file: Annotated[Path, typer.Argument(help="Where to; it must not exist yet.")], data_dir: DataDir = None
) -> None:
    """Copy the database, also while the service runs, and check the copy.

    To go back to it, stop the service and put the copy in the place of allocator.sqlite3; remove the files
    allocator.sqlite3-wal and allocator.sqlite3-shm beside it.
    """
    url = make_url(_settings(data_dir=data_dir).resolved_database_url)
    if url.get_backend_name() != "sqlite":
        typer.echo("this copies an SQLite file; a PostgreSQL database is copied by pg_dump", err=True)
        raise typer.Exit(1)
    source = url.database
    try:
        size = back_up(Path(str(source)), file)
    except BackupFailed as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from None
    typer.echo(f"{file}: {size} bytes", err=True)


def _settings(**given: Any) -> Settings:
    """Read the settings; what the command line gives comes first."""
    try:
        return Settings(**{name: value for name, value in given.items() if value is not None})
    except ValidationError as error:
        for problem in error.errors(include_url=False):
            where = ".".join(map(str, problem["loc"]))
            typer.echo(f"setting {where}: {problem['msg']}", err=True)
        raise typer.Exit(2) from None


def _checkpoint(policy: str, settings: Settings) -> bytes:
    """Read the checkpoint of a policy, from a file or else from the library."""
    if Path(policy).is_file():
        return Path(policy).read_bytes()
    with _library(settings) as (library, database):
        seed_library(library, database)
        try:
            return library.checkpoint(policy)
        except PolicyNotFound:
            raise ValueError(f"{policy!r} is neither a file nor a policy in the library") from None


@contextmanager
def _library(settings: Settings) -> Iterator[tuple[PolicyLibrary, Database]]:
    """Open the policy library of the data folder, made where it is missing."""
    database = Database(settings.resolved_database_url)
    try:
        library = PolicyLibrary(database)
        library.migrate()
        yield library, database
    finally:
        database.dispose()


@contextmanager
def _keys(settings: Settings) -> Iterator[KeyStore]:
    """Open the table of keys of the data folder, made where it is missing."""
    database = Database(settings.resolved_database_url)
    try:
        store = KeyStore(database)
        store.migrate()
        yield store
    finally:
        database.dispose()


@contextmanager
def _refusals() -> Iterator[None]:
    """Say what is wrong with what was given, a line each, and exit with 1."""
    try:
        yield
        return
    except ValidationError as error:
        lines = [
            f"/{'/'.join(map(str, e['loc']))}: {e['msg']}"
            for e in error.errors(include_url=False, include_input=False)
        ]
    except AllocatorError as error:
        lines = [f"{v.pointer}: {v.detail}" for v in error.violations] or [error.detail]
    except (OSError, ValueError, ReproductionError) as error:
        lines = [str(error)]
    for line in lines:
        typer.echo(line, err=True)
    raise typer.Exit(1)


@contextmanager
def _bar(title: str, total: float) -> Iterator[Advance]:
    """Draw a progress bar on a terminal; elsewhere a line from time to time. Both go to standard error."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _PlainLines(title, total)
        return
    columns = (
        TextColumn(title),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("", total=total)
        yield lambda done, said: bar.update(task, completed=done, description=said)


class _PlainLines:
    """Progress as lines of text, not more often than every ``PLAIN_LINE_EVERY_S`` seconds."""

    def __init__(self, title: str, total: float) -> None:
        self._title, self._total = title, total
        self._next = time.monotonic() + PLAIN_LINE_EVERY_S

    def __call__(self, done: float, said: str) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + PLAIN_LINE_EVERY_S
            typer.echo(f"{self._title}: {100 * done / self._total:.1f} % {said}".rstrip(), err=True)
