"""Particle swarm optimisation with a variable neighbourhood search of the best position.

The swarm: Kennedy and Eberhart 1995, inertia falling as in Shi and Eberhart 1998. The hybrid for the
assignment of UAVs, with the neighbourhood search against local optima: Zhang, Feng and Yang, the paper's
[4].
"""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import Floats
from app.solvers.comparison_parameters import ParticleSwarmParameters
from app.solvers.swarms.key_search import KeyFlights, KeySearch


class ParticleSwarm(KeySearch[ParticleSwarmParameters]):
    """See :class:`~app.solvers.swarms.key_search.KeySearch`."""

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
            to_own, to_best = rng.random(at.shape), rng.random(at.shape)
            velocity *= inertia
            velocity += given.cognitive * to_own * (own - at) + given.social * to_best * (best - at)
            np.clip(velocity, -given.max_velocity, given.max_velocity, out=velocity)
            at = np.clip(at + velocity, 0.0, 1.0)
            found = flights.rewards(at)
            better = found > own_reward
            own[better], own_reward[better] = at[better], found[better]
            if own_reward.max() > reward:
                best, reward = own[np.argmax(own_reward)].copy(), float(own_reward.max())
            best, reward = variable_neighbourhoods(flights, best, reward, given.neighbours, rng)


def variable_neighbourhoods(
    flights: KeyFlights, best: Floats, reward: float, trials: int, rng: np.random.Generator
) -> tuple[Floats, float]:
    """Look for a better position in one neighbourhood after the other, beginning anew wherever one is found.

    The neighbourhoods: one key drawn anew; the keys of two UAVs for one stop exchanged; all keys of a UAV
    drawn anew.

    Parameters
    ----------
    flights
        The objective.
    best, reward
        (M, N + D) the position to improve, and what it earns.
    trials
        How many positions are tried at most.
    rng
        The only source of randomness.

    Returns
    -------
    best, reward
        The better position, or the same one.
    """
    kind = 0
    for _ in range(trials):
        if flights.budget.over():
            break
        tried = neighbour(best, kind, rng)
        found = float(flights.rewards(tried[None])[0])
        if found > reward:
            best, reward, kind = tried, found, 0
        else:
            kind = (kind + 1) % NEIGHBOURHOODS
    return best, reward


NEIGHBOURHOODS = 3
"""How many kinds of neighbours there are."""


def neighbour(keys: Floats, kind: int, rng: np.random.Generator) -> Floats:
    """Return a neighbour of a position, (M, N + D), of a kind below :data:`NEIGHBOURHOODS`."""
    near = keys.copy()
    m, stops = keys.shape
    i, j = int(rng.integers(m)), int(rng.integers(stops))
    if kind == 0:
        near[i, j] = rng.random()
    elif kind == 1:
        other = int(rng.integers(m))
        near[i, j], near[other, j] = keys[other, j], keys[i, j]
    else:
        near[i] = rng.random(stops)
    return near
