"""A PostgreSQL server for the tests that need one; they are skipped where none is installed."""

import os
from collections.abc import Iterator

import pytest
from postgresql_server import PostgresqlServer, binaries

HOW_TO_GET_ONE = (
    "no PostgreSQL: 'apt-get install postgresql' and pip install '.[postgres]' "
    "(REQUIRE_POSTGRES=1 makes this a failure)"
)


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgresqlServer]:
    if binaries() is None and os.environ.get("REQUIRE_POSTGRES") != "1":
        pytest.skip(HOW_TO_GET_ONE)
    server = PostgresqlServer()
    yield server
    server.close()


@pytest.fixture(params=["sqlite", "postgresql"])
def any_database_url(request: pytest.FixtureRequest, tmp_path) -> str:
    """An empty database of each kind."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'store' / 'database.db'}"
    return request.getfixturevalue("postgresql").new_database()
