"""The service as a process of its own, on a free port of the loopback interface, which it prints."""

import json
import socket
import sys

import uvicorn

from app.api.application import create_application
from app.settings import Settings


def main() -> None:
    settings = Settings(**json.loads(sys.argv[1]))
    listening = socket.create_server(("127.0.0.1", 0))
    print(listening.getsockname()[1], flush=True)
    config = uvicorn.Config(create_application(settings), log_level="warning")
    uvicorn.Server(config).run(sockets=[listening])


if __name__ == "__main__":
    main()
