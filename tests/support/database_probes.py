"""Programs that use a database beside the tests, and what stands in one."""

import subprocess
import sys
import textwrap
from pathlib import Path

from sqlalchemy import text

from policy_store.database import Database

ROOT = Path(__file__).parents[2]


def start(program: str, *arguments: str) -> subprocess.Popen[str]:
    """Run a program in a process of its own, with pipes."""
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program), *arguments],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def scalar(database: Database, query: str) -> object:
    """Return the one value that a query has."""
    with database.read() as connection:
        return connection.execute(text(query)).scalar_one()
