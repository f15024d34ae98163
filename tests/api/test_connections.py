"""Connections leave room for others: their number, the chunks of a turn, and what follows a refusal."""

import asyncio
import contextlib
import logging
import socket
import threading
from contextlib import ExitStack, contextmanager

import h11
import pytest
import uvicorn

from app.api import connections
from app.api.connections import BoundedProtocol, connection_limit, raise_descriptor_limit

PATIENCE_S = 20.0
GET = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
CHUNKED = b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"


async def application(scope, receive, send):
    """Answers with the length of the body; at /refused 401 without reading it."""
    if scope["type"] != "http":
        return
    length, more = 0, scope["path"] != "/refused"
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        length += len(message["body"])
        more = message["more_body"]
    status = 401 if scope["path"] == "/refused" else 200
    body = b"%d" % length
    await send(
        {
            "type": "http.response.start",
            "status": status,
            "headers": [(b"content-length", b"%d" % len(body))],
        }
    )
    await send({"type": "http.response.body", "body": body})


@contextmanager
def served(application=application):
    listening = socket.create_server(("127.0.0.1", 0), backlog=256)
    config = uvicorn.Config(
        application, http=BoundedProtocol, log_level="warning", timeout_graceful_shutdown=1
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        yield listening.getsockname()
    finally:
        server.should_exit = True
        thread.join(PATIENCE_S)


@contextmanager
def connected(address):
    with socket.create_connection(address, timeout=PATIENCE_S) as connection:
        yield connection


def answer(connection):
    """Read one answer whole, and return its status."""
    received = b""
    while b"\r\n\r\n" not in received or received.endswith(b"\r\n\r\n"):
        received += connection.recv(65536)
    return int(received[9:12])


def until_closed(connection):
    received = b""
    while chunk := connection.recv(65536):
        received += chunk
    return received


@pytest.fixture
def chunks(monkeypatch):
    """Counts the chunks that were read in each turn."""
    counted, handle, next_event = [], BoundedProtocol.handle_events, h11.Connection.next_event

    def count_turn(protocol):
        counted.append(0)
        handle(protocol)

    def count(connection):
        event = next_event(connection)
        counted[-1] += isinstance(event, h11.Data)
        return event

    monkeypatch.setattr(BoundedProtocol, "handle_events", count_turn)
    monkeypatch.setattr(h11.Connection, "next_event", count)
    return counted


def test_a_turn_has_few_chunks_and_all_of_them_arrive(chunks):
    many = 20_000
    with served() as address, connected(address) as connection:
        connection.sendall(CHUNKED + b"1\r\nx\r\n" * many + b"0\r\n\r\n" + GET)
        received = b""
        while received.count(b"HTTP/1.1 200") < 2:
            received += connection.recv(65536)
    assert b"\r\n\r\n%d" % many in received
    assert sum(chunks) == many
    assert max(chunks) <= connections._CHUNKS_A_TURN


def test_a_whole_body_needs_no_turns(chunks):
    length = 1_000_000
    head = b"POST / HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: %d\r\n\r\n" % length
    with served() as address, connected(address) as connection:
        connection.sendall(head + b"x" * length)
        assert until_closed(connection).endswith(b"\r\n\r\n%d" % length)
    assert max(chunks) <= 1


def test_what_follows_a_refusal_is_not_read(chunks):
    with served() as address, connected(address) as connection:
        connection.sendall(CHUNKED.replace(b"/", b"/refused", 1) + b"1\r\nx\r\n")
        assert answer(connection) == 401
        read = sum(chunks)
        try:
            for _ in range(100):
                connection.sendall(b"1\r\nx\r\n" * 1000)
        except ConnectionError:
            pass  # closed while it was sent to
        else:
            assert until_closed(connection) == b""
        with connected(address) as other:
            other.sendall(GET)
            assert answer(other) == 200
    assert sum(chunks) == read <= 1


def test_an_answer_before_the_end_of_the_body_says_that_it_is_the_last():
    part = b"POST /refused HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nx"
    with served() as address, connected(address) as connection:
        connection.sendall(part)
        received = until_closed(connection)
    assert received.startswith(b"HTTP/1.1 401")
    assert b"connection: close\r\n" in received


def test_a_request_that_was_refused_whole_keeps_its_connection():
    whole = b"POST /refused HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\nx"
    with served() as address, connected(address) as connection:
        for _ in range(3):
            connection.sendall(whole)
            assert answer(connection) == 401


def test_a_length_that_is_given_twice_ends_the_connection():
    both = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
    with served() as address, connected(address) as connection:
        connection.sendall(both + GET)
        received = until_closed(connection)
    assert received.startswith(b"HTTP/1.1 400")
    assert b"application/problem+json" in received
    assert received.count(b"HTTP/1.1") == 1


@pytest.fixture
def eight_places(monkeypatch):
    monkeypatch.setattr(connections, "connection_limit", lambda _descriptors: 8)


@pytest.mark.parametrize(
    "sent", [b"", b"GET / HTT", b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nx"]
)
def test_who_sends_no_request_makes_room_for_others(eight_places, caplog, sent):
    with served() as address, ExitStack() as stack:
        with caplog.at_level(logging.WARNING, "app.api.connections"):
            idle = [stack.enter_context(connected(address)) for _ in range(50)]
            for connection in idle:
                # The first are closed while the last come.
                with contextlib.suppress(ConnectionError):
                    connection.sendall(sent)
            for _ in range(20):
                other = stack.enter_context(connected(address))
                other.sendall(GET)
                assert answer(other) == 200
        assert was_closed(idle[0])
    assert len([record for record in caplog.records if "as many as may be" in record.message]) == 1


def was_closed(connection):
    try:
        return connection.recv(1) == b""
    except ConnectionError:
        return True


def test_who_is_being_answered_keeps_the_connection(eight_places):
    begun, release = threading.Semaphore(0), threading.Event()

    async def busy(scope, receive, send):
        if scope["type"] == "http":
            begun.release()
            await asyncio.to_thread(release.wait, PATIENCE_S)
        await application(scope, receive, send)

    with served(busy) as address, ExitStack() as stack:
        asked = [stack.enter_context(connected(address)) for _ in range(5)]
        for connection in asked:
            connection.sendall(GET)
        for _ in asked:
            assert begun.acquire(timeout=PATIENCE_S)
        for _ in range(20):
            stack.enter_context(connected(address))
        release.set()
        for connection in asked:
            assert answer(connection) == 200


@pytest.mark.parametrize(("descriptors", "most"), [(40, 8), (64, 8), (256, 192), (1024, 768), (65_536, 4096)])
def test_descriptors_are_left_for_files_and_workers(descriptors, most):
    assert connection_limit(descriptors) == most


def test_the_soft_limit_of_descriptors_is_raised(monkeypatch):
    limits = [1024, 4096]
    monkeypatch.setattr(connections.resource, "getrlimit", lambda _kind: tuple(limits))
    monkeypatch.setattr(
        connections.resource, "setrlimit", lambda _kind, given: limits.__setitem__(slice(None), given)
    )
    raise_descriptor_limit()
    assert limits == [4096, 4096]
