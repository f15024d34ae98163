"""A mission that is begun, read and told what happens over HTTP, as any client does it."""

import httpx


class ToldMission:
    """A mission of a running service.

    Parameters
    ----------
    url
        Of the service.
    body
        What the mission begins with.
    """

    def __init__(self, url, body):
        self.url = f"{url}/missions"
        self.id = self._ask("POST", json=body).json()["id"]
        self.url += f"/{self.id}"

    def _ask(self, method, path="", **content):
        return httpx.request(method, self.url + path, timeout=60, **content).raise_for_status()

    def read(self, path=""):
        return self._ask("GET", path).json()

    def tell(self, name, **event):
        return self._ask("POST", "/events", json={"id": name, **event}).json()
