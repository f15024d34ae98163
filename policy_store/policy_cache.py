"""Policies in memory, those that were the nearest of some task: most requests are about the same few."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from policy_store.policy import Policy

_MOST = 128
"""Policies that are kept; one has its source task with it."""


class PolicyCache:
    """Keeps policies as long as the library does not change.

    Other processes may change the library: what is kept is used only at the revision it was read at.
    Threads may share a cache.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._revision = -1
        self._policies: dict[str, Policy] = {}

    def get(
        self, revision: int, ids: Sequence[str], read: Callable[[list[str]], dict[str, Policy]]
    ) -> list[Policy]:
        """Return policies in the order of their ids.

        Parameters
        ----------
        revision
            Of the library, as the transaction sees it that ``read`` reads in.
        ids
            Of policies that there are at this revision.
        read
            Reads those that are not kept.
        """
        with self._lock:
            kept = self._policies if self._revision == revision else {}
            found = {policy_id: kept[policy_id] for policy_id in ids if policy_id in kept}
        found |= read([policy_id for policy_id in ids if policy_id not in found])
        with self._lock:
            if revision > self._revision:
                self._revision, self._policies = revision, {}
            if revision == self._revision and len(found) <= _MOST:
                together = self._policies | found
                self._policies = together if len(together) <= _MOST else found
        return [found[policy_id] for policy_id in ids]
