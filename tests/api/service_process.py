"""The service as a process of its own, on a free port of the loopback interface, which it prints."""

import json
import socket
import sys

from app.api.server import Server
from app.settings import Settings


def main() -> None:
    settings = Settings(**json.loads(sys.argv[1]))
    # Of a socket that is said to be TCP, asyncio sends small packets at once; of another's, answers on a
    # connection that is kept come 40 ms late.
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listening.bind(("127.0.0.1", 0))
    listening.listen()
    print(listening.getsockname()[1], flush=True)
    Server(settings).run(sockets=[listening])


if __name__ == "__main__":
    main()
