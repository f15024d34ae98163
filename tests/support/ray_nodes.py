"""A Ray cluster of several nodes on this machine, for tests and benchmarks."""

import os
import secrets
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

# Nothing is sent anywhere.
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
# The nodes listen on the machine's address: nobody else may join them.
os.environ.update(RAY_AUTH_MODE="token", RAY_AUTH_TOKEN=secrets.token_hex(32))
_WATCHFUL = {
    "health_check_period_ms": 200,
    "health_check_failure_threshold": 3,
    "health_check_timeout_ms": 500,
}
# As `.deploy/README.md` has it: nodes say once a second how busy they are, and nobody reads metrics.
_QUIET = {
    "raylet_report_resources_period_milliseconds": 1000,
    "enable_metrics_collection": False,
    "raylet_check_gc_period_milliseconds": 1000,
}


def ray_is_installed() -> bool:
    """Say whether the extra is there."""
    return find_spec("ray") is not None


class RayNodes:
    """A head that runs no work, and nodes with one core each.

    Parameters
    ----------
    count
        How many nodes there are at first.
    watchful
        Whether nodes that were killed are noticed in a second; otherwise the cluster is set as
        ``.deploy/README.md`` sets it.
    """

    def __init__(self, count: int, *, watchful: bool = True) -> None:
        self._nodes: list[Any] = []
        from ray.cluster_utils import Cluster  # noqa: PLC0415 - an extra

        head = {
            "num_cpus": 0,
            "include_dashboard": False,
            "include_log_monitor": False,
            "_system_config": _WATCHFUL if watchful else _QUIET,
        }
        with _kept_signals():
            self._cluster = Cluster(initialize_head=True, head_node_args=head)
        for _ in range(count):
            self.add()
        self.address: str = self._cluster.address

    def kill_one(self) -> None:
        """Kill a node and all that runs on it, as a machine that loses power."""
        self._cluster.remove_node(self._nodes.pop(), allow_graceful=False)

    def add(self) -> None:
        """Add a node."""
        with _kept_signals():
            self._nodes.append(self._cluster.add_node(num_cpus=1, include_log_monitor=False))

    def close(self) -> None:
        """End the cluster."""
        self._cluster.shutdown()


@contextmanager
def _kept_signals() -> Iterator[None]:
    """Give back the handler of SIGTERM, which Ray takes over for the process that starts nodes."""
    kept = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, kept)
