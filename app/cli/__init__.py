"""The command line: the service, work without it, vehicles, training, the paper's figures."""

from __future__ import annotations

import typer

from app.cli.assistants import serve_assistants
from app.cli.flying import fly
from app.cli.keys import create_key, list_keys, revoke_key
from app.cli.reproduction import reproduce
from app.cli.service import allocate, backup, compile_code, evaluate, serve
from app.cli.training import export, train, train_universal

application = typer.Typer(
    help="Task allocation of UAV swarms with relief materials.", no_args_is_help=True, add_completion=False
)
for command in (serve, allocate, evaluate, train, train_universal, reproduce, export, backup, fly):
    application.command()(command)
application.command("compile")(compile_code)
application.command("mcp")(serve_assistants)

keys = typer.Typer(help="API keys: make, list, revoke.", no_args_is_help=True)
keys.command("create")(create_key)
keys.command("list")(list_keys)
keys.command("revoke")(revoke_key)
application.add_typer(keys, name="keys")
