"""Writes tables and figures."""

from pathlib import Path

from app.reproduction.grid import Run
from app.reproduction.scale import Scale


def write_report(scale: Scale, runs: list[Run], out: Path) -> None:
    """Write everything."""
