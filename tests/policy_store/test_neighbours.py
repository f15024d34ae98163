import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from database_probes import scalar
from sqlalchemy import select

from policy_store.database import Database
from policy_store.library import PolicyLibrary
from policy_store.tables import checkpoints
from policy_store.vector_cache import VectorCache

SPACE = "task-description-1/5x10x3"


@pytest.fixture
def url(any_database_url: str) -> str:
    return any_database_url


def test_the_nearest_source_tasks_are_found_in_order(library: PolicyLibrary, new_policy) -> None:
    for name, vector in (("a", [0, 0]), ("b", [3, 4]), ("c", [1, 0]), ("d", [0, -1])):
        library.add(new_policy(name=name, vectors={SPACE: vector}))
    library.add(new_policy(name="another space", vectors={"other": [0, 0]}))
    found = library.nearest(SPACE, [0, 0], 10)
    assert [(n.policy.name, n.distance) for n in found] == [("a", 0), ("d", 1), ("c", 1), ("b", 25)]
    assert [n.policy.name for n in library.nearest(SPACE, [3, 3], 1)] == ["b"]
    assert found[0].policy == library.get(found[0].policy.id)
    assert library.nearest("unknown", [0, 0], 3) == []


def test_neighbours_of_one_architecture(library: PolicyLibrary, new_policy) -> None:
    library.add(new_policy(name="near", vectors={SPACE: [0, 0]}))
    library.add(new_policy(name="far", vectors={SPACE: [5, 0]}, architecture="a-longer-name-than-the-first"))
    found = library.nearest(SPACE, [0, 0], 2, "a-longer-name-than-the-first")
    assert [n.policy.name for n in found] == ["far"]
    assert library.nearest(SPACE, [0, 0], 2, "unknown") == []
    assert library.nearest(SPACE, [0, 0], 2, "unknown", without="unknown") == []


def test_neighbours_without_an_architecture(library: PolicyLibrary, new_policy) -> None:
    library.add(new_policy(name="near", vectors={SPACE: [0, 0]}, architecture="one-size-1"))
    library.add(new_policy(name="far", vectors={SPACE: [5, 0]}, architecture="every-size-1"))

    def names(**which: str) -> list[str]:
        return [n.policy.name for n in library.nearest(SPACE, [0, 0], 1, **which)]

    assert names() == ["near"]
    assert names(without="one-size-1") == ["far"], "the one that is left out takes no place"
    assert names(architecture="one-size-1", without="one-size-1") == []
    assert names(architecture="every-size-1", without="one-size-1") == ["far"]


def test_another_librarys_changes_are_seen(url: str, library: PolicyLibrary, new_policy) -> None:
    """Two objects stand for two processes: each has its own cache and its own connections."""
    other_database = Database(url)
    other = PolicyLibrary(other_database)

    def names(asked: PolicyLibrary) -> list[str]:
        return [n.policy.name for n in asked.nearest(SPACE, [0, 0], 10)]

    a = library.add(new_policy(name="a", vectors={SPACE: [1, 0]}))
    assert names(library) == names(other) == ["a"]
    b = other.add(new_policy(name="b", vectors={SPACE: [2, 0]}, architecture="another-one"))
    assert names(library) == names(other) == ["a", "b"]
    library.delete(a.id)
    library.add(new_policy(name="c", vectors={SPACE: [3, 0]}))
    assert names(other) == names(library) == ["b", "c"]
    library.add(new_policy(vectors={"another space": [0]}))
    assert names(other) == ["b", "c"]
    other.delete(b.id)
    library.add(new_policy(name="b", id=b.id, vectors={SPACE: [4, 0]}))
    assert [(n.policy.name, n.distance) for n in other.nearest(SPACE, [0, 0], 10)] == [("c", 9), ("b", 16)]
    for n in other.nearest(SPACE, [0, 0], 10):
        library.delete(n.policy.id)
    assert names(other) == names(library) == []
    other_database.dispose()


def test_look_ups_during_changes_see_one_state(library: PolicyLibrary, new_policy) -> None:
    """Policies come in pairs in one transaction: no look-up may see half of a pair."""
    stop = threading.Event()
    database = library._database

    def write() -> None:
        try:
            for number in range(25):
                with database.write() as connection:
                    pair = [
                        library.add(new_policy(vectors={SPACE: [number, side]}), connection)
                        for side in (0, 1)
                    ]
                if number % 3 == 0:
                    with database.write() as connection:
                        for policy in pair:
                            library.delete(policy.id, connection)
        finally:
            stop.set()

    def read() -> int:
        looked = 0
        while not stop.is_set() or looked == 0:
            found = library.nearest(SPACE, [0, 0.5], 1000)
            assert len(found) % 2 == 0
            assert len({n.policy.id for n in found}) == len(found)
            distances = [n.distance for n in found]
            assert distances == sorted(distances)
            assert distances[::2] == distances[1::2]
            looked += 1
        return looked

    with ThreadPoolExecutor(4) as threads:
        readers = [threads.submit(read) for _ in range(3)]
        threads.submit(write).result()
        assert all(reader.result() >= 1 for reader in readers)
    assert len(library.nearest(SPACE, [0, 0], 1000)) == 2 * (25 - 9)


def test_a_transaction_older_than_the_cache_sees_its_own_state(
    library: PolicyLibrary, database: Database, new_policy
) -> None:
    cache = VectorCache()
    first = library.add(new_policy(name="a", vectors={SPACE: [1, 0]}))
    with database.read() as old:
        old.execute(select(checkpoints.c.size)).all()  # its state is that of its first query
        library.delete(first.id)
        second = library.add(new_policy(name="b", vectors={SPACE: [2, 0]}))
        with database.read() as new:
            newer = cache.get(new, SPACE)
        older = cache.get(old, SPACE)
    assert newer is not None
    assert older is not None
    assert (newer.ids, newer.matrix.tolist()) == ((second.id,), [[2.0, 0.0]])
    assert (older.ids, older.matrix.tolist()) == ((first.id,), [[1.0, 0.0]])
    with database.read() as new:
        assert cache.get(new, SPACE) is newer


def test_a_long_list_of_neighbours(library: PolicyLibrary, database: Database, new_policy) -> None:
    with database.write() as connection:
        for number in range(1100):
            library.add(new_policy(name=str(number), vectors={SPACE: [number, 0]}), connection)
    found = library.nearest(SPACE, [0, 0], 1050)
    assert [n.policy.name for n in found] == [str(number) for number in range(1050)]
    assert scalar(database, "SELECT count(*) FROM checkpoints") == 1
