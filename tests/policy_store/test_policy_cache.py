"""What is kept of the library in memory, and when it is not used any more."""

import pytest

from policy_store import policy_cache
from policy_store.policy_cache import PolicyCache


@pytest.fixture
def reading():
    """What was read, and a reader that gives each id a policy of its own at each reading."""
    read = []

    def reader(ids):
        read.append(list(ids))
        return {policy_id: f"{policy_id} at {len(read)}" for policy_id in ids}

    return read, reader


def test_only_what_is_missing_is_read_and_the_order_is_that_of_the_ids(reading):
    read, reader = reading
    cache = PolicyCache()
    assert cache.get(7, ["a", "b"], reader) == ["a at 1", "b at 1"]
    assert cache.get(7, ["c", "b", "a"], reader) == ["c at 2", "b at 1", "a at 1"]
    assert read == [["a", "b"], ["c"]]


def test_nothing_is_used_at_another_revision(reading):
    _, reader = reading
    cache = PolicyCache()
    cache.get(7, ["a"], reader)
    assert cache.get(8, ["a"], reader) == ["a at 2"]
    assert cache.get(7, ["a"], reader) == ["a at 3"]  # a transaction older than the cache
    assert cache.get(8, ["a"], reader) == ["a at 2"]


def test_it_does_not_grow_without_bound(reading, monkeypatch):
    monkeypatch.setattr(policy_cache, "_MOST", 2)
    _, reader = reading
    cache = PolicyCache()
    cache.get(1, ["a", "b"], reader)
    cache.get(1, ["c"], reader)
    assert cache.get(1, ["a"], reader) == ["a at 3"]
    assert cache.get(1, ["d", "e", "f"], reader) == ["d at 4", "e at 4", "f at 4"]
    assert cache.get(1, ["d"], reader) == ["d at 5"]


def test_a_policy_of_the_same_id_is_another_after_it_was_deleted(library, new_policy):
    space = "task-description-1/5x10x3"
    library.add(new_policy(id="one", name="before"))
    assert library.nearest(space, [1.0, 0.0], 1)[0].policy.name == "before"
    library.delete("one")
    library.add(new_policy(id="one", name="after"))
    assert library.nearest(space, [1.0, 0.0], 1)[0].policy.name == "after"
