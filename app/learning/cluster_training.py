"""Trainings on a Ray cluster, as many at a time as it has CPUs.

Ray is an extra: nothing imports it before a training is spread.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from app.learning.parameters import QmixParameters
from app.learning.source_training import train_source
from app.solvers.stop import never

_SINGLE_THREADED = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

Item = TypeVar("Item")
Result = TypeVar("Result")


@contextmanager
def connected(address: str) -> Iterator[None]:
    """Work on a cluster meanwhile; of calls within each other the outermost connects and leaves.

    Parameters
    ----------
    address
        Of the cluster's head, ``host:port``, or ``"local"`` for one that is started on this machine.

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

    if ray.is_initialized():
        yield
        return
    ray.init(address, log_to_driver=False)
    try:
        yield
    finally:
        ray.shutdown()


def on_cluster(job: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[tuple[int, Result]]:
    """Do a job for every item, each on one core; one that is lost with its machine begins anew on another.

    Parameters
    ----------
    job, items
        Both are sent to other machines of the cluster that is :func:`connected`, and the result back.

    Yields
    ------
    tuple
        The place of an item and its result, in the order in which they end.
    """
    import ray  # noqa: PLC0415 - an extra

    # Without end: the cluster may lose as many machines as it likes.
    environment = {"env_vars": {**_SINGLE_THREADED, **_search_path()}}
    options: dict[str, Any] = {"num_cpus": 1, "max_retries": -1, "runtime_env": environment}
    remote: Any = ray.remote(**options)(_call)
    places = {remote.remote(job, item): place for place, item in enumerate(items)}
    pending = list(places)
    while pending:
        ended, pending = ray.wait(pending)
        for reference in ended:
            yield places[reference], ray.get(reference)


def train_on_cluster(
    trainings: Sequence[tuple[dict[str, Any], QmixParameters]], address: str
) -> Iterator[tuple[int, bytes]]:
    """Train source tasks, given as problem records with what to train with; yields as :func:`on_cluster`."""
    with connected(address):
        yield from on_cluster(_train, trainings)


def _train(training: tuple[dict[str, Any], QmixParameters]) -> bytes:
    record, parameters = training
    return train_source(record, parameters, never, lambda _progress: None)


def _call(job: Callable[[Item], Result], item: Item) -> Result:
    return job(item)


def _search_path() -> dict[str, str]:
    """Return where this process finds modules, if it was told so: the workers are told the same."""
    path = os.environ.get("PYTHONPATH")
    return {} if path is None else {"PYTHONPATH": path}
