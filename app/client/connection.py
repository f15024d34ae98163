"""The way to a service: requests that are tried again, and streams that are taken up again.

Written by ``python -m app.api.published`` from ``asynchronous_connection.py``.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from contextlib import closing

import httpx

from .errors import ClientError, ServiceError, ServiceUnreachable, StreamCutOff
from .event_stream import EventReader, StreamEvent
from .exchange import Call, error_of, may_come_again, pause_s


class Connection:
    """Sends requests to one service.

    Parameters
    ----------
    http
        What sends them; its base URL is the service's.
    timeout_s
        Seconds without a byte after which a connection counts as lost.
    retry_s
        Seconds for which a request that found no service, or a busy one, is sent again.
    """

    def __init__(self, http: httpx.Client, timeout_s: float, retry_s: float) -> None:
        self.http = http
        self._timeout_s, self._retry_s = timeout_s, retry_s

    def send(self, call: Call, *, stream: bool = False) -> httpx.Response:
        """Send a request and return its answer.

        Parameters
        ----------
        call
            The request.
        stream
            Whether the body of the answer is read by whoever asks, who closes it then.

        Raises
        ------
        ServiceError
            If the answer is an error.
        ServiceUnreachable
            If no answer came.
        """
        began, attempt = time.monotonic(), 0
        while True:
            attempt += 1
            failed: ServiceError | httpx.TransportError
            try:
                request = self.http.build_request(**call.arguments(self._timeout_s))
                response = self.http.send(request, stream=stream)
                if response.is_success:
                    return response
                response.read()
                failed = error_of(response)
            except httpx.TransportError as error:
                failed = error
            pause = pause_s(attempt, failed)
            if not may_come_again(call, failed) or time.monotonic() + pause > began + self._retry_s:
                if isinstance(failed, ServiceError):
                    raise failed
                raise ServiceUnreachable(
                    f"{call.method} {self.http.base_url.join(call.path)}: {failed or type(failed).__name__}"
                ) from failed
            time.sleep(pause)

    def lines(self, call: Call) -> Generator[str]:
        """Send a request and yield the lines of its answer as they come.

        Raises
        ------
        ServiceError, ServiceUnreachable
            As :meth:`send`.
        StreamCutOff
            If it breaks off.
        """
        response = self.send(call, stream=True)
        try:
            for line in response.iter_lines():
                yield line
        except httpx.TransportError as error:
            raise StreamCutOff(f"{call.method} {call.path} broke off: {error}") from error
        finally:
            response.close()

    def events(
        self, path: str, ends_with: str | None = None, after: str | None = None
    ) -> Generator[StreamEvent]:
        """Yield the events of a stream; one that is cut off is taken up after its last event.

        Parameters
        ----------
        path
            Of the stream.
        ends_with
            Name of the event that is its last; None: it ends when what it is of is there no more.
        after
            Id of the last event that is known already.

        Raises
        ------
        ServiceError
            If the service has no such stream.
        StreamCutOff
            If it broke off, and could not be taken up for the time in which requests are tried again.
        """
        lost_at, attempt, opened = time.monotonic(), 0, False
        while True:
            attempt += 1
            try:
                call = Call("GET", path, headers={"Last-Event-ID": after}, repeatable=True)
                with closing(self._once(call)) as events:
                    for event in events:
                        opened, attempt, after = True, 0, event.id
                        yield event
                        if event.name == ends_with:
                            return
                        lost_at = time.monotonic()
            except _NoMore:
                return
            except (StreamCutOff, ServiceUnreachable) as error:
                if not opened and isinstance(error, ServiceUnreachable):
                    raise
            except ServiceError as error:
                if opened and ends_with is None and error.status == 404:
                    return
                raise
            if time.monotonic() - lost_at > self._retry_s:
                raise StreamCutOff(f"{path} broke off after event {after or 'none'}")
            time.sleep(pause_s(max(attempt, 1)))

    def _once(self, call: Call) -> Generator[StreamEvent]:
        reader = EventReader()
        response = self.send(call, stream=True)
        try:
            if response.status_code == 204:
                raise _NoMore
            for line in response.iter_lines():
                event = reader.take(line)
                if event is not None:
                    yield event
        except httpx.TransportError as error:
            raise StreamCutOff(f"{call.path} broke off: {error}") from error
        finally:
            response.close()


class _NoMore(ClientError):
    """The last event that is known was the last one."""
