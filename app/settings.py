"""Every setting of the service, read once by the composition root; nothing else reads the environment."""

from __future__ import annotations

import ipaddress
import json
import re
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from app.processors import usable_processors

Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False)]

OWN_CLUSTER = "local"

_ANY = "*"
_ORIGIN = re.compile(r"[a-z][a-z0-9+.-]*://[^/\s,]+", re.IGNORECASE)
_HOST = re.compile(r"[^/:\s]+")

_SECONDS_A_DAY = 86_400.0
_PUTTING_BACK_S = 2.0
"""What is left of the time for a shutdown when the jobs that still run are put back into the queue."""


def _is_network(text: str) -> bool:
    """Whether a text is an address, or a network in the form of 192.0.2.0/24."""
    try:
        ipaddress.ip_network(text, strict=False)
    except ValueError:
        return False
    return True


class Settings(BaseSettings):
    """What an operator can set, by an environment variable ``ALLOCATOR_`` and the name in capitals."""

    model_config = SettingsConfigDict(
        env_prefix="ALLOCATOR_", env_parse_none_str="null", frozen=True, extra="forbid"
    )

    host: str = Field(default="127.0.0.1", description="Address the server listens on")
    port: int = Field(
        default=8000, ge=0, le=65_535, description="Port the server listens on; 0: any free one"
    )
    data_dir: Path = Field(default=Path("data"), description="Folder of the database; made where missing")
    database_url: str | None = Field(
        default=None,
        description="SQLAlchemy URL of SQLite or PostgreSQL; default: the file `allocator.sqlite3` in the "
        "data folder",
    )

    no_keys: bool = Field(
        default=False,
        description="Take requests without API keys from everybody, also on addresses that others can reach",
    )
    require_keys: bool = Field(
        default=False,
        description="Need API keys also on an address that only this machine reaches, and before one was "
        "made: for a service behind a proxy on the same machine",
    )
    allowed_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Names by which clients may call the service, as in the header `Host`, with commas "
        "between them; `*`: any. Addresses, `localhost`, the name in `ALLOCATOR_HOST` and that of the "
        "machine are always taken; others are refused where no key is needed, and once this is set",
    )
    trusted_proxies: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Addresses or networks of proxies whose `X-Forwarded-For` and `X-Forwarded-Proto` are "
        "believed, with commas between them",
    )
    cors_origins: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(), description="Origins whose pages may call the service, with commas between them"
    )

    tile_url: str | None = Field(
        default=None,
        pattern=r"^https?://[A-Za-z0-9.{}:-]+/[^\s;,]*$",
        description="Tile server of the dashboard's map, such as `https://tiles.example/{z}/{x}/{y}.png`; "
        "default: none, and the map shows where land is",
    )
    tile_attribution: str = Field(default="", description="Whom the map names as the source of its tiles")
    overlay_file: Path | None = Field(
        default=None,
        description="File that the dashboard's map shows above land and tiles: GeoJSON (a FeatureCollection "
        "in degrees, at most 16 MiB) with borders, roads, names, or PMTiles with pictures, of any size",
    )

    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", description="What is logged at least: `debug`, `info`, `warning` or `error`"
    )
    workers: int = Field(
        default_factory=usable_processors,
        ge=1,
        le=256,
        description="Worker processes; default: one a processor",
    )
    threads_per_job: int = Field(
        default=1,
        ge=1,
        le=256,
        description="Cores that the search of one job keeps busy; workers times this: processors. "
        "Under a time limit it also uses those of idle workers",
    )
    executor: Literal["local", "ray"] = Field(
        default="local", description="Where jobs run: `local`, on this machine, or `ray`, on a Ray cluster"
    )
    ray_address: str = Field(
        default=OWN_CLUSTER,
        description="Head of the Ray cluster, `host:port`; `local`: one of this machine, started for it",
    )
    ray_resources: Annotated[dict[str, Annotated[float, Field(gt=0, allow_inf_nan=False)]], NoDecode] = Field(
        default_factory=dict,
        description='What a worker on Ray needs, a JSON object such as `{"CPU": 1, "large": 1}`; default: a '
        "CPU for each thread of a job",
    )
    queue_limit: int = Field(
        default=64, ge=0, description="Jobs of a lane that may wait; one more is answered with 429"
    )
    batch_limit: int = Field(
        default=1000,
        ge=1,
        description="Most allocations in a batch, and most of batches that may wait; more are taken in later",
    )
    job_grace_s: Seconds = Field(
        default=5.0,
        description="Seconds a job may go on after its cancellation or time limit; then it is killed",
    )
    shutdown_grace_s: Seconds = Field(
        default=10.0,
        description="Seconds a shutdown takes; 2 s before its end what still runs goes back to the queue",
    )
    max_run_s: float | None = Field(
        default=3600.0,
        gt=0,
        allow_inf_nan=False,
        description="Longest an allocation may run, in seconds; then it answers with its best plan; `null`: "
        "no limit",
    )
    max_training_s: float | None = Field(
        default=_SECONDS_A_DAY,
        gt=0,
        allow_inf_nan=False,
        description="Longest a training may run, in seconds; then what it learned is registered; `null`: no "
        "limit",
    )
    job_attempts: int = Field(
        default=3, ge=1, description="How often a job is tried whose worker or server died; then it fails"
    )

    job_retention_days: float | None = Field(
        default=30.0,
        ge=0,
        allow_inf_nan=False,
        description="Days until an ended job is deleted, with what it left; `null`: never",
    )
    mission_retention_days: float | None = Field(
        default=None,
        ge=0,
        allow_inf_nan=False,
        description="Days without an event until a mission is deleted, with all that is kept of it; `null`: "
        "never",
    )

    receive_timeout_s: float = Field(
        default=20.0,
        gt=0,
        allow_inf_nan=False,
        description="Seconds a client has to send a request, or it gets 408, and after which its connection "
        "is closed if it has taken nothing of an answer",
    )
    max_body_bytes: int = Field(default=8 * 1024**2, ge=1024, description="Largest request body, in bytes")
    max_checkpoint_bytes: int = Field(
        default=16 * 1024**2, ge=1024, description="Largest checkpoint the library takes in, in bytes"
    )
    max_uavs: int = Field(default=1000, ge=1, description="Most UAVs in a problem")
    max_targets: int = Field(default=2000, ge=1, description="Most rescue areas in a problem")
    max_materials: int = Field(default=64, ge=1, description="Most kinds of material in a problem")
    max_bases: int = Field(default=100, ge=0, description="Most bases in a problem")
    max_no_fly_zones: int = Field(default=200, ge=0, description="Most no-fly zones in a problem")
    max_zone_corners: int = Field(
        default=1000, ge=0, description="Most corners of all no-fly zones of a problem together"
    )
    max_profiles: int = Field(default=16, ge=1, description="Most profiles of matrices in a problem")
    max_locations: int = Field(default=500, ge=1, description="Most rows of a matrix of legs")
    max_skills: int = Field(default=64, ge=1, description="Most skills of a UAV, or that an area asks for")

    @model_validator(mode="after")
    def _workers_reach_the_database(self) -> Self:
        elsewhere = self.executor == "ray" and self.ray_address != OWN_CLUSTER
        if elsewhere and self.resolved_database_url.startswith("sqlite"):
            raise ValueError(
                "workers on other machines cannot read an SQLite file: with ALLOCATOR_RAY_ADDRESS, "
                "ALLOCATOR_DATABASE_URL has to name a PostgreSQL database"
            )
        return self

    @model_validator(mode="after")
    def _keys_are_needed_or_not(self) -> Self:
        if self.no_keys and self.require_keys:
            raise ValueError("ALLOCATOR_NO_KEYS and ALLOCATOR_REQUIRE_KEYS exclude each other")
        return self

    @field_validator("ray_resources", mode="before")
    @classmethod
    def _parse(cls, given: object) -> object:
        if not isinstance(given, str):
            return given
        try:
            return json.loads(given)
        except ValueError as error:
            raise ValueError(f"is no JSON: {error}") from error

    @field_validator("cors_origins")
    @classmethod
    def _are_origins(cls, given: tuple[str, ...]) -> tuple[str, ...]:
        for each in given:
            if each != _ANY and not _ORIGIN.fullmatch(each):
                raise ValueError(f"{each!r} is no origin, such as https://maps.example or {_ANY}")
        return given

    @field_validator("allowed_hosts")
    @classmethod
    def _are_names(cls, given: tuple[str, ...]) -> tuple[str, ...]:
        for each in given:
            if each != _ANY and not _HOST.fullmatch(each) and not _is_network(each.strip("[]")):
                raise ValueError(f"{each!r} is no name of a host, without port and path")
        return given

    @field_validator("trusted_proxies")
    @classmethod
    def _are_addresses(cls, given: tuple[str, ...]) -> tuple[str, ...]:
        for each in given:
            if each != _ANY and not _is_network(each):
                raise ValueError(f"{each!r} is no address or network, such as 192.0.2.1")
        return given

    @field_validator("cors_origins", "allowed_hosts", "trusted_proxies", mode="before")
    @classmethod
    def _split(cls, given: object) -> object:
        if not isinstance(given, str):
            return given
        return tuple(each.strip() for each in given.split(",") if each.strip())

    @property
    def always_needs_keys(self) -> bool:
        """Whether requests need a key even while none was made: others than this machine can reach it."""
        if self.require_keys:
            return True
        if self.no_keys or self.host == "localhost":
            return False
        try:
            return not ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return True

    @property
    def worker_resources(self) -> dict[str, float]:
        """What a worker on Ray needs, the default filled in."""
        return dict(self.ray_resources) or {"CPU": float(self.threads_per_job)}

    @property
    def jobs_grace_s(self) -> float:
        """Seconds that running jobs get at a shutdown."""
        return max(0.0, self.shutdown_grace_s - _PUTTING_BACK_S)

    @property
    def mission_retention_s(self) -> float | None:
        """Seconds without an event until a mission is deleted; None: never."""
        days = self.mission_retention_days
        return None if days is None else days * _SECONDS_A_DAY

    @property
    def job_retention_s(self) -> float | None:
        """Seconds until an ended job is deleted; None: never."""
        return None if self.job_retention_days is None else self.job_retention_days * _SECONDS_A_DAY

    @property
    def resolved_database_url(self) -> str:
        """The database's URL, the default filled in."""
        return self.database_url or f"sqlite:///{self.data_dir.absolute() / 'allocator.sqlite3'}"
