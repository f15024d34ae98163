"""The server: uvicorn's, which tells the jobs of its end before it waits for the answers under way."""

from __future__ import annotations

import math
import socket

import uvicorn

from app.api.application import create_application
from app.api.receipt_deadline import protocol_with_deadline
from app.settings import Settings


class Server(uvicorn.Server):
    """Serves the application of some settings.

    At its end those who wait for a job that does not run, or does not end in time, are told that the service
    stops; all of it is over within the grace that is set.

    Parameters
    ----------
    settings
        Of the application and of the server.
    """

    def __init__(self, settings: Settings) -> None:
        self._application = create_application(settings)
        self._settings = settings
        super().__init__(
            uvicorn.Config(
                self._application,
                host=settings.host,
                port=settings.port,
                log_config=None,
                access_log=False,
                http=protocol_with_deadline(settings.receive_timeout_s),
                timeout_graceful_shutdown=math.ceil(settings.shutdown_grace_s),
                proxy_headers=bool(settings.trusted_proxies),
                forwarded_allow_ips=list(settings.trusted_proxies),
            )
        )

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Let the jobs stop, and the answers that are under way come to their end."""
        services = self._application.state.services
        services.missions.begin_stop()
        services.jobs.begin_stop(self._settings.jobs_grace_s)
        await super().shutdown(sockets)
