"""What several commands need: settings, the database, and a word about what was wrong."""

from __future__ import annotations

import difflib
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from sqlalchemy.exc import SQLAlchemyError

from app.api.access.keys import KeyStore
from app.api.errors import RequestError
from app.domain.errors import AllocatorError
from app.field_errors import in_words
from app.mavlink.errors import MavlinkError
from app.reproduction.errors import ReproductionError
from app.settings import Settings
from policy_store.database import Database
from policy_store.errors import PolicyStoreError
from policy_store.library import PolicyLibrary

_PREFIX = "ALLOCATOR_"

DataDir = Annotated[Path | None, typer.Option(help="Folder of the database; made where it is missing.")]


def read_settings(**given: Any) -> Settings:
    """Read the settings; what the command line gives comes first, and unknown variables are told of."""
    for name in sorted(os.environ):
        if name.startswith(_PREFIX) and name.removeprefix(_PREFIX).lower() not in Settings.model_fields:
            known = [f"{_PREFIX}{field.upper()}" for field in Settings.model_fields]
            near = difflib.get_close_matches(name, known, 1)
            guess = f"; did you mean {near[0]}?" if near else ""
            typer.echo(f"{name} is no setting, and is ignored{guess}", err=True)
    given = {name: value for name, value in given.items() if value is not None}
    try:
        return Settings(**given)
    except ValidationError as error:
        for problem in error.errors(include_url=False):
            typer.echo(_setting_in_words(problem, given), err=True)
        raise typer.Exit(2) from None


def _setting_in_words(problem: Mapping[str, Any], given: Mapping[str, Any]) -> str:
    """Say what is wrong with a setting, by the name under which it was given."""
    if not problem["loc"]:
        return in_words(problem)
    name, *rest = map(str, problem["loc"])
    called = f"--{name.replace('_', '-')}" if name in given else f"{_PREFIX}{name.upper()}"
    return f"{'/'.join([called, *rest])}: {in_words(problem)}"


@contextmanager
def open_database(settings: Settings, failure: str = "") -> Iterator[Database]:
    """Open the database of the settings; what is wrong with it is said in a line, after what failed."""
    database = None
    try:
        database = Database(settings.resolved_database_url)
        yield database
        return
    except PolicyStoreError as error:
        line = str(error)
    except SQLAlchemyError as error:
        # The driver's own words, which name no file.
        line = f"database {'' if database is None else database.url}: {getattr(error, 'orig', None) or error}"
    finally:
        if database is not None:
            database.dispose()
    typer.echo(failure + line, err=True)
    raise typer.Exit(1)


@contextmanager
def open_library(settings: Settings) -> Iterator[tuple[PolicyLibrary, Database]]:
    """Open the policy library of the data folder, made where it is missing."""
    with open_database(settings) as database:
        library = PolicyLibrary(database)
        library.migrate()
        yield library, database


@contextmanager
def open_keys(settings: Settings) -> Iterator[KeyStore]:
    """Open the table of keys of the data folder, made where it is missing."""
    with open_database(settings) as database:
        store = KeyStore(database)
        store.migrate()
        yield store


def write_out(text: str) -> None:
    """Write a line to standard output; where that does not take it, say so and exit with 1."""
    try:
        if sys.stdout is None:
            raise OSError("it is closed")
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()
        return
    except BrokenPipeError:
        # Who reads has enough.
        pass
    except OSError as error:
        typer.echo(f"standard output cannot be written: {error.strerror or error}", err=True)
    with suppress(OSError, ValueError, AttributeError):
        # What is left in its buffer would fail once more at the end of the process.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    raise typer.Exit(1)


@contextmanager
def refusals() -> Iterator[None]:
    """Say what is wrong with what was given, a line each, and exit with 1."""
    try:
        yield
        return
    except ValidationError as error:
        lines = [
            f"/{'/'.join(map(str, e['loc']))}: {e['msg']}"
            for e in error.errors(include_url=False, include_input=False)
        ]
    except RequestError as error:
        lines = [f"{e.pointer or 'the request'}: {e.detail}" for e in error.errors] or [error.detail]
    except AllocatorError as error:
        lines = [f"{v.pointer}: {v.detail}" for v in error.violations] or [error.detail]
    except (OSError, ValueError, MavlinkError, ReproductionError, PolicyStoreError, SQLAlchemyError) as error:
        lines = [str(error)]
    for line in lines:
        typer.echo(line, err=True)
    raise typer.Exit(1)
