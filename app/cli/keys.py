"""API keys: make, list, revoke."""

from __future__ import annotations

from typing import Annotated

import typer

from app.api.access.keys import Role, in_a_line
from app.cli.common import DataDir, open_keys, read_settings, refusals, write_out


def create_key(
    role: Annotated[Role, typer.Option(help="allocate; or library: policies may be changed too.")],
    name: Annotated[str, typer.Option(help="Who or what it is for.")],
    data_dir: DataDir = None,
) -> None:
    """Make a key and print it; it is not kept and cannot be shown again."""
    with refusals(), open_keys(read_settings(data_dir=data_dir)) as store:
        key, token = store.create(name, role)
    write_out(token)
    typer.echo(f"key {key.id} of the role {role} for {name!r}: this is the only time it is shown", err=True)


def list_keys(data_dir: DataDir = None) -> None:
    """List the keys without their secrets, a line each, with tabs between id, role, dates and name."""
    with open_keys(read_settings(data_dir=data_dir)) as store:
        for key in store.all():
            revoked = "in use" if key.revoked_at is None else f"revoked {key.revoked_at:%Y-%m-%d %H:%M}"
            write_out(
                f"{key.id}\t{key.role}\t{key.created_at:%Y-%m-%d %H:%M}\t{revoked}\t{in_a_line(key.name)}"
            )


def revoke_key(key_id: Annotated[str, typer.Argument(help="As listed.")], data_dir: DataDir = None) -> None:
    """Revoke a key; a running service refuses it a second later."""
    with open_keys(read_settings(data_dir=data_dir)) as store:
        if not store.revoke(key_id):
            typer.echo(f"no key that is in use has the id {key_id!r}", err=True)
            raise typer.Exit(1)
