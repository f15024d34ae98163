"""What several commands need: settings, the database, and a word about what was wrong."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from sqlalchemy.exc import SQLAlchemyError

from app.api.access.keys import KeyStore
from app.api.errors import RequestError
from app.domain.errors import AllocatorError
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
    try:
        return Settings(**{name: value for name, value in given.items() if value is not None})
    except ValidationError as error:
        for problem in error.errors(include_url=False):
            where = ".".join(map(str, problem["loc"]))
            typer.echo(f"setting {where}: {problem['msg']}", err=True)
        raise typer.Exit(2) from None


@contextmanager
def open_library(settings: Settings) -> Iterator[tuple[PolicyLibrary, Database]]:
    """Open the policy library of the data folder, made where it is missing."""
    database = Database(settings.resolved_database_url)
    try:
        library = PolicyLibrary(database)
        library.migrate()
        yield library, database
    finally:
        database.dispose()


@contextmanager
def open_keys(settings: Settings) -> Iterator[KeyStore]:
    """Open the table of keys of the data folder, made where it is missing."""
    database = Database(settings.resolved_database_url)
    try:
        store = KeyStore(database)
        store.migrate()
        yield store
    finally:
        database.dispose()


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
