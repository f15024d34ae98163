"""What the server lacks for clients that do not play by the rules: a deadline, and problem details.

A client that sends its request byte by byte, or nothing at all, would hold its connection for ever, and so
would one that takes nothing of its answer. An answer may take as long as it likes to be made, and a reader
that takes it bit by bit is waited for; a connection that rests between two requests is the keep-alive
timer's. What is no HTTP at all is answered like every other error.
"""

from __future__ import annotations

import asyncio
import fcntl
import termios
import uuid
from array import array
from contextlib import suppress
from http import HTTPStatus
from typing import Any

import h11
from structlog.contextvars import bound_contextvars

from app.api.connections import BoundedProtocol
from app.api.problem_details import problem_response
from app.api.security_headers import SECURITY_HEADERS
from app.domain.said import said


def protocol_with_deadline(seconds: float) -> type[BoundedProtocol]:
    """Return a protocol class for ``uvicorn.Config(http=…)``.

    Parameters
    ----------
    seconds
        From the opening of the connection, or from the first byte of a later request, to its last byte. Who
        has sent a part by then gets 408, who has sent nothing is not answered; both are closed. So is who
        has taken nothing, for as long, of an answer that waits to be sent.
    """

    class DeadlineProtocol(_DeadlineProtocol):
        receive_timeout_s = seconds

    return DeadlineProtocol


class _DeadlineProtocol(BoundedProtocol):
    receive_timeout_s: float

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._deadline: asyncio.TimerHandle | None = None
        self._reading: asyncio.TimerHandle | None = None
        # Of a request that is refused before the application has it; its connection ends with it.
        self._refused_id = uuid.uuid4().hex

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        super().connection_made(transport)
        self._arm()

    def connection_lost(self, exc: Exception | None) -> None:
        self._disarm()
        self._let_reader()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        super().pause_writing()
        self._watch_reader()

    def resume_writing(self) -> None:
        super().resume_writing()
        self._let_reader()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._watch_reader()

    def _watch_reader(self) -> None:
        """Begin to see that what waits to be sent becomes less, until there is none."""
        if self.transport.get_write_buffer_size() and self._reading is None:
            self._reading = self.loop.call_later(
                self.receive_timeout_s, self._look_at_reader, self._untaken()
            )

    def _let_reader(self) -> None:
        if self._reading is not None:
            self._reading.cancel()
            self._reading = None

    def _untaken(self) -> int:
        """Return how many bytes of answers the client has not taken, those in the system's queue included."""
        queued = array("i", [0])
        with suppress(OSError):  # not every system says
            fcntl.ioctl(self.transport.get_extra_info("socket").fileno(), termios.TIOCOUTQ, queued)
        return self.transport.get_write_buffer_size() + queued[0]

    def _look_at_reader(self, before: int) -> None:
        self._reading = None
        if self._untaken() < before:
            self._watch_reader()
            return
        with bound_contextvars(request_id=self._refused_id):
            self.logger.info("nothing of an answer was taken within %g s", self.receive_timeout_s)
        self.transport.abort()

    def shutdown(self) -> None:
        # A request that has not arrived would wait for the server's end; all others are answered.
        if self._receives():
            self._refuse("draining", "the service is stopping")
        else:
            super().shutdown()

    def handle_events(self) -> None:
        # What the server logs here is of a request that it refuses; others get the id of their own.
        with bound_contextvars(request_id=self._refused_id):
            super().handle_events()
        if self._receives():
            self._arm()
        else:
            self._disarm()

    def _receives(self) -> bool:
        """Say whether a request has begun to arrive and has not ended."""
        if self.transport.is_closing():
            return False
        state = self.conn.their_state
        return state is h11.SEND_BODY or (state is h11.IDLE and bool(self.conn.trailing_data[0]))

    def _arm(self) -> None:
        if self._deadline is None:
            self._deadline = self.loop.call_later(self.receive_timeout_s, self._expire)

    def _disarm(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _expire(self) -> None:
        self._deadline = None
        if self.transport.is_closing():
            return
        with bound_contextvars(request_id=self._refused_id):
            self.logger.info("a request was not received within %g s", self.receive_timeout_s)
        if self._receives():
            self._refuse(
                "request-timeout",
                said("the request was not received within {seconds} s", seconds=self.receive_timeout_s),
            )
        else:
            self.transport.close()

    def _refuse(self, code: str, detail: str) -> None:
        """Answer a request of which a part has arrived, and close the connection."""
        self._answer(code, detail)
        if self.cycle is not None and not self.cycle.response_complete:
            # Whoever reads the body learns that there is no more of it, and what they answer is not sent.
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.transport.close()

    def send_400_response(self, msg: str) -> None:
        self._answer("bad-request", msg)
        self.transport.close()

    def _answer(self, code: str, detail: str) -> None:
        """Answer a request that is not complete, unless it has an answer."""
        if self.conn.our_state not in (h11.IDLE, h11.SEND_RESPONSE):
            return
        path = self.scope["path"] if self.conn.our_state is h11.SEND_RESPONSE else ""
        refusal = problem_response(
            code,
            detail,
            path,
            headers={**SECURITY_HEADERS, "X-Request-ID": self._refused_id, "Connection": "close"},
        )
        phrase = HTTPStatus(refusal.status_code).phrase.encode()
        head = h11.Response(status_code=refusal.status_code, headers=refusal.raw_headers, reason=phrase)
        for event in (head, h11.Data(data=bytes(refusal.body)), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")
