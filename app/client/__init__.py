"""A client of the UAV allocation service: allocate, wait, stream, missions, library, exports.

.. code-block:: python

    with Client("http://127.0.0.1:8000") as service:
        answer = service.allocate(problem, algorithm="auto", time_limit_s=2)

:class:`Client` waits, :class:`AsyncClient` has the same methods for ``asyncio``. What they take and return
are plain dictionaries, with the types of :mod:`.types`, which follow from the service's own declarations.
"""

from . import types
from .asynchronous import AsyncClient
from .errors import (
    ClientError,
    JobCancelled,
    JobEnded,
    JobFailed,
    ServiceError,
    ServiceUnreachable,
    StreamCutOff,
)
from .event_stream import StreamEvent
from .exchange import File
from .synchronous import Client

__version__ = "0.3.0"

__all__ = [
    "AsyncClient",
    "Client",
    "ClientError",
    "File",
    "JobCancelled",
    "JobEnded",
    "JobFailed",
    "ServiceError",
    "ServiceUnreachable",
    "StreamCutOff",
    "StreamEvent",
    "types",
]
