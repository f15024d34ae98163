"""Start the service, look after it, allocate and evaluate without it."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer
from sqlalchemy import make_url

from app.api.access.keys import KeyStore
from app.api.allocation_models import Allocation, AllocationRequest
from app.api.allocation_payload import payload_of
from app.api.body_validation import BodyValidator
from app.api.errors import MalformedJson
from app.api.evaluation_models import Evaluation, EvaluationRequest
from app.api.evaluation_payload import evaluation_payload
from app.api.json_body import parse_json
from app.api.plan_formats.archive import texts_of
from app.api.server import Server
from app.cli.common import (
    DataDir,
    open_database,
    open_keys,
    open_library,
    read_settings,
    refusals,
    write_out,
)
from app.cli.progress import bar
from app.jobs import model
from app.jobs.store import JobStore
from app.jobs.worker import WorkContext
from app.library.seeding import seed_library
from app.logs import configure_logs
from app.memory import limit_arenas
from app.processors import usable_processors
from app.settings import Settings
from policy_store.backup import back_up
from policy_store.errors import BackupFailed
from policy_store.library import PolicyLibrary

Host = Annotated[str | None, typer.Option(help="Address to listen on.")]
Port = Annotated[int | None, typer.Option(help="Port to listen on.")]

_CANNOT_START = "the service cannot start: "


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
    settings = read_settings(host=host, port=port, data_dir=data_dir, no_keys=no_keys)
    if settings.always_needs_keys:
        with open_keys(settings) as store:
            usable = any(key.revoked_at is None for key in store.all())
        if not usable:
            typer.echo(
                f"others can reach {settings.host}, and there is no API key yet: make one with "
                "`python -m app keys create`, or say --no-keys to serve everybody",
                err=True,
            )
            raise typer.Exit(2)
    _prepare(settings)
    configure_logs(settings.log_level)
    limit_arenas()
    try:
        server = Server(settings)
    except (OSError, ValueError) as error:
        typer.echo(f"{_CANNOT_START}{error}", err=True)
        raise typer.Exit(1) from None
    with suppress(KeyboardInterrupt):
        server.run()
    if not server.started:
        raise typer.Exit(3)


def _prepare(settings: Settings) -> None:
    """Bring the database to this version, or end with what is in the way of that."""
    with open_database(settings, _CANNOT_START) as database:
        try:
            # A newer version must not change what another service works on.
            database.occupy()
            library = PolicyLibrary(database)
            for store in (library, KeyStore(database), JobStore(database, "migration", 1)):
                store.migrate()
            seed_library(library, database)
        finally:
            database.vacate()


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
    settings = read_settings(data_dir=data_dir)
    with refusals():
        body = parse_json(sys.stdin.buffer.read() if str(file) == "-" else file.read_bytes())
        options = {"algorithm": algorithm, "seed": seed, "time_limit_s": time_limit_s}
        given: dict[str, object] = {name: value for name, value in options.items() if value is not None}
        if parameters is not None:
            given["parameters"] = _parsed("--parameters", parameters)
        if isinstance(body, dict):
            body |= given
        request = BodyValidator(AllocationRequest).validate(body, settings)
        assert isinstance(request, AllocationRequest)
        payload = payload_of(request, settings, settings.resolved_database_url)
        payload["threads"] = settings.threads_per_job
        with open_library(settings) as (library, database):
            seed_library(library, database)
        # Loads compiled code and torch, which a call for help or a mistake need not wait for.
        from app.allocation import tasks  # noqa: PLC0415 - as above

        with bar(request.algorithm, total=1.0) as advance:

            def report(progress: model.Progress) -> None:
                advance(progress.fraction, f"best reward {progress.best_reward or 0:.4f}")

            context = WorkContext.in_process(report, time_limit_s=request.time_limit_s)
            result = tasks.allocate(payload, context).result
    answer = Allocation(job_id="", elapsed_s=time.monotonic() - started, **result)
    write_out(answer.model_dump_json(indent=2, exclude={"job_id"}, exclude_unset=True))


def _parsed(option: str, text: str) -> object:
    """Read the JSON of an option, which is named where it is none."""
    try:
        return parse_json(text.encode("utf-8", "surrogateescape"))
    except MalformedJson as error:
        raise ValueError(f"{option} is not JSON: {error.reason}") from None


def evaluate(
    file: Annotated[Path, typer.Argument(help="A request of POST /evaluate as JSON; - for standard input.")],
    at: Annotated[float | None, typer.Option(help="Instead of the request's.")] = None,
    flights: Annotated[
        list[Path] | None,
        typer.Option(
            help="In place of a plan in the request: a .plan or waypoint file, or a ZIP archive of them, "
            "named as those of a plan that is taken away. Any number of them."
        ),
    ] = None,
) -> None:
    """Answer as POST /evaluate does, without a server; the answer goes to standard output."""
    started = time.monotonic()
    settings = read_settings()
    with refusals():
        body = parse_json(sys.stdin.buffer.read() if str(file) == "-" else file.read_bytes())
        if isinstance(body, dict) and at is not None:
            body["at"] = at
        if isinstance(body, dict) and flights:
            body["flight_files"] = [
                {"name": name, "content": text}
                for path in flights
                for name, text in texts_of(path.name, path.read_bytes()).items()
            ]
        request = BodyValidator(EvaluationRequest).validate(body, settings)
        assert isinstance(request, EvaluationRequest)
        # Loads compiled code, which a call for help or a mistake need not wait for.
        from app.allocation import evaluating  # noqa: PLC0415 - as above

        context = WorkContext.in_process(lambda _progress: None, time_limit_s=None)
        result = evaluating.evaluate(evaluation_payload(request, settings), context).result
    answer = Evaluation(job_id="", elapsed_s=time.monotonic() - started, **result)
    write_out(answer.model_dump_json(indent=2, exclude={"job_id"}, exclude_unset=True))


def compile_code(
    processes: Annotated[
        int, typer.Option(min=1, help="Processes that compile at a time.", show_default="the cores there are")
    ] = usable_processors(),
) -> None:
    """Make and keep the compiled code that the service's workers load; takes minutes the first time."""
    from app.allocation.warm_up import compile_all  # noqa: PLC0415 - slow to load

    started = time.monotonic()
    compile_all(processes)
    typer.echo(f"compiled code is ready ({time.monotonic() - started:.0f} s)", err=True)


def backup(
    file: Annotated[Path, typer.Argument(help="Where to; it must not exist yet.")], data_dir: DataDir = None
) -> None:
    """Copy the database, also while the service runs, and check the copy.

    To go back to it, stop the service and put the copy in the place of allocator.sqlite3; remove the files
    allocator.sqlite3-wal and allocator.sqlite3-shm beside it.
    """
    url = make_url(read_settings(data_dir=data_dir).resolved_database_url)
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
