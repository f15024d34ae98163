"""What all tests share: which of them run in one process, and a PostgreSQL server where one is installed."""

import os
from collections.abc import Iterator

import pytest
from hypothesis import settings
from postgresql_server import PostgresqlServer, binaries
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

# An example takes as long as a busy machine lets it.
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")

ONE_SERVICE = {"tests/api", "tests/client", "tests/dashboard"}
LONGEST = (
    "tests/api/",
    "tests/dashboard/",
    "tests/client/",
    "tests/jobs/test_executors.py",
    "tests/reproduction/test_reproduction.py",
    "tests/test_readme.py",
    "tests/test_cli.py",
    "tests/solvers/test_second_edition.py",
)
"""What is begun first, so that no process has much to do when the others have ended."""

HOW_TO_GET_ONE = (
    "no PostgreSQL: 'apt-get install postgresql' and pip install '.[postgres]' "
    "(REQUIRE_POSTGRES=1 makes this a failure)"
)


class ByService(LoadFileScheduling):
    """Files are done in one process each, and those of a folder in one whose tests share a service.

    The marks of xdist's own ``loadgroup`` would say that too, but have no effect with pytest 9.2.
    """

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.partition("::")[0]
        folder = file.rpartition("/")[0]
        return folder if folder in ONE_SERVICE else file


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def place(item: pytest.Item) -> int:
        return next((n for n, begin in enumerate(LONGEST) if item.nodeid.startswith(begin)), len(LONGEST))

    items.sort(key=place)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> ByService:
    return ByService(config, log)


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
