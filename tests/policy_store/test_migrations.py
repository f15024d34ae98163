import json
import sys
import textwrap
import threading
import types
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from database_probes import scalar, start
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from policy_store.database import Database
from policy_store.errors import MigrationFailed
from policy_store.library import PolicyLibrary
from policy_store.tables import metadata


def test_migrations_make_the_tables_that_the_program_uses(database: Database) -> None:
    library = PolicyLibrary(database)
    library.migrate()
    library.migrate()
    assert scalar(database, "SELECT version_num FROM alembic_version_library") == "0002"
    assert scalar(database, "SELECT revision FROM library_revision") == 0
    with database.read() as connection:
        context = MigrationContext.configure(
            connection, opts={"version_table": "alembic_version_library", "compare_type": True}
        )
        assert compare_metadata(context, metadata) == []


def test_processes_that_migrate_at_once_all_succeed(url: str) -> None:
    program = """
        import sys
        from policy_store.database import Database
        from policy_store.library import PolicyLibrary
        library = PolicyLibrary(Database(sys.argv[1]))
        print("ready", flush=True)
        sys.stdin.readline()
        library.migrate()
        print(library.count())
    """
    processes = [start(program, url) for _ in range(3)]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    assert [process.communicate(timeout=60) for process in processes] == [("0\n", "")] * 3


@pytest.mark.parametrize("files", [1, 6])
def test_threads_that_migrate_at_once_all_succeed(tmp_path: Path, files: int) -> None:
    databases = [Database(f"sqlite:///{tmp_path / str(number % files)}.db") for number in range(6)]
    barrier = threading.Barrier(len(databases))

    def migrate(database: Database) -> int:
        library = PolicyLibrary(database)
        barrier.wait()
        library.migrate()
        return library.count()

    with ThreadPoolExecutor(len(databases)) as threads:
        assert list(threads.map(migrate, databases)) == [0] * 6
    for database in databases:
        database.dispose()


def write_migrations(folder: Path, *bodies: str) -> Path:
    """Write an Alembic folder whose upgrades have the given bodies."""
    (folder / "versions").mkdir(parents=True)
    for number, body in enumerate(bodies, start=1):
        before = json.dumps(str(number - 1)) if number > 1 else "None"
        (folder / "versions" / f"{number}.py").write_text(
            "import sqlalchemy as sa\nfrom alembic import op\n"
            f"revision = '{number}'\ndown_revision = {before}\n"
            f"def upgrade():\n{textwrap.indent(textwrap.dedent(body), '    ')}\n"
        )
    return folder


def test_migrations_of_two_databases_take_turns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Alembic's environment is global in a process: a second migration would take the first one's."""
    meeting = types.SimpleNamespace(
        barrier=threading.Barrier(2), met=False, error=threading.BrokenBarrierError
    )
    monkeypatch.setitem(sys.modules, "meeting", meeting)
    body = """
        import meeting
        try:
            meeting.barrier.wait(0.3)
            meeting.met = True
        except meeting.error:
            op.execute("CREATE TABLE a (x INTEGER)")
    """
    folder = write_migrations(tmp_path / "other", body)
    databases = [Database(f"sqlite:///{tmp_path}/{number}.db") for number in range(2)]
    with ThreadPoolExecutor(2) as threads:
        for done in [threads.submit(each.migrate, folder, "version_other") for each in databases]:
            done.result()
    assert not meeting.met
    for each in databases:
        assert scalar(each, "SELECT count(*) FROM a") == 0
        each.dispose()


def test_a_migration_that_fails_leaves_everything_as_it_was(database: Database, tmp_path: Path) -> None:
    folder = write_migrations(
        tmp_path / "50%",
        "op.execute('CREATE TABLE a (x INTEGER)')",
        "op.execute('INSERT INTO nowhere VALUES (1)')",
    )
    with pytest.raises(OperationalError, match="nowhere"):
        database.migrate(folder, "version_other")
    assert scalar(database, "SELECT count(*) FROM sqlite_master") == 0


def test_rooms_migrate_side_by_side(library: PolicyLibrary, database: Database, tmp_path: Path) -> None:
    folder = write_migrations(tmp_path / "other", "op.execute('CREATE TABLE a (x INTEGER)')")
    database.migrate(folder, "version_other")
    assert scalar(database, "SELECT version_num FROM version_other") == "1"
    assert scalar(database, "SELECT version_num FROM alembic_version_library") == "0002"


def test_a_database_of_a_newer_program_is_refused(database: Database, tmp_path: Path) -> None:
    newer = write_migrations(tmp_path / "newer", "pass", "pass")
    older = write_migrations(tmp_path / "older", "pass")
    database.migrate(newer, "version_other")
    with pytest.raises(MigrationFailed, match=r"'2'.*newer version of this program"):
        database.migrate(older, "version_other")


PARENT_AND_CHILD = """
    op.execute("CREATE TABLE parent (id INTEGER PRIMARY KEY, name TEXT)")
    op.execute("CREATE TABLE child (parent_id INTEGER REFERENCES parent (id) ON DELETE CASCADE)")
    op.execute("INSERT INTO parent VALUES (1, 'a')")
    op.execute("INSERT INTO child VALUES (1)")
"""


def test_rebuilding_a_table_keeps_the_rows_that_refer_to_it(database: Database, tmp_path: Path) -> None:
    rebuild = """
        with op.batch_alter_table("parent", recreate="always") as batch:
            batch.alter_column("name", nullable=True, type_=sa.String(20))
    """
    database.migrate(write_migrations(tmp_path / "other", PARENT_AND_CHILD, rebuild), "version_other")
    assert scalar(database, "SELECT count(*) FROM child") == 1
    with database.write() as connection:
        connection.execute(text("DELETE FROM parent"))
    assert scalar(database, "SELECT count(*) FROM child") == 0


def test_a_migration_that_breaks_references_is_undone(database: Database, tmp_path: Path) -> None:
    folder = write_migrations(tmp_path / "other", PARENT_AND_CHILD)
    database.migrate(folder, "version_other")
    breaking = write_migrations(tmp_path / "breaking", PARENT_AND_CHILD, "op.execute('DELETE FROM parent')")
    with pytest.raises(MigrationFailed, match="child refers to a missing row of parent"):
        database.migrate(breaking, "version_other")
    assert scalar(database, "SELECT count(*) FROM parent") == 1
    assert scalar(database, "SELECT version_num FROM version_other") == "1"
