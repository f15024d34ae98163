"""What all tests share: which of them run in one process, and a PostgreSQL server where one is installed."""

import os
from collections.abc import Iterator

import pytest
from postgresql_server import PostgresqlServer, binaries

HOW_TO_GET_ONE = (
    "no PostgreSQL: 'apt-get install postgresql' and pip install '.[postgres]' "
    "(REQUIRE_POSTGRES=1 makes this a failure)"
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep files whose tests share a folder's service in one process, so that it starts once."""
    sharing = {item.path for item in items if "service" in getattr(item, "fixturenames", ())}
    for item in items:
        together = item.path.parent if item.path in sharing else item.path
        item.add_marker(pytest.mark.xdist_group(str(together.relative_to(item.config.rootpath))))


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
