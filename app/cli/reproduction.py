"""Repeat the paper's experiments."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from app.cli.common import refusals
from app.cli.progress import bar


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
    race_problems: Annotated[int | None, typer.Option(min=1, help="Problems a place of the race.")] = None,
    race_seeds: Annotated[int | None, typer.Option(min=1, help="Seeds a problem of the race.")] = None,
    race_evaluations: Annotated[
        int | None, typer.Option(min=1, help="Plans that each may fly in the race of equal evaluations.")
    ] = None,
    race_places: Annotated[
        str | None,
        typer.Option(help="Places of the race, such as 'clustered-5x10 drawn'; default: all."),
    ] = None,
    parts: Annotated[str, typer.Option(help="'paper', 'race' or both.")] = "paper race",
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
        "race_problems": race_problems,
        "race_seeds": race_seeds,
        "race_evaluations": race_evaluations,
    }
    with refusals():
        scale = command.scale_of(quick, {k: v for k, v in given.items() if v is not None}, cells, race_places)
        for package in command.missing_packages():
            typer.echo(f"{package} is not installed, so it is not compared with (extra: compare)", err=True)
        with bar("runs", total=float(command.count_runs(scale, parts.split()))) as advance:
            complete = command.reproduce(scale, out, workers, for_minutes, advance, parts.split())
    if not complete:
        typer.echo("not all runs are done: the same command goes on", err=True)
        raise typer.Exit(3)
    typer.echo(f"tables and figures are in {out}", err=True)
