"""A database of any earlier migration comes to the newest one with all that is in it."""

import json
import time
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.config import Config

import policy_store
from app.jobs.model import JobStatus, Progress
from app.jobs.store import MIGRATIONS, VERSION_TABLE, JobStore
from policy_store.database import Database

# As SQLite keeps it, and what PostgreSQL says of columns, indexes, constraints and sequences.
SCHEMA = {
    "sqlite": ["SELECT type, name, tbl_name, sql FROM sqlite_master ORDER BY type, name"],
    "postgresql": [
        "SELECT table_name, ordinal_position, column_name, column_default, is_nullable, data_type, "
        "character_maximum_length FROM information_schema.columns WHERE table_schema = 'public' "
        "ORDER BY 1, 2",
        "SELECT tablename, indexname, indexdef FROM pg_indexes WHERE schemaname = 'public' ORDER BY 2",
        "SELECT conname, contype, pg_get_constraintdef(oid) FROM pg_constraint "
        "WHERE connamespace = 'public'::regnamespace ORDER BY 1",
        "SELECT sequencename, data_type::text, max_value FROM pg_sequences ORDER BY 1",
    ],
}


def bring_to(connection, version):
    """Make the tables of a version in an empty database."""
    config = Config()
    config.set_main_option("script_location", str(Path(policy_store.__file__).parent / "migrations"))
    config.set_main_option("version_locations", str(MIGRATIONS / "versions"))
    config.set_main_option("path_separator", "newline")
    config.attributes.update(connection=connection, version_table=VERSION_TABLE)
    command.upgrade(config, version)


def schema_of(url, version):
    """Return the schema of a database that was of a version and was brought to the newest."""
    database = Database(url)
    with database.write() as connection:
        if version is not None:
            bring_to(connection, version)
    JobStore(database, "host:1:1:me", 3).migrate()
    with database.read() as connection:
        statements = SCHEMA[connection.dialect.name]
        found = [connection.execute(sa.text(statement)).all() for statement in statements]
    database.dispose()
    return found


@pytest.mark.parametrize("kind", SCHEMA)
def test_tables_are_the_same_whatever_version_they_were_of(kind, tmp_path, request):
    def new(version):
        if kind == "sqlite":
            return f"sqlite:///{tmp_path / str(version)}.db"
        return request.getfixturevalue("postgresql").new_database()

    newest = schema_of(new(None), None)
    assert "ix_jobs_unfinished" in str(newest)
    for file in MIGRATIONS.glob("versions/*.py"):
        version, _, _ = file.stem.partition("_")
        assert schema_of(new(version), version) == newest, version


def test_a_database_of_the_first_version_is_brought_forward(any_database_url):
    database = Database(any_database_url)
    with database.write() as connection:
        bring_to(connection, "0001")
        connection.execute(
            sa.text(
                "INSERT INTO jobs (id, kind, lane, status, payload, result, progress, attempt, losses, "
                "owner, cancel_requested, created_at, started_at, finished_at) VALUES ('x', 'solve', "
                "'interactive', 'succeeded', :payload, :result, :progress, 1, 0, 'me', :false, 1.5, 2.5, 3.5)"
            ),
            {
                "false": False,
                "payload": '{"a": 1}',
                "result": '{"ok": 1}',
                "progress": json.dumps(Progress(1.0, assignment=[[0, 1]]).as_json()),
            },
        )
        connection.execute(
            sa.text("INSERT INTO job_artifacts VALUES ('x', :weights)"), {"weights": b"weights"}
        )
    store = JobStore(database, "host:1:1:me", 3)

    store.migrate()

    job = store.get("x")
    assert (job.status, job.payload, job.result) == (JobStatus.SUCCEEDED, {"a": 1}, {"ok": 1})
    assert job.progress == Progress(1.0, assignment=[[0, 1]])
    assert (job.created_at.timestamp(), job.finished_at.timestamp()) == (1.5, 3.5)
    assert (job.request_id, job.key_id) == (None, None)
    assert [each.id for each in store.page(5, None, JobStatus.SUCCEEDED).jobs] == ["x"]
    assert store.artifact("x") == b"weights"
    with database.read() as connection:
        indexes = sa.inspect(connection).get_indexes("jobs")
    assert "ix_jobs_finished_at" in {index["name"] for index in indexes}
    assert store.expire(time.time() + 1, 1) == 1
    database.dispose()
