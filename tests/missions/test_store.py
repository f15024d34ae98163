"""The tables of missions: an event and its state are one, numbers have no gaps, ids are kept once."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext

from app.jobs import stored_json
from app.jobs.errors import IdempotencyMismatch
from app.jobs.model import Idempotency
from app.missions.errors import EventReused, MissionNotFound
from app.missions.model import Judged, Planning, ProposalStatus, Sent
from app.missions.store import VERSION_TABLE, MissionStore, Moved, newest_of
from app.missions.tables import events, metadata
from policy_store.database import Database

PLANNING = Planning("greedy", {}, 1, 0.5, "proposed")
PROBLEM = {"uavs": [{"id": "uav-1"}], "matrices": {"m": {"distance": [[0.0]]}}}


@pytest.fixture
def store(any_database_url):
    database = Database(any_database_url, stored_json.write, stored_json.read)
    store = MissionStore(database)
    store.migrate()
    yield store
    database.dispose()


@pytest.fixture
def mission(store):
    return store.create("a town", PROBLEM, PLANNING, state(0.0), {"n": 0})[0].id


def state(clock):
    return {"clock": clock, "problem": {"uavs": [{"id": "uav-1"}]}, "done": []}


def sent(event_id, at=1.0, digest="d", type_="clock", **body):
    return Sent(event_id, digest, type_, at, {"type": type_, **body})


def judged(at, wants_plan=False, closes=None):
    return Judged(state(at), {"at": at}, {"flyable": True}, wants_plan, closes)


def content(gained=1.0):
    return {"reward": 2.0, "gained": gained, "differences": {}, "done": 0}


def test_the_migrations_make_the_tables_that_the_code_uses(store):
    store.migrate()
    with store.database.read() as connection:
        context = MigrationContext.configure(connection, opts={"version_table": VERSION_TABLE})
        assert compare_metadata(context, metadata) == []


def test_an_event_is_kept_with_its_state(store, mission):
    entry, new = store.commit(mission, 1, sent("a", 1.0), judged(1.0, wants_plan=True))
    assert (entry.number, entry.id, new) == (2, "a", True)
    head = store.head(mission)
    assert (head.state, head.plan) == (state(1.0), {"at": 1.0})
    assert (head.mission.clock, head.mission.last_number, head.mission.wanted) == (1.0, 2, 2)
    assert head.matrices == PROBLEM["matrices"]
    assert store.problem(mission) == PROBLEM
    assert store.state_at(mission, 0.5) == (1, state(0.0))
    assert store.state_at(mission, 1.0) == store.state_after(mission, 7) == (2, state(1.0))
    assert store.states(mission) == {1: state(0.0), 2: state(1.0)}
    assert [each.type for each in store.entries(mission, 0, 10)] == ["begun", "clock"]
    assert store.entries(mission, 1, 10) == [entry]


def test_what_was_judged_of_another_state_is_not_kept(store, mission):
    store.commit(mission, 1, sent("a"), judged(1.0))
    with pytest.raises(Moved):
        store.commit(mission, 1, sent("b"), judged(2.0))
    assert store.get(mission).last_number == 2


def test_an_id_that_comes_again_is_the_same_event_or_refused(store, mission):
    first, _ = store.commit(mission, 1, sent("a"), judged(1.0))
    assert store.commit(mission, 1, sent("a"), judged(1.0)) == (first, False)
    with pytest.raises(EventReused, match="number 2"):
        store.commit(mission, 2, sent("a", digest="other"), judged(1.0))
    other, _ = store.create(None, PROBLEM, PLANNING, state(0.0), {})
    assert store.commit(other.id, 1, sent("a", digest="other"), judged(1.0))[1]


def test_a_key_that_comes_again_is_the_same_mission_or_refused(store):
    def create(key, body_hash, client="client"):
        return store.create("once", PROBLEM, PLANNING, state(0.0), {}, Idempotency(client, key, body_hash))

    first, new = create("k1", "hash-1")
    assert new
    assert store.begun_with(Idempotency("client", "k1", "hash-1")) == first
    store.commit(first.id, 1, sent("a"), judged(1.0))
    assert create("k1", "hash-1") == (store.get(first.id), False)
    for look in (store.begun_with, lambda other: create(other.key, other.body_hash)):
        with pytest.raises(
            IdempotencyMismatch, match=f"'k1' was used with another body, for mission '{first.id}'"
        ):
            look(Idempotency("client", "k1", "hash-2"))
    assert create("k1", "hash-2", client="another client")[1]
    assert create("k2", "hash-1")[1]
    assert len(store.page(10, None)[0]) == 3
    # It goes with its mission, and begins another one then.
    store.delete(first.id)
    assert store.begun_with(Idempotency("client", "k1", "hash-2")) is None
    assert create("k1", "hash-2")[1]


def test_of_tries_at_the_same_time_one_begins_a_mission(store):
    tries = 4
    together, key = threading.Barrier(tries), Idempotency("client", "k", "hash")

    def create(_):
        together.wait()
        return store.create("once", PROBLEM, PLANNING, state(0.0), {}, key)

    with ThreadPoolExecutor(tries) as threads:
        made = list(threads.map(create, range(tries)))

    assert sorted(new for _, new in made) == [False, False, False, True]
    assert len({mission.id for mission, _ in made}) == 1


def test_positions_make_no_state_and_newer_ones_count(store, mission):
    def seen(*times):
        return [{"uav_id": "uav-1", "time": time, "x": time, "y": 0.0} for time in times]

    def see(event_id, batch):
        event = sent(event_id, type_="telemetry", positions=batch)
        return store.commit_positions(mission, 1, event, newest_of(batch))

    first, _ = see("a", seen(1.0, 3.0, 2.0))
    assert (first.number, first.outcome) == (2, {"passed_over": 2})
    assert see("a", seen(1.0, 3.0, 2.0)) == (first, False)
    assert see("b", seen(2.5))[0].outcome == {"passed_over": 1}
    head = store.head(mission)
    assert (head.mission.last_number, head.mission.state_number) == (3, 1)
    assert head.new_positions == {"uav-1": {"time": 3.0, "x": 3.0, "y": 0.0}}
    store.commit(mission, 3, sent("c", 3.0), judged(3.0))
    head = store.head(mission)
    assert head.new_positions == {}
    assert head.positions["uav-1"]["number"] == 2
    with pytest.raises(Moved):
        see("d", seen(9.0))
    assert store.states(mission).keys() == {1, 4}


def test_a_proposal_is_open_until_it_is_closed_or_another_plan_is_wanted(store, mission):
    def propose(of_number, gained=1.0):
        with store.database.write() as connection:
            return store.propose(connection, mission, of_number, "job", content(gained))

    assert store.wanting() == [mission]
    assert propose(1) == 2
    assert store.wanting() == [mission]
    assert [each.status for each in store.proposals(mission)] == [ProposalStatus.OPEN]
    accepted = sent("a", type_="proposal_accepted")
    store.commit(mission, 2, accepted, judged(1.0, closes=(2, ProposalStatus.ACCEPTED)))
    assert store.proposal(mission, 2).status is ProposalStatus.ACCEPTED
    assert store.wanting() == []
    store.commit(mission, 3, sent("b"), judged(1.5, wants_plan=True))
    # One of before is not proposed, nor one that gains nothing.
    assert propose(1) is None
    assert store.get(mission).wants_plan
    assert propose(4, gained=0.0) is None
    assert not store.get(mission).wants_plan
    store.commit(mission, 4, sent("c"), judged(1.6, wants_plan=True))
    assert propose(5) == 6
    store.commit(mission, 6, sent("d"), judged(1.7, wants_plan=True))
    assert store.proposal(mission, 6).status is ProposalStatus.OUTDATED
    assert store.proposal(mission, 99) is None


def test_a_mission_is_deleted_with_all_that_is_kept_of_it(store, mission):
    store.delete(mission)
    with pytest.raises(MissionNotFound):
        store.get(mission)
    with store.database.read() as connection:
        for table in metadata.sorted_tables:
            assert connection.execute(table.select()).all() == []
    with store.database.write() as connection:
        assert store.propose(connection, mission, 1, "job", content()) is None


def test_missions_in_which_nothing_happens_any_more_are_deleted(store, mission):
    busy = store.create("another", PROBLEM, PLANNING, state(0.0), {})[0].id
    with store.database.write() as connection:
        connection.execute(sa.update(events).values(recorded_at=100.0))
    store.commit(busy, 1, sent("a"), judged(1.0))
    assert store.expire(100.0, 10) == []
    assert store.expire(100.5, 10) == [mission]
    assert [each.id for each in store.page(10, None)[0]] == [busy]
    with store.database.read() as connection:
        assert set(connection.scalars(sa.select(events.c.mission_id))) == {busy}
    assert store.expire(100.5, 10) == []
