"""Grey wolf optimisation: Mirjalili, Mirjalili and Lewis 2014; for the assignment of UAVs the paper's [5]."""

from __future__ import annotations

import numpy as np

from app.solvers.comparison_parameters import GreyWolfParameters
from app.solvers.swarms.key_search import KeyFlights, KeySearch

_LEADERS = 3
"""Alpha, beta and delta."""


class GreyWolf(KeySearch[GreyWolfParameters]):
    """See :class:`~app.solvers.swarms.key_search.KeySearch`."""

    def search(self, flights: KeyFlights, rng: np.random.Generator) -> None:
        """See :meth:`~app.solvers.swarms.key_search.KeySearch.search`."""
        at = flights.drawn(self.parameters.swarm, rng)
        leaders, led = at[:0], np.empty(0)
        while not flights.budget.over():
            reward = flights.rewards(at)
            # The leaders keep the best positions that the pack has been at.
            known, earned = np.concatenate([leaders, at]), np.concatenate([led, reward])
            order = np.argsort(-earned, kind="stable")[:_LEADERS]
            leaders, led = known[order], earned[order]
            flights.best.tell()
            # Falls from 2 to 0: above 1 wolves may pass by the prey, below they close in.
            a = 2.0 * (1.0 - flights.budget.fraction())
            drawn = np.zeros_like(at)
            for leader in leaders:
                reach = a * (2.0 * rng.random(at.shape) - 1.0)
                distance = np.abs(2.0 * rng.random(at.shape) * leader - at)
                drawn += leader - reach * distance
            at = np.clip(drawn / len(leaders), 0.0, 1.0)
