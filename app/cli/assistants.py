"""The MCP server: tools for assistants on a service that runs."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer


class Transport(StrEnum):
    """How assistants reach the server."""

    STDIO = "stdio"
    HTTP = "http"


def serve_assistants(
    url: Annotated[
        str, typer.Option(envvar="UAV_ALLOCATOR_URL", help="Of the service that runs.")
    ] = "http://127.0.0.1:8000",
    key: Annotated[
        str | None,
        typer.Option(
            envvar="UAV_ALLOCATOR_KEY",
            help="API key, with stdio; with http each request brings its own as Authorization: Bearer.",
        ),
    ] = None,
    transport: Annotated[Transport, typer.Option(help="stdio, or streamable HTTP.")] = Transport.STDIO,
    host: Annotated[str, typer.Option(help="With http: address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="With http: port to listen on.")] = 8001,
) -> None:
    """Give assistants tools on a service that runs: allocate, evaluate, explain, missions (MCP)."""
    try:
        # Extras, which need not be installed.
        from app.client import Client, ClientError  # noqa: PLC0415
        from app.mcp.server import create_server  # noqa: PLC0415
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        typer.echo(f"the MCP server needs {package}: pip install 'uav-allocator[mcp]'", err=True)
        raise typer.Exit(2) from None
    if transport is Transport.HTTP and key is not None:
        typer.echo(
            "with http every request brings its own key: leave --key and UAV_ALLOCATOR_KEY out", err=True
        )
        raise typer.Exit(2)
    try:
        with Client(url, key) as service:
            description = service.description()
    except ClientError as error:
        typer.echo(f"there is no service to give tools for: {error}", err=True)
        raise typer.Exit(1) from None
    server = create_server(url, key, description)
    if transport is Transport.STDIO:
        server.run()
    else:
        server.run("streamable-http", host=host, port=port, stateless_http=True)
