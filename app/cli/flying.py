"""Bring together a mission of a service and vehicles that speak MAVLink."""

from __future__ import annotations

import signal
from datetime import UTC, datetime
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer

from app.api.plan_formats.mission import AltitudeReference, Delivery, Ending, FlightChoices
from app.cli.common import refusals

if TYPE_CHECKING:
    from app.mavlink.bridge import Choices
    from app.mavlink.service import MissionClient


def fly(
    mission: Annotated[str, typer.Argument(help="Id of the mission.")],
    stream: Annotated[
        str,
        typer.Argument(help="Host and port to which vehicles send by UDP, or a telemetry log (*.tlog)."),
    ] = "127.0.0.1:14550",
    url: Annotated[str, typer.Option(help="Of the service.")] = "http://127.0.0.1:8000",
    key: Annotated[
        str | None,
        typer.Option(help="API key.", envvar="UAV_ALLOCATOR_KEY", show_envvar=True),
    ] = None,
    system: Annotated[
        list[str] | None,
        typer.Option(
            help="A system id and its UAV, as 7=uav-1; default: system n is the mission's n-th UAV."
        ),
    ] = None,
    began: Annotated[
        datetime | None,
        typer.Option(help="When the mission's clock was 0, UTC; default: its clock is what it says, now."),
    ] = None,
    every_s: Annotated[float, typer.Option(min=0.1, help="Seconds between two batches of positions.")] = 1.0,
    clock_every_s: Annotated[
        float, typer.Option(min=0, help="Seconds between two moves of the mission's clock; 0: none.")
    ] = 10.0,
    upload: Annotated[
        bool, typer.Option("--upload", help="Send vehicles their flights also when they have not asked.")
    ] = False,
    altitude: Annotated[float, typer.Option(help="Of all flight, m.")] = 50.0,
    altitude_reference: Annotated[
        AltitudeReference, typer.Option(help="What it is measured from.")
    ] = AltitudeReference.HOME,
    delivery: Annotated[Delivery, typer.Option(help="How material is left.")] = Delivery.PAYLOAD_PLACE,
    end: Annotated[Ending, typer.Option(help="After the last stop.")] = Ending.RETURN,
) -> None:
    """Bring what vehicles tell by MAVLink into a mission, and their flights to those that ask.

    Stop it with Ctrl+C. It was tested with simulated vehicles, not with an autopilot.
    """
    with refusals():
        # What an extra brings, and other commands need not have.
        from app.mavlink.bridge import Choices, read_log  # noqa: PLC0415 - as above
        from app.mavlink.service import MissionClient  # noqa: PLC0415 - as above

        choices = Choices(
            systems=_systems(system or []),
            began_s=None if began is None else began.replace(tzinfo=UTC).timestamp(),
            every_s=every_s,
            clock_every_s=clock_every_s,
            upload=upload,
            flight=FlightChoices(altitude, altitude_reference, delivery, end),
        )
        client = MissionClient(url, mission, key)
        try:
            if stream.endswith(".tlog"):
                told = read_log(Path(stream), client, choices, _say)
            else:
                told = _until_interrupted(stream, client, choices)
        finally:
            client.close()
    typer.echo(f"{told} positions", err=True)


def _until_interrupted(address: str, client: MissionClient, choices: Choices) -> int:
    """Follow until Ctrl+C; what was heard until then is told."""
    from app.mavlink import bridge  # noqa: PLC0415 - what an extra brings
    from app.mavlink.streams import UdpStream  # noqa: PLC0415 - as above

    stop, stream = Event(), UdpStream(address)
    before = signal.signal(signal.SIGINT, lambda *_: stop.set())
    try:
        typer.echo(f"vehicles are listened to at {address}; Ctrl+C ends it", err=True)
        return bridge.fly(stream, client, choices, _say, stop)
    finally:
        signal.signal(signal.SIGINT, before)
        stream.close()


def _systems(given: list[str]) -> dict[int, str]:
    systems = {}
    for each in given:
        number, separator, uav_id = each.partition("=")
        if not separator or not number.isdecimal() or not 1 <= int(number) <= 255:
            raise ValueError(f"--system {each!r}: a system id of 1..255 and a UAV are needed, as 7=uav-1")
        if int(number) in systems:
            raise ValueError(f"--system {each!r}: system {number} is given twice")
        systems[int(number)] = uav_id
    return systems


def _say(line: str) -> None:
    typer.echo(line, err=True)
