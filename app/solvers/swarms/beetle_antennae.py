"""Beetle swarm optimisation: a particle swarm whose members feel with two antennae.

Beetle antennae search: Jiang and Li 2018. In a particle swarm: Wang, Yang and Liu 2018; for the assignment of
UAVs the paper's [8].
"""

from __future__ import annotations

import numpy as np

from app.solvers.comparison_parameters import BeetleAntennaeParameters
from app.solvers.swarms.key_search import KeyFlights, KeySearch


class BeetleAntennae(KeySearch[BeetleAntennaeParameters]):
    """See :class:`~app.solvers.swarms.key_search.KeySearch`; a beetle's move takes three evaluations."""

    def search(self, flights: KeyFlights, rng: np.random.Generator) -> None:
        """See :meth:`~app.solvers.swarms.key_search.KeySearch.search`."""
        given = self.parameters
        at = flights.drawn(given.swarm, rng)
        velocity = given.max_velocity * rng.uniform(-1.0, 1.0, at.shape)
        own, own_reward = at.copy(), flights.rewards(at)
        best, reward = own[np.argmax(own_reward)].copy(), float(own_reward.max())
        while not flights.budget.over():
            flights.best.tell()
            fraction = flights.budget.fraction()
            inertia = given.inertia_start + fraction * (given.inertia_end - given.inertia_start)
            # The step and the reach of the antennae fall geometrically.
            step = given.step * given.step_end**fraction
            to_own, to_best = rng.random(at.shape), rng.random(at.shape)
            velocity *= inertia
            velocity += given.cognitive * to_own * (own - at) + given.social * to_best * (best - at)
            np.clip(velocity, -given.max_velocity, given.max_velocity, out=velocity)
            reach = 0.5 * velocity
            right = flights.rewards(np.clip(at + reach, 0.0, 1.0))
            left = flights.rewards(np.clip(at - reach, 0.0, 1.0))
            if flights.budget.over():
                break
            felt = step * velocity * np.sign(right - left)[:, None, None]
            at = np.clip(at + given.swarm_share * velocity + (1.0 - given.swarm_share) * felt, 0.0, 1.0)
            found = flights.rewards(at)
            better = found > own_reward
            own[better], own_reward[better] = at[better], found[better]
            if own_reward.max() > reward:
                best, reward = own[np.argmax(own_reward)].copy(), float(own_reward.max())
