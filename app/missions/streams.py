"""The history of missions as it grows, told to all listeners in this process."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import AsyncGenerator, Awaitable, Callable
from dataclasses import dataclass
from weakref import WeakValueDictionary

from app.jobs.clock import wait_for
from app.missions.model import Entry
from app.missions.store import MissionStore

# Events that are told from memory; a listener that is further behind gets them from the table.
_REMEMBERED = 256
_READ_AT_ONCE = 100
# Where another service may write, the table is looked at as often; elsewhere in case something was missed.
_LOOK_AGAIN_S = {True: 0.5, False: 5.0}


@dataclass(frozen=True, slots=True)
class Told:
    """An event as a stream has it: its number, its type, and all of it as JSON."""

    number: int
    type: str
    text: str

    @classmethod
    def of(cls, entry: Entry) -> Told:
        """Write an event down, once however many listen."""
        return cls(entry.number, entry.type, json.dumps(entry.to_record()))


class _Growth:
    """The newest events of one mission, as long as there is a listener.

    Attributes
    ----------
    changed
        Set at the next change, and then replaced: take it before looking, wait for it after.
    looks
        How often it was said that there may be more in the table than is remembered.
    """

    def __init__(self) -> None:
        self.changed = asyncio.Event()
        self.looks = 0
        self._newest: deque[Told] = deque(maxlen=_REMEMBERED)

    def add(self, told: Told) -> None:
        """Tell of an event."""
        if self._newest and told.number != self._newest[-1].number + 1:
            self._newest.clear()
        self._newest.append(told)
        self._wake()

    def wake(self) -> None:
        """Let all listeners look at the table."""
        self.looks += 1
        self._wake()

    def _wake(self) -> None:
        self.changed.set()
        self.changed = asyncio.Event()

    def since(self, after: int) -> list[Told] | None:
        """Return the events after a number; None if not all of them are remembered."""
        if not self._newest or after + 1 < self._newest[0].number:
            return None
        return [told for told in self._newest if told.number > after]


class MissionStreams:
    """The streams of all missions.

    Parameters
    ----------
    store
        The tables.
    """

    def __init__(self, store: MissionStore) -> None:
        self._store = store
        self._look_again_s = _LOOK_AGAIN_S[store.database.shared]
        self._growing: WeakValueDictionary[str, _Growth] = WeakValueDictionary()
        self._stopped = False

    def tell(self, mission_id: str, entry: Entry) -> None:
        """Tell of an event that was committed here."""
        if (growth := self._growing.get(mission_id)) is not None:
            growth.add(Told.of(entry))

    def wake(self, mission_id: str) -> None:
        """Let the listeners of a mission look at the table."""
        if (growth := self._growing.get(mission_id)) is not None:
            growth.wake()

    def stop(self) -> None:
        """End all streams."""
        self._stopped = True
        for growth in list(self._growing.values()):
            growth.wake()

    async def listen(
        self, mission_id: str, after: int, allowed: Callable[[], Awaitable[bool]] | None = None
    ) -> AsyncGenerator[Told]:
        """Yield a mission's events with numbers larger than ``after``, and go on as it grows.

        Ends at :meth:`stop`, when the mission is deleted, or when the listener may not have it any more.

        Parameters
        ----------
        mission_id
            The mission.
        after
            Number of the last event that was seen; 0: none.
        allowed
            Asked before what is told whether the listener still may have it; None: yes.

        Raises
        ------
        MissionNotFound
            If there is no such mission, or it is deleted meanwhile.
        """
        growth = self._growing.get(mission_id)
        if growth is None:
            growth = self._growing[mission_id] = _Growth()
        due, looked = True, growth.looks
        while True:
            changed, looks = growth.changed, growth.looks
            news = growth.since(after)
            if news is None or (not news and (due or looks != looked)):
                due, looked = False, looks
                entries = await asyncio.to_thread(self._store.entries, mission_id, after, _READ_AT_ONCE)
                news = [Told.of(entry) for entry in entries]
            if allowed is not None and not await allowed():
                return
            for told in news:
                after = told.number
                yield told
            if self._stopped:
                return
            if not news:
                await wait_for(changed, self._look_again_s)
                due = not changed.is_set()
