"""A database of the first migration comes to the newest one with all that is in it."""

import time

import sqlalchemy as sa
from alembic import command
from alembic.config import Config

from app.jobs.model import JobKind, Progress, WorkResult
from app.jobs.store import MIGRATIONS, VERSION_TABLE, JobStore, QueueLimit
from policy_store.database import Database


def test_a_database_of_the_first_version_is_brought_forward(any_database_url):
    database = Database(any_database_url)
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    with database.write() as connection:
        config.attributes.update(connection=connection, version_table=VERSION_TABLE)
        command.upgrade(config, "0001")
    store = JobStore(database, "host:1:1:me", 3)
    kind = JobKind("solve", "nowhere:solve", "interactive")
    claim, _ = store.insert(kind, {"a": 1}, run_now=True, limit=QueueLimit(1, 1.0))
    ended = store.succeed(claim.job.id, 1, WorkResult({"ok": 1}, b"weights"), Progress(), None)

    store.migrate()

    assert store.get(ended.id) == ended
    assert store.artifact(ended.id) == b"weights"
    with database.read() as connection:
        indexes = sa.inspect(connection).get_indexes("jobs")
    assert "ix_jobs_finished_at" in {index["name"] for index in indexes}
    assert store.expire(time.time() + 1, 1) == 1
    database.dispose()
