"""Short messages between the processes that share a PostgreSQL database, by LISTEN and NOTIFY.

A message is a hint to look at a table, never the truth: one that is told while the server is away is lost,
and whoever listens is told that it may have missed some. It goes out over a connection of its own, after what
it speaks of was committed: a NOTIFY inside a writing transaction would make all commits of the database take
turns.
"""

from __future__ import annotations

import logging
import queue
import secrets
import threading
from collections.abc import Callable
from contextlib import closing
from typing import TYPE_CHECKING

from sqlalchemy import URL

from policy_store.postgresql import connect

if TYPE_CHECKING:
    import psycopg

_LOOK_S, _PAUSE_S = 0.2, 0.5
_AT_ONCE, _MOST_WAITING = 200, 20_000

_log = logging.getLogger(__name__)


class Announcements:
    """Sends messages on a channel, and hears those of others.

    Parameters
    ----------
    url
        Of a PostgreSQL database; two connections are made that no pool counts.
    channel
        Lower-case letters and underscores.
    heard
        Called in a thread with every message of another object, and with None after a time without
        connection, in which messages may have been lost.
    """

    def __init__(self, url: URL, channel: str, heard: Callable[[str | None], None]) -> None:
        self._url = url
        self._channel = channel
        self._heard = heard
        self._me = secrets.token_hex(6)
        self._outbox: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._unsent: list[str] = []
        self._closing = threading.Event()
        self._threads = [
            threading.Thread(target=self._keep, args=(work,), name=f"announce-{work.__name__}", daemon=True)
            for work in (self._listen, self._send)
        ]
        for thread in self._threads:
            thread.start()

    def tell(self, message: str) -> None:
        """Send a message soon, in the order of the calls; never blocks. At most some thousand bytes."""
        if self._outbox.qsize() < _MOST_WAITING:
            self._outbox.put(message)

    def close(self) -> None:
        """Send what was told, if the server is there, and end."""
        self._closing.set()
        self._outbox.put(None)
        for thread in self._threads:
            thread.join()

    def _keep(self, work: Callable[[psycopg.Connection], None]) -> None:
        """Do the work over a connection, and again over a new one when it is cut."""
        while True:
            try:
                with closing(connect(self._url)) as connection:
                    work(connection)
            except Exception as error:
                _log.warning("no connection for announcements: %s", error)
                self._closing.wait(_PAUSE_S)
            if self._closing.is_set():
                return

    def _listen(self, connection: psycopg.Connection) -> None:
        connection.execute(f"LISTEN {self._channel}".encode())
        self._heard(None)
        while not self._closing.is_set():
            for notice in connection.notifies(timeout=_LOOK_S):
                sender, _, message = notice.payload.partition(" ")
                if sender != self._me:
                    self._heard(message)

    def _send(self, connection: psycopg.Connection) -> None:
        while True:
            # What a cut connection kept from being sent is sent over the next one.
            while not self._unsent or not (self._outbox.empty() or len(self._unsent) >= _AT_ONCE):
                message = self._outbox.get()
                if message is None:
                    break
                self._unsent.append(f"{self._me} {message}")
            if self._unsent:
                connection.execute(
                    "SELECT pg_notify(%s, message) FROM unnest(%s::text[]) AS message",
                    (self._channel, self._unsent),
                )
                self._unsent = []
            if self._closing.is_set() and self._outbox.empty():
                return
