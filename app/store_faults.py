"""What is raised where the database does not answer, whichever room has it."""

from __future__ import annotations

from sqlalchemy.exc import InterfaceError, OperationalError

STORE_IS_AWAY = (OperationalError, InterfaceError)
"""The database is locked, full or does not answer; another try may succeed."""


def first_line(error: Exception) -> str:
    """Return what an error says without what SQLAlchemy adds in further lines, for the log."""
    return str(error).partition("\n")[0]
