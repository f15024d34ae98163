"""What a monitoring system reads: counts, durations, and how full the service is (Prometheus)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector
from sqlalchemy.exc import SQLAlchemyError

from app.jobs.model import Job, Lane, Load

_METHODS = frozenset({"GET", "HEAD", "POST", "DELETE", "PUT", "PATCH", "OPTIONS"})
_UNMATCHED = "unmatched"

_REQUEST_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60)
_WAIT_S = (0.001, 0.01, 0.1, 0.5, 1, 5, 10, 30, 60, 300, 1800)
_RUN_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 300, 1800, 7200)


class Metrics:
    """The metrics of one application; an observer of its jobs (:class:`app.jobs.model.JobObserver`).

    Labels have values that are known beforehand: routes as templates, methods, statuses, algorithms. What a
    client can make up is no label.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        self._requests = Counter(
            "allocator_http_requests",
            "Requests",
            ("method", "route", "status"),
            registry=self.registry,
        )
        self._latency = Histogram(
            "allocator_http_response_seconds",
            "Time from a request to the beginning of its answer",
            ("method", "route"),
            buckets=_REQUEST_S,
            registry=self.registry,
        )
        self._waited = Histogram(
            "allocator_job_wait_seconds",
            "Time that jobs waited for their first attempt",
            ("lane",),
            buckets=_WAIT_S,
            registry=self.registry,
        )
        self._ran = Histogram(
            "allocator_job_run_seconds",
            "Time that attempts took which ended their job",
            ("kind", "algorithm"),
            buckets=_RUN_S,
            registry=self.registry,
        )
        self._ended = Counter(
            "allocator_jobs_ended", "Jobs that ended", ("kind", "status"), registry=self.registry
        )

    def answered(self, method: str, route: str | None, status: int, seconds: float) -> None:
        """Count a request, and how long it was to the beginning of its answer."""
        known = method if method in _METHODS else "other"
        place = route or _UNMATCHED
        self._requests.labels(known, place, str(status)).inc()
        self._latency.labels(known, place).observe(seconds)

    def started(self, job: Job, waited_s: float) -> None:
        """Count how long a job waited."""
        self._waited.labels(job.lane).observe(waited_s)

    def ended(self, job: Job, ran_s: float | None) -> None:
        """Count a job's end, and how long it ran if it did."""
        self._ended.labels(job.kind, job.status.value).inc()
        if ran_s is not None:
            self._ran.labels(job.kind, job.payload.get("algorithm", "")).observe(ran_s)

    def watch(
        self,
        load: Callable[[], Load],
        waiting: Callable[[], Mapping[Lane, int]],
        policies: Callable[[], int],
        database_bytes: Callable[[], int],
    ) -> None:
        """Say where what is measured at each look comes from; what does not answer is left out of it.

        Parameters
        ----------
        load, waiting
            Of the jobs: how busy the workers are, and how many wait by lane.
        policies
            How many the library has.
        database_bytes
            Size of the database.
        """
        self.registry.register(_Levels(load, waiting, policies, database_bytes))

    def render(self) -> bytes:
        """Return all metrics in Prometheus' text format."""
        return generate_latest(self.registry)


class _Levels(Collector):
    """What is as it is, and is not counted as it happens."""

    def __init__(
        self,
        load: Callable[[], Load],
        waiting: Callable[[], Mapping[Lane, int]],
        policies: Callable[[], int],
        database_bytes: Callable[[], int],
    ) -> None:
        self._load, self._waiting = load, waiting
        self._of_store = {
            "allocator_library_policies": ("Source policies in the library", policies),
            "allocator_database_bytes": ("Size of the database", database_bytes),
        }

    def describe(self) -> list[Metric]:
        """Name nothing beforehand: nothing is to be asked before the service has started."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Look."""
        load = self._load()
        with suppress(SQLAlchemyError):
            yield _by_lane("allocator_jobs_waiting", "Jobs that wait", self._waiting())
        yield _by_lane("allocator_jobs_running", "Jobs that run", load.running)
        yield GaugeMetricFamily("allocator_workers", "Workers there are when all are well", load.capacity)
        yield GaugeMetricFamily("allocator_workers_ready", "Workers that are warm", load.ready)
        yield CounterMetricFamily("allocator_worker_restarts", "Workers that were replaced", load.restarts)
        for name, (text, ask) in self._of_store.items():
            try:
                yield GaugeMetricFamily(name, text, ask())
            except SQLAlchemyError:
                continue


def _by_lane(name: str, text: str, levels: Mapping[Lane, int]) -> GaugeMetricFamily:
    jobs = GaugeMetricFamily(name, text, labels=["lane"])
    for lane, level in levels.items():
        jobs.add_metric([lane], level)
    return jobs
