"""What can stand between a mission and vehicles.

MavlinkError
 ├─ PackageMissing     pymavlink or httpx is not installed
 ├─ UnknownVehicle     a system id or a UAV that is not there
 ├─ ServiceAway        the service cannot be reached now
 ├─ ServiceRefused     the service refuses what it was asked
 └─ LinkFailed         the stream cannot be opened
"""

from __future__ import annotations

from collections.abc import Sequence


class MavlinkError(Exception):
    """Root of the tree; the message is a sentence for people."""


class PackageMissing(MavlinkError):
    """A package of the extra is not installed."""

    def __init__(self, package: str) -> None:
        super().__init__(f"{package} is not installed: pip install 'uav-allocator[mavlink]'")


class UnknownVehicle(MavlinkError):
    """An assignment names a UAV that the mission has not, or one twice."""

    def __init__(self, system: int, uav_id: str, why: str, known: Sequence[str]) -> None:
        super().__init__(f"system {system}: {uav_id!r} {why}; the mission has {', '.join(known)}")


class ServiceAway(MavlinkError):
    """The service cannot be reached, or has no time: the same may be asked again."""


class ServiceRefused(MavlinkError):
    """The service answers that it will not do what it is asked, and would not later."""

    def __init__(self, status: int, what: str, detail: str) -> None:
        super().__init__(f"{what}: the service answers {status}: {detail}")
        self.status = status


class LinkFailed(MavlinkError):
    """A stream or file cannot be opened."""

    def __init__(self, device: str, why: str) -> None:
        super().__init__(f"{device!r} cannot be opened: {why}")
