"""MAVLink messages from vehicles by UDP, and from telemetry logs."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from contextlib import suppress
from io import BufferedReader
from pathlib import Path
from typing import Any

from app.mavlink.errors import LinkFailed, PackageMissing

try:
    # The second version of the protocol, which reads the first one, too.
    from pymavlink.dialects.v20 import common
except ModuleNotFoundError as error:
    raise PackageMissing("pymavlink") from error

SYSTEM = 255
"""The system id of a ground station."""
_COMPONENT = common.MAV_COMP_ID_MISSIONPLANNER
_LARGEST_DATAGRAM = 65_535
_READ_AT_ONCE = 1_000
_TIME = struct.Struct(">Q")
_MAGIC_1, _MAGIC_2 = 0xFE, 0xFD
_SIGNED, _SIGNATURE = 1, 13
"""The flag of a signed message of the second version, and the bytes of a signature."""
_AROUND_1, _AROUND_2 = 8, 12
"""Bytes of a message beside its payload, in both versions."""


def _parser() -> Any:
    parser = common.MAVLink(None, srcSystem=SYSTEM, srcComponent=_COMPONENT)
    parser.robust_parsing = True
    return parser


def _messages(parser: Any, data: bytes) -> Iterator[Any]:
    for message in parser.parse_buffer(data) or ():
        if message.get_type() != "BAD_DATA" and not message.get_type().startswith("UNKNOWN"):
            yield message


class UdpStream:
    """Vehicles that send to a port of this machine; each is answered where it was heard last.

    Parameters
    ----------
    address
        ``host:port`` to listen on.

    Raises
    ------
    LinkFailed
        If it cannot be listened on.
    """

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        if not host or not port.isdecimal():
            raise LinkFailed(address, "a host and a port are needed, as 0.0.0.0:14550")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, int(port)))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise LinkFailed(address, str(error)) from error
        self._parsers: dict[tuple[str, int], Any] = {}
        self._places: dict[int, tuple[str, int]] = {}
        self._writer = _parser()

    @property
    def port(self) -> int:
        """The port that is listened on."""
        port: int = self._socket.getsockname()[1]
        return port

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()

    def receive(self, within_s: float) -> list[Any]:
        """Return the messages that are there, or the first that come within a time."""
        heard: list[Any] = []
        self._socket.settimeout(within_s)
        for _ in range(_READ_AT_ONCE):
            try:
                data, place = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except (TimeoutError, BlockingIOError):
                break
            except ConnectionError:  # what was sent to a vehicle that is gone
                continue
            self._socket.setblocking(False)
            parser = self._parsers.setdefault(place, _parser())
            for message in _messages(parser, data):
                self._places[message.get_srcSystem()] = place
                heard.append(message)
        return heard

    def send(self, system: int, kind: str, fields: dict[str, Any]) -> None:
        """Send a message, by the name of its type and its fields, to where a system was heard last.

        What the network does not take is lost, as any other message may be.
        """
        message = getattr(self._writer, f"{kind.lower()}_encode")(**fields)
        self._socket.setblocking(True)
        with suppress(OSError):
            self._socket.sendto(message.pack(self._writer), self._places[system])
        self._writer.seq = (self._writer.seq + 1) % 256

    def say_alive(self) -> None:
        """Send the heartbeat of a ground station to every system that was heard."""
        fields = {
            "type": common.MAV_TYPE_GCS,
            "autopilot": common.MAV_AUTOPILOT_INVALID,
            "base_mode": 0,
            "custom_mode": 0,
            "system_status": common.MAV_STATE_ACTIVE,
        }
        for system in self._places:
            self.send(system, "HEARTBEAT", fields)


def read_telemetry_log(file: Path) -> Iterator[tuple[float, Any]]:
    """Yield the messages of a ``.tlog`` with their times, in seconds of the epoch.

    Each is preceded by its time in microseconds, as 8 bytes with the highest first. What is no message is
    passed over, byte by byte.

    Raises
    ------
    LinkFailed
        If it cannot be read, or has no message.
    """
    parser, found = _parser(), False
    try:
        with file.open("rb") as log:
            while (record := _next_record(log)) is not None:
                time_s, frame = record
                for message in _messages(parser, frame):
                    found = True
                    yield time_s, message
    except OSError as error:
        raise LinkFailed(str(file), str(error)) from error
    if not found:
        raise LinkFailed(str(file), "it has no MAVLink message that is preceded by its time")


def _next_record(log: BufferedReader) -> tuple[float, bytes] | None:
    """Return the next time and message; None at the end."""
    while True:
        begin = log.tell()
        head = log.read(_TIME.size + 3)
        if len(head) < _TIME.size + 3:
            return None
        magic, length, flags = head[_TIME.size :]
        if magic == _MAGIC_2:
            size = _AROUND_2 + length + (_SIGNATURE if flags & _SIGNED else 0)
        elif magic == _MAGIC_1:
            size = _AROUND_1 + length
        else:
            log.seek(begin + 1)
            continue
        rest = log.read(size - 3)
        if len(rest) < size - 3:
            return None
        return _TIME.unpack_from(head)[0] / 1e6, head[_TIME.size :] + rest
