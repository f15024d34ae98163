"""How much a request is given where it does not say: by the size of its problem, never by the clock.

A size is weighed by what the policy costs on it: an answer compares all UAVs and places with each other, and
there are some answers in each of S steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.learning.universal.episodes.played import answers_a_step
from app.simulation.arrays import ProblemArrays
from app.solvers.local_search.effort import default_moves

_MOST_WORK = 6e7
"""Work of a greedy roll-out that is done without being asked for; some seconds."""

_CHOOSING_WORK = 8e6
"""Work of all roll-outs at first sight together, of every policy that is tried."""

_POLICIES = 3
_ORDERS = 12

_LITTLE_WORK = 5e5
"""Work up to which there are more roll-outs than that, some milliseconds; `_MOST_ORDERS` at most."""

_MOST_ORDERS = 48

_SAMPLING_WORK = 6e6
"""Work of all sampled roll-outs together; about a third of a second."""

_SAMPLES = 64

_TUNING_WORK = 3e5
"""Work of a greedy roll-out up to which the policy is fine-tuned; an epoch takes tenths of a second there."""

_EPOCHS = 2
"""Within two seconds the search brings more than further epochs; these leave a policy to register."""

_EPISODES = 64
"""Episodes that an epoch of fine-tuning plays."""

_EPOCH_WORK = 4e6
"""Work of these together, about a tenth of a second; larger problems have fewer of them."""

_POLISH_SHARE = 0.3
"""Moves of the local search by those of ``local_search``; the rest of its time goes to the policy."""


@dataclass(frozen=True, slots=True)
class Effort:
    """What a request is given.

    Attributes
    ----------
    policy
        Whether a policy is rolled out at all.
    policies
        Policies of the shortlist that are tried, at least 1.
    orders
        Orders of UAVs in which each is rolled out, at least 1.
    samples, n_epochs, polish_moves
        By the names of the parameters.
    """

    policy: bool
    policies: int
    orders: int
    samples: int
    n_epochs: int
    polish_moves: int


def effort(arrays: ProblemArrays) -> Effort:
    """Return what a problem is given by default."""
    work = roll_out_work(arrays)
    most_orders = np.clip(_LITTLE_WORK / work, _ORDERS, _MOST_ORDERS)
    orders = int(np.clip(_CHOOSING_WORK / work, 1, most_orders))
    return Effort(
        policy=work <= _MOST_WORK,
        policies=int(np.clip(_CHOOSING_WORK / (orders * work), 1, _POLICIES)),
        orders=orders,
        samples=int(min(_SAMPLES, _SAMPLING_WORK / work)),
        n_epochs=_EPOCHS if work <= _TUNING_WORK else 0,
        polish_moves=round(_POLISH_SHARE * default_moves(arrays)),
    )


def roll_out_work(arrays: ProblemArrays) -> float:
    """Weigh a greedy roll-out: 20 million take about a second."""
    m, n, _ = arrays.shape
    tokens = m + n + arrays.n_bases
    pairs = m * n
    # What is seen of many pairs does not stay in the processor's cache.
    answer = 124 * tokens + 0.05 * tokens**2 + 3 * pairs + 1.7e-4 * pairs**2
    return float(int(arrays.max_steps[0]) * answers_a_step(m) * answer)


def episodes_of(arrays: ProblemArrays, learned: int) -> int:
    """Return how many episodes an epoch plays that learns from so many of them."""
    most = int(min(_EPISODES, _EPOCH_WORK / roll_out_work(arrays)))
    return batch_of(arrays, max(learned, most))


def batch_of(arrays: ProblemArrays, most: int) -> int:
    """Return how many episodes may be played at once within 64 MiB, at least 1 and at most `most`."""
    m, n, _ = arrays.shape
    episode = 1000 * n * m + 4000 * (m + n)
    return max(1, min(most, 2**26 // episode))
