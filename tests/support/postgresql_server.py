"""A PostgreSQL server of Debian's packages, started for tests by an unprivileged user in its own folder."""

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import uuid
from collections.abc import Callable
from functools import cache
from pathlib import Path

PATIENCE_S = 60.0
# The server refuses to run as root; Debian's package makes this user.
_SERVANT = "postgres"
_USER = "allocator"
# No test cuts the power: what a commit costs is measured by benchmarks, which ask for it.
_CONFIGURATION = """
listen_addresses = '127.0.0.1'
unix_socket_directories = ''
shared_buffers = 32MB
max_connections = 200
"""


@cache
def binaries() -> Path | None:
    """Return the folder of the newest server there is, None if none is installed."""
    places = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda place: int(place.parent.name))
    for place in reversed(places):
        if (place / "postgres").exists():
            return place
    found = shutil.which("postgres")
    return None if found is None else Path(found).parent


class PostgresqlServer:
    """A server on a free port of this machine.

    Parameters
    ----------
    durable
        Whether a commit waits for the disk.
    """

    def __init__(self, *, durable: bool = False) -> None:
        found = binaries()
        assert found is not None, "no PostgreSQL: 'apt-get install postgresql'"
        self._bin = found
        self._folder = Path(tempfile.mkdtemp(prefix="postgresql-"))
        self._folder.chmod(0o755)
        self._data = self._folder / "data"
        self._data.mkdir()
        self._prefix: list[str] = []
        if os.geteuid() == 0:
            shutil.chown(self._data, _SERVANT)
            self._prefix = ["setpriv", f"--reuid={_SERVANT}", f"--regid={_SERVANT}", "--clear-groups"]
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        self._run("initdb", "-D", str(self._data), "-U", _USER, "-A", "trust", "-E", "UTF8", "--no-sync")
        with (self._data / "postgresql.conf").open("a") as configuration:
            configuration.write(_CONFIGURATION + f"port = {self.port}\n")
            configuration.write("" if durable else "fsync = off\n")
        self._server: subprocess.Popen[bytes] | None = None
        self.start()

    def start(self) -> None:
        """Start it, and wait until it answers."""
        command = [*self._prefix, str(self._bin / "postgres"), "-D", str(self._data)]
        with (self._folder / "log").open("ab") as log:
            self._server = subprocess.Popen(command, stdout=log, stderr=log, cwd=self._data)
        deadline = time.monotonic() + PATIENCE_S
        ready = [str(self._bin / "pg_isready"), "-q", "-h", "127.0.0.1", "-p", str(self.port), "-U", _USER]
        while subprocess.run(ready, check=False, cwd="/").returncode:
            assert self._server.poll() is None, (self._folder / "log").read_text()
            assert time.monotonic() < deadline, "the server does not answer"
            time.sleep(0.02)

    def stop(self, how: signal.Signals = signal.SIGINT) -> None:
        """Stop it: SIGINT cuts connections and closes properly, SIGQUIT leaves it as a crash would."""
        assert self._server is not None
        self._server.send_signal(how)
        self._server.wait(PATIENCE_S)

    def restart(self, how: signal.Signals = signal.SIGINT) -> None:
        """Stop it and start it again."""
        self.stop(how)
        self.start()

    def new_database(self) -> str:
        """Make an empty database and return its URL."""
        name = f"test_{uuid.uuid4().hex[:12]}"
        address = ["-h", "127.0.0.1", "-p", str(self.port), "-U", _USER]
        subprocess.run([str(self._bin / "createdb"), *address, name], check=True, cwd="/")
        return f"postgresql://{_USER}@127.0.0.1:{self.port}/{name}"

    def close(self) -> None:
        """Stop it and remove everything."""
        self.stop(signal.SIGQUIT)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _run(self, program: str, *arguments: str) -> None:
        command = [*self._prefix, str(self._bin / program), *arguments]
        done = subprocess.run(command, capture_output=True, check=False, cwd="/", text=True)
        assert done.returncode == 0, done.stderr


NewDatabase = Callable[[], str]
