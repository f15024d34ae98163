"""The application: its parts in order of their start, its routes, its middleware."""

from __future__ import annotations

import asyncio
import gc
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from asgi_correlation_id import CorrelationIdMiddleware
from fastapi import FastAPI
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware

import app
from app.api.access.guard import Guard
from app.api.access.hosts import Hosts
from app.api.access.keys import KeyStore
from app.api.batch import Batches
from app.api.connections import raise_descriptor_limit
from app.api.dashboard import install_dashboard
from app.api.documentation import DESCRIPTION, TAGS, install_documentation, operation_id
from app.api.error_handlers import install_error_handlers
from app.api.error_types import install_error_types
from app.api.head_requests import HeadRequests
from app.api.job_kinds import BATCH, job_kinds
from app.api.json_body import BodyLimit
from app.api.metrics import Metrics
from app.api.request_log import RequestLog
from app.api.routes import (
    algorithms,
    allocation,
    batch,
    evaluation,
    examples,
    jobs,
    library,
    missions,
    operations,
    plans,
)
from app.api.security_headers import SecurityHeaders
from app.api.services import Services
from app.api.threads import started_threads
from app.jobs import stored_json
from app.jobs.executor import KEEPS_MEMORY, SINGLE_THREADED, Executor
from app.jobs.local import LocalExecutor
from app.jobs.ray_cluster import RayExecutor
from app.jobs.service import JobService
from app.library.seeding import seed_library
from app.missions.judge import Judge
from app.missions.service import MissionService
from app.missions.store import MissionStore
from app.settings import Settings
from policy_store.checkpoint import ContainerLimits
from policy_store.database import Database
from policy_store.library import PolicyLibrary

_READ_HEADERS = (
    "Authorization",
    "Content-Type",
    "Idempotency-Key",
    "If-None-Match",
    "Last-Event-ID",
    "Prefer",
    "X-Request-ID",
)
_SENT_HEADERS = ("ETag", "Location", "Preference-Applied", "Retry-After", "WWW-Authenticate", "X-Request-ID")
_WARM_UP = "app.allocation.warm_up:warm_up_worker"
_WARM_UP_RESERVE = "app.allocation.warm_up:warm_up_at_once"
_WARM_UP_JUDGE = "app.missions.judging:warm_up"
_PRELOAD = "app.allocation.preloaded"
_REQUEST_THREADS = 8
_SEARCHES_LEAVE = 5
"""Niceness of the workers: a third of a core's time where somebody else has something to do on it."""
_COMPRESSED_FROM_BYTES = 8_192
# Streams, whose lines would wait for each other, and weights, which are as small as they get.
_SENT_AS_IT_IS = (*DEFAULT_EXCLUDED_CONTENT_TYPES, batch.NDJSON, "application/octet-stream")
_REQUEST_ID = re.compile(r"[A-Za-z0-9._~+/=-]{1,128}")


def create_application(settings: Settings) -> FastAPI:
    """Put the service together; it opens its database and starts its workers when it is started.

    Parameters
    ----------
    settings
        Everything an operator can set; nothing else is read from the environment.
    """

    metrics = Metrics()

    @asynccontextmanager
    async def lifespan(application: FastAPI) -> AsyncIterator[None]:
        asyncio.get_running_loop().set_default_executor(started_threads(_REQUEST_THREADS))
        raise_descriptor_limit()
        limits = ContainerLimits(bytes=settings.max_checkpoint_bytes)
        database = Database(settings.resolved_database_url, stored_json.write, stored_json.read)
        try:
            store = PolicyLibrary(database, limits)
            store.migrate()
            # What is shipped is taken in whatever is set for what strangers send.
            seed_library(PolicyLibrary(database), database)
            keys = KeyStore(database)
            keys.migrate()
            mission_store = MissionStore(database)
            mission_store.migrate()
            service = JobService(
                database,
                job_kinds(store, mission_store, limits, settings.max_run_s, settings.max_training_s),
                _workers(settings, database),
                reserve=_local(1, _WARM_UP_RESERVE, _largest(settings), settings, database),
                max_queued={
                    "interactive": settings.queue_limit,
                    "batch": settings.batch_limit,
                    "training": settings.queue_limit,
                },
                max_attempts=settings.job_attempts,
                overrun_grace_s=settings.job_grace_s,
                retention_s=settings.job_retention_s,
                observer=metrics,
            )
            metrics.watch(service.load, service.waiting, store.count, database.size)
            await service.start()
            day = _missions(mission_store, service, settings, database)
            # What is there now stays: to look through it for garbage would only hold up requests.
            gc.collect()
            gc.freeze()
            application.state.services = Services(
                settings, database, store, service, Batches(service, BATCH), day, keys, metrics
            )
            try:
                await day.start()
                yield
            finally:
                await day.stop()
                await service.stop(settings.jobs_grace_s)
        finally:
            database.dispose()

    application = FastAPI(
        title="UAV task allocation",
        version=app.__version__,
        description=DESCRIPTION,
        openapi_tags=TAGS,
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
        generate_unique_id_function=operation_id,
        middleware=_middleware(settings, metrics),
    )
    for room in (
        allocation,
        evaluation,
        batch,
        algorithms,
        jobs,
        plans,
        missions,
        library,
        examples,
        operations,
    ):
        application.include_router(room.router)
    install_error_handlers(application)
    install_dashboard(application, settings)
    install_error_types(application)
    install_documentation(application, settings)
    return application


def _missions(
    store: MissionStore, jobs: JobService, settings: Settings, database: Database
) -> MissionService:
    """Make the missions, with a process of their own that is started when it is first needed."""
    judge = Judge(_local(1, _WARM_UP_JUDGE, (), settings, database))
    search = {"library_url": database.url, "threads": settings.threads_per_job}
    sizes = ("uavs", "targets", "no_fly_zones", "zone_corners")
    largest = {name: getattr(settings, f"max_{name}") for name in sizes}
    return MissionService(store, jobs, judge, search, largest, settings.mission_retention_s)


def _workers(settings: Settings, database: Database) -> Executor:
    """Make what runs the jobs."""
    arguments = *_largest(settings), database.url
    if settings.executor == "local":
        return _local(settings.workers, _WARM_UP, arguments, settings, database, _SEARCHES_LEAVE)
    return RayExecutor(
        settings.workers,
        address=settings.ray_address,
        resources=settings.worker_resources,
        warm_up=_WARM_UP,
        warm_up_arguments=arguments,
        environment=_environment(database),
        log_level=settings.log_level,
    )


def _largest(settings: Settings) -> tuple[int, int]:
    """Return the size of the largest problems that are taken, for which workers are warm."""
    return settings.max_uavs, settings.max_targets


def _local(
    slots: int,
    warm_up: str,
    arguments: tuple[Any, ...],
    settings: Settings,
    database: Database,
    niceness: int = 0,
) -> LocalExecutor:
    return LocalExecutor(
        slots,
        preload=_PRELOAD,
        warm_up=warm_up,
        warm_up_arguments=arguments,
        environment=_environment(database),
        log_level=settings.log_level,
        niceness=niceness,
    )


def _environment(database: Database) -> dict[str, str]:
    """Return the variables of a worker; under some of them it can open the database."""
    return {**SINGLE_THREADED, **KEEPS_MEMORY, **database.environment}


def _middleware(settings: Settings, metrics: Metrics) -> list[Middleware]:
    """List the middleware, outermost first: what adds to every response stands before what refuses."""
    listed = [
        Middleware(CorrelationIdMiddleware, validator=lambda given: _REQUEST_ID.fullmatch(given) is not None),
        Middleware(RequestLog, metrics=metrics),
        Middleware(SecurityHeaders),
        Middleware(
            GZipMiddleware,
            minimum_size=_COMPRESSED_FROM_BYTES,
            compresslevel=5,
            exclude_content_types=_SENT_AS_IT_IS,
        ),
    ]
    if settings.cors_origins:
        listed.append(
            Middleware(
                CORSMiddleware,
                allow_origins=settings.cors_origins,
                allow_methods=["GET", "POST", "DELETE"],
                allow_headers=_READ_HEADERS,
                expose_headers=_SENT_HEADERS,
            )
        )
    listed.append(
        Middleware(
            Guard,
            always=settings.always_needs_keys,
            never=settings.no_keys,
            hosts=Hosts(settings.host, settings.allowed_hosts),
        )
    )
    return [*listed, Middleware(BodyLimit, limit=settings.max_body_bytes), Middleware(HeadRequests)]
