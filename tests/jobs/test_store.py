"""The job table: transitions, fencing, recovery, and that no order of events finishes a job twice."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from harness import database_of, url_of
from hypothesis import given, settings
from hypothesis import strategies as st

from app.jobs.errors import InvalidCursor, failure
from app.jobs.model import Job, JobKind, JobStatus, Progress, WorkResult
from app.jobs.store import VERSION_TABLE, JobStore
from app.jobs.tables import metadata

KIND = JobKind("solve", "nowhere:solve", "interactive")
SOME = Progress(0.5, best_reward=1.5)


@pytest.fixture
def database(any_database_url):
    database = database_of(any_database_url)
    yield database
    database.dispose()


@pytest.fixture
def store(database):
    store = JobStore(database, "host:1:1:me", 3, [KIND])
    store.migrate()
    return store


def add(store: JobStore, **options: Any) -> Job:
    job, _ = store.insert(KIND, {}, **{"run_now": False, "places": 100, **options})
    return job


def test_the_migrations_make_the_tables_that_the_code_uses(store, database):
    store.migrate()
    with database.read() as connection:
        context = MigrationContext.configure(connection, opts={"version_table": VERSION_TABLE})
        differences = compare_metadata(context, metadata)
    assert differences == []


def test_a_late_result_of_a_lost_attempt_is_dropped(database):
    called = []

    def on_success(connection: sa.Connection, job: Job, work: WorkResult) -> dict[str, Any]:
        called.append(job.attempt)
        return work.result

    store = JobStore(database, "host:1:1:me", 3, [replace(KIND, on_success=on_success)])
    store.migrate()
    job = add(store)

    assert store.claim(["interactive"]).attempt == 1
    assert store.mark_crashed(job.id, 1, "its worker died", SOME).status is JobStatus.QUEUED
    late = WorkResult({"late": True}, b"late")
    assert store.succeed(job.id, 1, late, SOME) is None
    assert store.claim(["interactive"]).attempt == 2
    assert store.succeed(job.id, 1, late, SOME) is None
    assert store.fail(job.id, 1, failure("x", "y"), SOME) is None
    assert store.mark_crashed(job.id, 1, "", SOME) is None
    assert store.requeue(job.id, 1, SOME) is None
    store.save_progress([(job.id, 1, Progress(0.9))])
    running = store.get(job.id)
    assert (running.status, running.attempt, running.progress) == (JobStatus.RUNNING, 2, SOME)
    done = store.succeed(job.id, 2, WorkResult({"late": False}), SOME)
    assert done.result == {"late": False}
    assert store.succeed(job.id, 2, late, SOME) is None
    assert store.get(job.id) == done
    assert called == [2]
    assert store.artifact(job.id) is None


def test_the_queue_is_first_in_first_out_and_a_lost_job_keeps_its_place(store):
    first, second, third = (add(store) for _ in range(3))
    assert store.claim(["training"]) is None
    assert store.claim(["interactive"]).id == first.id
    assert store.claim(["interactive"]).id == second.id
    store.mark_crashed(first.id, 1, "its worker died", SOME)
    assert [store.claim(["interactive"]).id for _ in range(2)] == [first.id, third.id]
    assert store.claim(["interactive"]) is None


def test_artifacts_belong_to_their_job_alone(store):
    with_bytes, without = add(store), add(store)
    for _ in range(2):
        store.claim(["interactive"])
    assert store.succeed(with_bytes.id, 1, WorkResult({}, b"\0bytes"), SOME).has_artifact
    assert not store.succeed(without.id, 1, WorkResult({}), SOME).has_artifact
    assert [job.has_artifact for job in store.page(5, None).jobs] == [False, True]
    assert store.artifact(with_bytes.id) == b"\0bytes"


def test_the_next_start_gives_back_what_dead_owners_ran(store, database):
    mine = [add(store, run_now=True) for _ in range(3)]
    waiting = add(store)
    store.save_progress([(mine[0].id, 1, SOME)])
    store.cancel(mine[1].id)
    after = JobStore(database, "host:2:1:after", 2, [KIND])
    assert after.recover(lambda owner: True) == []
    after.recover(lambda owner: owner == "host:2:1:after")
    assert [after.get(job.id).status.value for job in (*mine, waiting)] == [
        "queued",
        "cancelled",
        "queued",
        "queued",
    ]
    assert after.get(mine[0].id).progress == SOME
    assert store.succeed(mine[0].id, 1, WorkResult({}), SOME) is None
    # A second loss is the last of two attempts.
    assert after.claim(["interactive"]).id == mine[0].id
    assert [job.status for job in after.recover(lambda owner: False)] == [JobStatus.FAILED]
    assert after.get(mine[0].id).error["code"] == "worker-lost"
    # A version without this kind of job can only fail what waits for it.
    later = JobStore(database, "host:3:1:later", 2)
    assert {job.error["code"] for job in later.recover(lambda owner: True)} == {"unknown-job-kind"}


@pytest.mark.parametrize("cursor", ["", "-1", "x", "1e3", "٣", "9" * 30])
def test_only_cursors_of_pages_are_taken(store, cursor):
    with pytest.raises(InvalidCursor):
        store.page(10, cursor)


ACTIONS = ("claim", "succeed", "fail", "crash", "requeue", "cancel", "recover", "progress")


@settings(max_examples=40)
@given(st.lists(st.tuples(st.sampled_from(ACTIONS), st.integers(0, 1), st.integers(0, 2)), max_size=25))
def test_no_order_of_events_finishes_a_job_twice(steps):
    with TemporaryDirectory() as folder:
        database = database_of(url_of(Path(folder)))
        succeeded: list[str] = []

        def on_success(connection: sa.Connection, job: Job, work: WorkResult) -> dict[str, Any]:
            succeeded.append(job.id)
            return work.result

        store = JobStore(database, "host:1:1:me", 3, [replace(KIND, on_success=on_success)])
        store.migrate()
        ids = [add(store).id for _ in range(2)]

        for action, which, back in steps:
            before = [store.get(job_id) for job_id in ids]
            job_id, attempt = ids[which], before[which].attempt - back
            match action:
                case "claim":
                    store.claim(["interactive"])
                case "succeed":
                    store.succeed(job_id, attempt, WorkResult({"by": attempt}), SOME)
                case "fail":
                    store.fail(job_id, attempt, failure("x", "y"), SOME)
                case "crash":
                    store.mark_crashed(job_id, attempt, "died", SOME)
                case "requeue":
                    store.requeue(job_id, attempt, SOME)
                case "cancel":
                    store.cancel(job_id)
                case "recover":
                    store.recover(lambda owner: False)
                case "progress":
                    store.save_progress([(job_id, attempt, Progress(0.7))])
            for old in before:
                new = store.get(old.id)
                assert new == old or not old.status.finished
                assert new.attempt - old.attempt == (
                    old.status is JobStatus.QUEUED and new.status is JobStatus.RUNNING
                )
                if new.status is JobStatus.SUCCEEDED:
                    assert new.result == {"by": new.attempt}
                assert succeeded.count(new.id) == (new.status is JobStatus.SUCCEEDED)
        database.dispose()
