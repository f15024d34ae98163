"""Slow senders and what is no HTTP, on real sockets: they are closed in time, and nobody else is."""

import asyncio
import logging
import re
import socket
import threading
import time
from contextlib import ExitStack, contextmanager

import pytest
import uvicorn

from app.api.receipt_deadline import protocol_with_deadline
from app.logs import labels

SHORT_S, LONG_S = 0.4, 60.0
PATIENCE_S = 20.0
LARGE = 16 * 1024**2
HEAD = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 10\r\n\r\n"
GET = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"


async def application(scope, receive, send):
    """Reads the body, and answers with its length; at /slow not before three deadlines have passed."""
    if scope["type"] != "http":
        return
    body, more = b"", True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        body += message["body"]
        more = message["more_body"]
    if scope["path"] in ("/endless", "/large"):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        if scope["path"] == "/large":
            await send({"type": "http.response.body", "body": b"x" * LARGE})
            return
        sending = asyncio.create_task(send_without_end(send))
        while (await receive())["type"] != "http.disconnect":
            continue
        sending.cancel()
        return
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"10")]})
    if scope["path"] == "/slow":
        await send({"type": "http.response.body", "body": b"12345", "more_body": True})
        await asyncio.sleep(3 * SHORT_S)
        await send({"type": "http.response.body", "body": b"67890"})
    else:
        await send({"type": "http.response.body", "body": b"%10d" % len(body)})


async def send_without_end(send):
    while True:
        await send({"type": "http.response.body", "body": b"x" * 100_000, "more_body": True})


@contextmanager
def serving(deadline_s, **settings):
    listening = socket.create_server(("127.0.0.1", 0), backlog=256)
    settings = {"log_level": "warning", "timeout_graceful_shutdown": 1, **settings}
    config = uvicorn.Config(application, http=protocol_with_deadline(deadline_s), **settings)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        while not server.started:
            time.sleep(0.01)
        yield server
    finally:
        server.should_exit = True
        thread.join(PATIENCE_S)


@contextmanager
def served(deadline_s, **settings):
    with serving(deadline_s, **settings) as server:
        yield server.servers[0].sockets[0].getsockname()


@contextmanager
def connected(address):
    with socket.create_connection(address, timeout=PATIENCE_S) as connection:
        yield connection


def until_closed(connection):
    """What comes until the other side closes, and after how long that was."""
    begun, received = time.monotonic(), b""
    while chunk := connection.recv(65536):
        received += chunk
    return received, time.monotonic() - begun


@pytest.fixture(scope="module")
def address():
    with served(SHORT_S) as at:
        yield at


@pytest.mark.parametrize(
    ("begun", "status"),
    [
        (b"", b""),
        (b"POST / HT", b"408"),
        (b"POST / HTTP/1.1\r\nHost: x\r\n", b"408"),
        (HEAD + b"1234", b"408"),
    ],
    ids=["silent", "line", "headers", "body"],
)
def test_what_is_not_received_in_time_is_closed(address, begun, status):
    with connected(address) as connection:
        connection.sendall(begun)
        received, after_s = until_closed(connection)

    assert after_s >= SHORT_S / 2
    assert received[9:12] == status
    if status:
        head, _, body = received.partition(b"\r\n\r\n")
        assert b"application/problem+json" in head
        assert b"connection: close" in head.lower()
        assert b"x-request-id" in head.lower()
        assert b'"type":"/docs/errors#request-timeout"' in body


@pytest.mark.parametrize(
    "garbage", [b"\x16\x03\x01\x02\x00\x01\r\n\r\n", b"GET / HTTP/1.1\r\n\xff: \x00\r\n\r\n"]
)
def test_what_is_no_http_gets_problem_details(address, garbage):
    with connected(address) as connection:
        connection.sendall(garbage)
        received, _ = until_closed(connection)
    assert received.startswith(b"HTTP/1.1 400 ")
    assert b"application/problem+json" in received
    assert b'"type":"/docs/errors#bad-request"' in received


def test_what_is_refused_unread_is_logged_with_the_id_of_its_answer():
    logged, ids = _RequestIds(), []
    with served(SHORT_S, log_level="info") as address:
        logging.getLogger("uvicorn.error").addHandler(logged)
        for sent in (b"\x16\x03\x01\r\n\r\n", HEAD + b"1234"):
            with connected(address) as connection:
                connection.sendall(sent)
                head = until_closed(connection)[0].partition(b"\r\n\r\n")[0].lower()
            ids.append(re.search(rb"x-request-id: (\w+)", head)[1].decode())
    logging.getLogger("uvicorn.error").removeHandler(logged)
    assert [each for each in logged.ids if each is not None] == ids


class _RequestIds(logging.Handler):
    """Notes the request's id that each line is logged with, which the service's log writes out."""

    def __init__(self):
        super().__init__()
        self.ids = []

    def emit(self, record):
        self.ids.append(labels().get("request_id"))


def test_garbage_behind_an_answer_closes_without_another(address):
    with connected(address) as connection:
        connection.sendall(GET)
        assert b" 200 " in connection.recv(65536)
        connection.sendall(b"GET /slow HTTP/1.1\r\nHost: x\r\n\r\n\x00\x01\r\n\r\n")
        received, _ = until_closed(connection)
    assert received.count(b"HTTP/1.1 200") == 1
    assert received.count(b"HTTP/1.1 400") == 1


def test_a_drip_does_not_extend_the_deadline(address):
    begun = time.monotonic()
    with connected(address) as connection:
        connection.settimeout(SHORT_S / 10)
        connection.sendall(b"POST / HTTP/1.1\r\n")
        received = b""
        while not received:
            try:
                connection.sendall(b"A: b\r\n")
                received = connection.recv(65536)
            except TimeoutError:
                assert time.monotonic() - begun < PATIENCE_S
    assert b" 408 " in received
    assert time.monotonic() - begun >= 0.9 * SHORT_S  # two clocks


def test_a_later_request_of_a_connection_has_the_deadline_too(address):
    with connected(address) as connection:
        connection.sendall(GET)
        assert b" 200 " in connection.recv(65536)
        connection.sendall(HEAD + b"1")
        received, _ = until_closed(connection)
    assert b" 408 " in received


def test_the_rest_of_a_pipelined_request_has_the_deadline_too(address):
    with connected(address) as connection:
        connection.sendall(GET + b"GET / HT")
        received, _ = until_closed(connection)
    assert received.count(b" 200 ") == 1
    assert received.count(b" 408 ") == 1


def test_a_long_answer_is_not_touched(address):
    with connected(address) as connection:
        connection.sendall(b"GET /slow HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
        received, after_s = until_closed(connection)
    assert received.endswith(b"1234567890")
    assert after_s > 2 * SHORT_S  # of the three that the server waits, by a clock of its own


@pytest.mark.parametrize("path", ["endless", "large"])
def test_who_takes_nothing_of_an_answer_is_closed(path):
    with serving(SHORT_S) as server, asking_for(path, server) as connection:
        eventually(lambda: server.server_state.connections)
        # Bytes have a place on their way to the client, and then no more are taken.
        eventually(lambda: not server.server_state.connections)
        # What was on its way arrives, and no more.
        assert len(until_closed(connection)[0]) < LARGE


def test_who_takes_an_answer_bit_by_bit_gets_all_of_it():
    with serving(SHORT_S) as server, asking_for("large", server) as connection:
        received, begun = 0, time.monotonic()
        while chunk := connection.recv(65536):
            received += len(chunk)
            if time.monotonic() - begun < 5 * SHORT_S:
                time.sleep(SHORT_S / 20)
    assert received > LARGE


@contextmanager
def asking_for(path, server):
    """Ask for an answer, of which little has a place in the client's system."""
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.settimeout(PATIENCE_S)
        connection.connect(server.servers[0].sockets[0].getsockname())
        connection.sendall(f"GET /{path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode())
        yield connection


def eventually(condition):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_slow_senders_do_not_delay_others():
    with served(LONG_S) as address, ExitStack() as stack:
        slow = [stack.enter_context(connected(address)) for _ in range(64)]
        for number, connection in enumerate(slow):
            connection.sendall((HEAD + b"1234")[: number % (len(HEAD) + 4)])
        waits = []
        for _ in range(20):
            with connected(address) as other:
                begun = time.monotonic()
                other.sendall(HEAD + b"0123456789")
                assert b" 200 " in other.recv(65536)
                waits.append(time.monotonic() - begun)
        assert sorted(waits)[10] < 0.1
        slow[-1].sendall((HEAD + b"0123456789")[63 % (len(HEAD) + 4) :])
        assert slow[-1].recv(65536).startswith(b"HTTP/1.1 200")
