"""A database of the first migration comes to the newest one with all that is in it."""

import json
import time

import sqlalchemy as sa
from alembic import command
from alembic.config import Config

from app.jobs.model import JobStatus, Progress
from app.jobs.store import MIGRATIONS, VERSION_TABLE, JobStore
from policy_store.database import Database


def test_a_database_of_the_first_version_is_brought_forward(any_database_url):
    database = Database(any_database_url)
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    with database.write() as connection:
        config.attributes.update(connection=connection, version_table=VERSION_TABLE)
        command.upgrade(config, "0001")
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
