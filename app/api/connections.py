"""What a connection may take of the server: a descriptor, and its turn on the event loop.

A client needs no key to open connections and to send what is refused. So a server holds fewer connections
than it has descriptors, and makes room by closing one that has not sent a whole request; what arrives in tiny
chunks is read a little at a time; and what follows a refusal is not read at all.
"""

from __future__ import annotations

import asyncio
import logging
import resource
import weakref
from collections import deque
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from app.api.problem_details import problem_response
from app.api.security_headers import SECURITY_HEADERS

_MOST_DESCRIPTORS = 65_536
MOST_CONNECTIONS = 4_096
"""More than that many clients are not served by one machine; each may have sent 64 KB of a header."""

_KEPT_SHARE, _KEPT_FEWEST, _FEWEST_CONNECTIONS = 4, 64, 8
_CHUNKS_A_TURN = 32
_TURNS_S = 0.002
_LINGER_S = 1.0
_TOLD_EVERY_S = 10.0

_log = logging.getLogger(__name__)


def raise_descriptor_limit() -> None:
    """Let this process open as many files as the system lets it, up to a number that is always enough."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _MOST_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, _MOST_DESCRIPTORS)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def connection_limit(descriptors: int) -> int:
    """Return how many connections a process may hold; the other descriptors are for its files and workers."""
    kept = max(descriptors // _KEPT_SHARE, _KEPT_FEWEST)
    return max(_FEWEST_CONNECTIONS, min(MOST_CONNECTIONS, descriptors - kept))


class Connections:
    """The connections of one server.

    Attributes
    ----------
    limit
        How many there may be.
    made_room
        How many were closed for others.
    """

    def __init__(self) -> None:
        soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        self.limit = MOST_CONNECTIONS if soft == resource.RLIM_INFINITY else connection_limit(soft)
        self.made_room = 0
        self._told_at = float("-inf")
        # In the order in which they began to wait for their client.
        self._receiving: dict[BoundedProtocol, None] = {}
        self._turns: deque[BoundedProtocol] = deque()

    def came(self, protocol: BoundedProtocol, count: int) -> None:
        """Take in a connection, the last of so many; where they are too many, one of them is closed."""
        self._receiving[protocol] = None
        if count <= self.limit:
            return
        self.made_room += 1
        # The oldest that waits for its client: among those is the one that has just come.
        next(iter(self._receiving)).abort()
        now = protocol.loop.time()
        if now - self._told_at >= _TOLD_EVERY_S:
            self._told_at = now
            _log.warning(
                "there are %d connections, as many as may be: those that send no request are closed",
                self.limit,
                extra={"closed": self.made_room},
            )

    def receives(self, protocol: BoundedProtocol, now: bool) -> None:
        """Note whether a connection waits for its client."""
        if now:
            self._receiving.setdefault(protocol)
        else:
            self._receiving.pop(protocol, None)

    def went(self, protocol: BoundedProtocol) -> None:
        """Forget a connection."""
        self._receiving.pop(protocol, None)

    def take_turn(self, protocol: BoundedProtocol) -> None:
        """Let a connection go on with what it has received when others have had their turn."""
        if not self._turns:
            protocol.loop.call_soon(self._take_turns, protocol.loop)
        self._turns.append(protocol)

    def _take_turns(self, loop: asyncio.AbstractEventLoop) -> None:
        end = loop.time() + _TURNS_S
        left = len(self._turns)
        while left and loop.time() < end:
            left -= 1
            self._turns.popleft().go_on()
        if self._turns:
            loop.call_soon(self._take_turns, loop)


_of_server: weakref.WeakKeyDictionary[ServerState, Connections] = weakref.WeakKeyDictionary()


class _Patient(h11.Connection):
    """A connection that says it needs more data when it has given out a turn's share of chunks.

    Attributes
    ----------
    share
        Chunks of a body that it still gives out; what is left of the data waits for the next turn.
    """

    share = _CHUNKS_A_TURN

    def next_event(self) -> Any:
        """Return the next event, as the base class does."""
        if self.their_state is h11.SEND_BODY:
            if self.share == 0:
                return h11.NEED_DATA
            self.share -= 1
        return super().next_event()


class _KeptOpen:
    """A transport that the protocol closes later: at once, a client that still sends loses its answer."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def close(self) -> None:
        """Leave it open."""


class BoundedProtocol(H11Protocol):
    """HTTP/1.1 on a connection that leaves room for others."""

    conn: _Patient

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        size = self.conn._max_incomplete_event_size
        self.conn = _Patient(h11.SERVER, size)
        self._application, self.app = self.app, self._serve
        self._all = _of_server.setdefault(self.server_state, Connections())
        self._has_turn = self._deaf = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Take a place, somebody else's if there is none."""
        super().connection_made(transport)
        self._all.came(self, len(self.connections))

    def connection_lost(self, exc: Exception | None) -> None:
        """Give the place back."""
        self._all.went(self)
        super().connection_lost(exc)

    def abort(self) -> None:
        """Close the connection at once."""
        self.transport.abort()

    def data_received(self, data: bytes) -> None:
        """Read what has come, or as much of it as makes a turn."""
        if self._deaf:
            return
        if self._has_turn:
            # Read before it could be held back.
            self.conn.receive_data(data)
            self.transport.pause_reading()
            return
        self.conn.share = _CHUNKS_A_TURN
        super().data_received(data)

    def go_on(self) -> None:
        """Read on where the last turn has ended."""
        self._has_turn = False
        if self._deaf or self.transport.is_closing():
            return
        self.conn.share = _CHUNKS_A_TURN
        self.handle_events()
        if not self._has_turn and not self.flow.read_paused:
            self.transport.resume_reading()

    def handle_events(self) -> None:
        """Handle what has come whole; what is left of a turn's share waits for the next."""
        super().handle_events()
        if self.transport.is_closing():
            return
        if self.conn.share == 0 and self.conn.their_state is h11.SEND_BODY and not self._has_turn:
            self._has_turn = True
            self.transport.pause_reading()
            self._all.take_turn(self)
        self._all.receives(self, not self._works())

    def on_response_complete(self) -> None:
        """Go on with the next request; a client that still sends the body of this one is not heard."""
        last = self.conn.their_state is h11.SEND_BODY or self.conn.our_state is h11.CLOSED
        super().on_response_complete()
        if self.transport.is_closing():
            return
        if last:
            self._end()
        else:
            self._all.receives(self, not self._works())

    def _works(self) -> bool:
        """Say whether a request has come whole and is not answered."""
        whole = self.conn.their_state not in (h11.IDLE, h11.SEND_BODY)
        return whole and self.cycle is not None and not self.cycle.response_complete

    def _end(self) -> None:
        """Close the connection after its answer, with time for the client to read it.

        What still comes is thrown away unread; closed at once, the system would throw away the answer too.
        """
        self._deaf = True
        self._unset_keepalive_if_required()
        if self.transport.can_write_eof():
            self.transport.write_eof()
        self.loop.call_later(_LINGER_S, self.transport.close)

    async def _serve(self, scope: Any, receive: Any, send: Any) -> None:
        """Let the application answer, but for requests whose length is given in two ways (RFC 9112, 6.1)."""

        async def send_on(message: Any) -> None:
            if message["type"] == "http.response.start" and self.conn.their_state is h11.SEND_BODY:
                # The client has to know that no other request is taken (RFC 9112, 9.6).
                message = {**message, "headers": [*message["headers"], (b"connection", b"close")]}
                kept_open = _KeptOpen(self.transport)
                self.cycle.transport = kept_open  # type: ignore[assignment]  # it hands all else on
            await send(message)

        names = {name for name, _ in scope["headers"]}
        if not {b"content-length", b"transfer-encoding"} <= names:
            await self._application(scope, receive, send_on)
            return
        refusal = problem_response(
            "bad-request",
            "the request has both Content-Length and Transfer-Encoding",
            scope["path"],
            headers={**SECURITY_HEADERS, "Connection": "close"},
        )
        await refusal(scope, receive, send_on)
