"""Source tasks trained on a Ray cluster, as many at a time as it has CPUs.

Ray is an extra: nothing imports it before a training is spread.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any

from app.learning.parameters import QmixParameters
from app.learning.source_training import train_source
from app.solvers.stop import never

_SINGLE_THREADED = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def train_on_cluster(
    trainings: Sequence[tuple[dict[str, Any], QmixParameters]], address: str
) -> Iterator[tuple[int, bytes]]:
    """Train source tasks, each on one core; one that is lost with its machine begins anew on another.

    Parameters
    ----------
    trainings
        Problem records, and what to train with.
    address
        Of the cluster's head, ``host:port``, or ``"local"`` for one that is started on this machine.

    Yields
    ------
    tuple
        The place in ``trainings`` and the checkpoint, in the order in which they end.

    Raises
    ------
    ModuleNotFoundError
        If Ray is not installed.
    ConnectionError
        If no cluster is found at the address.
    """
    # Nothing here reports to anybody how it is used.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    import ray  # noqa: PLC0415 - an extra

    connected_here = not ray.is_initialized()
    if connected_here:
        ray.init(address, log_to_driver=False)
    try:
        # Without end: the cluster may lose as many machines as it likes.
        train = ray.remote(
            num_cpus=1, max_retries=-1, runtime_env={"env_vars": {**_SINGLE_THREADED, **_search_path()}}
        )(_train)
        places = {train.remote(*training): place for place, training in enumerate(trainings)}
        pending = list(places)
        while pending:
            ended, pending = ray.wait(pending)
            for reference in ended:
                yield places[reference], ray.get(reference)
    finally:
        if connected_here:
            ray.shutdown()


def _train(record: dict[str, Any], parameters: QmixParameters) -> bytes:
    return train_source(record, parameters, never, lambda _progress: None)


def _search_path() -> dict[str, str]:
    """Return where this process finds modules, if it was told so: the workers are told the same."""
    path = os.environ.get("PYTHONPATH")
    return {} if path is None else {"PYTHONPATH": path}
