"""Stop criteria of tests."""

import math

from app.solvers.stop import Deadline


class When:
    """Stops when a function of the test says so; has no time limit."""

    def __init__(self, says):
        self._says = says

    def __call__(self):
        return bool(self._says())

    def seconds_left(self):
        return math.inf


def at_once():
    """A time limit that is over before anything begins."""
    return Deadline(0.0)


class After:
    """Lets so many looks pass, then stops; has no time limit."""

    def __init__(self, looks):
        self.left = looks
        self.asked = 0

    def __call__(self):
        self.asked += 1
        self.left -= 1
        return self.left < 0

    def seconds_left(self):
        return math.inf
