"""A proxy of TCP that loses connections: after so many bytes of an answer, or before the first."""

import contextlib
import socket
import threading


class CuttingProxy:
    """Forwards connections to a service, and cuts the first ones.

    Parameters
    ----------
    port
        Of the service.
    cuts
        For each of the first connections, after how many bytes of the answer it is cut.
    """

    def __init__(self, port: int, cuts: list[int]) -> None:
        self._port, self._cuts = port, list(cuts)
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listening.getsockname()[1]}"
        self.connections = 0
        threading.Thread(target=self._accept, daemon=True).start()

    def __enter__(self) -> "CuttingProxy":
        return self

    def __exit__(self, *error: object) -> None:
        self._listening.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                self.connections += 1
                left = self._cuts.pop(0) if self._cuts else None
                threading.Thread(target=self._serve, args=(near, left), daemon=True).start()

    def _serve(self, near: socket.socket, left: int | None) -> None:
        far = socket.create_connection(("127.0.0.1", self._port))
        threading.Thread(target=self._pass_on, args=(near, far, None), daemon=True).start()
        self._pass_on(far, near, left)
        for each in (near, far):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    @staticmethod
    def _pass_on(source: socket.socket, target: socket.socket, left: int | None) -> None:
        with contextlib.suppress(OSError):
            while left is None or left > 0:
                received = source.recv(65_536 if left is None else left)
                if not received:
                    return
                target.sendall(received)
                left = None if left is None else left - len(received)
