"""How times of the globe are written for people."""

from __future__ import annotations


def clock(hours: float) -> str:
    """Write a time in h as hours and minutes, rounded to the minute: ``1:42``."""
    minutes = round(abs(hours) * 60)
    return f"{'-' if hours < 0 and minutes else ''}{minutes // 60}:{minutes % 60:02d}"
