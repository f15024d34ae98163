"""A service whose missions are flown by simulated vehicles."""

import threading
from collections.abc import Iterator

import httpx
import pytest
from live_service import SMALL, LiveService
from told_mission import ToldMission

from app.api.openapi_examples import example_problem


@pytest.fixture(scope="session")
def service(tmp_path_factory) -> Iterator[LiveService]:
    running = LiveService(tmp_path_factory.mktemp("mavlink"), workers=1, **SMALL).start()
    try:
        yield running.await_ready()
    finally:
        running.stop()


class Mission(ToldMission):
    """A mission as another client sees it, with the plan of a first search in force."""

    def __init__(self, url, **changes):
        problem = example_problem("cyclone-idai")
        problem = {key: problem[key] for key in problem if key not in {"algorithm", "time_limit_s"}}
        self.problem = {**problem, **changes}
        body = {"problem": self.problem, "time_limit_s": 0.3, "algorithm": "local_search"}
        super().__init__(url, body)

    def accept(self, name):
        """Accept the open proposal, once the search has ended; say whether there was one.

        Vehicles that are seen elsewhere than planned may outdate it before it is accepted: another one comes.
        """
        for attempt in range(20):
            while self.read()["searching"]:
                threading.Event().wait(0.05)
            found = [each for each in self.read("/proposals")["proposals"] if each["status"] == "open"]
            if not found:
                return False
            event = {"type": "proposal_accepted", "id": f"{name}-{attempt}", "proposal": found[0]["number"]}
            answer = httpx.post(f"{self.url}/events", json=event, timeout=60)
            if answer.status_code != 409:
                answer.raise_for_status()
                return True
        raise AssertionError(f"no proposal could be accepted: {answer.text}")

    def events(self, of_type):
        told = self.read("/events?limit=1000")["events"]
        return [each for each in told if each["type"] == of_type]


@pytest.fixture
def begin(service):
    """Begins missions."""
    return lambda **changes: Mission(service.url, **changes)
