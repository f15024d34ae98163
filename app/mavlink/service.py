"""The service, as a client of its API sees it: a mission, its plan in force, and what is told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.mavlink.errors import PackageMissing, ServiceAway, ServiceRefused

try:
    import httpx

    from app.client.exchange import one_part
except ModuleNotFoundError as error:
    raise PackageMissing("httpx") from error

_PATIENCE_S = 10.0
_TOO_MANY, _BROKEN = 429, 500


class MissionClient:
    """A mission of a service.

    Parameters
    ----------
    url
        Of the service.
    mission_id
        As the service gave it; one part of a path, whatever it is.
    key
        API key; None without.
    """

    def __init__(self, url: str, mission_id: str, key: str | None) -> None:
        headers = {} if key is None else {"Authorization": f"Bearer {key}"}
        self._http = httpx.Client(base_url=url.rstrip("/"), headers=headers, timeout=_PATIENCE_S)
        self._path = f"/missions/{one_part(mission_id)}"

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def mission(self) -> dict[str, Any]:
        """Return the mission as it stands.

        Raises
        ------
        ServiceAway, ServiceRefused
            As all methods: if it cannot be had now, or at all.
        """
        return self._ask("GET", self._path, "the mission")

    def plan(self) -> dict[str, Any]:
        """Return the plan in force."""
        return self._ask("GET", f"{self._path}/plan", "the plan")

    def matrices(self) -> dict[str, Any] | None:
        """Return the matrices of the mission's problem, which states leave out; None without."""
        problem: dict[str, Any] = self._ask("GET", f"{self._path}/replay", "the replay")["problem"]
        return problem.get("matrices")

    def tell(self, event: Mapping[str, Any]) -> dict[str, Any]:
        """Tell an event; the same event with the same id again is not a second one."""
        return self._ask("POST", f"{self._path}/events", f"event {event['type']!r}", json=dict(event))

    def _ask(self, method: str, path: str, what: str, **content: Any) -> dict[str, Any]:
        try:
            answer = self._http.request(method, path, **content)
        except httpx.TransportError as error:
            raise ServiceAway(f"{what}: {error}") from error
        if answer.status_code == _TOO_MANY or answer.status_code >= _BROKEN:
            raise ServiceAway(f"{what}: the service answers {answer.status_code}")
        if not answer.is_success:
            raise ServiceRefused(answer.status_code, what, _detail_of(answer))
        told: dict[str, Any] = answer.json()
        return told


def _detail_of(answer: httpx.Response) -> str:
    try:
        return str(answer.json()["detail"])
    except (ValueError, KeyError, TypeError):
        return answer.text[:200]
