"""What the routes work with, and how they get it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request

from app.api.access.keys import KeyStore
from app.api.batch import Batches
from app.api.metrics import Metrics
from app.jobs.service import JobService
from app.missions.service import MissionService
from app.settings import Settings
from policy_store.database import Database
from policy_store.library import PolicyLibrary


@dataclass(frozen=True, slots=True)
class Services:
    """Everything that lives as long as the application runs."""

    settings: Settings
    database: Database
    library: PolicyLibrary
    jobs: JobService
    batches: Batches
    missions: MissionService
    keys: KeyStore
    metrics: Metrics


def _services(request: Request) -> Services:
    return cast(Services, request.app.state.services)


Served = Annotated[Services, Depends(_services)]
"""The parameter of a route that needs the services."""
