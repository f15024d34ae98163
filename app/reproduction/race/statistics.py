"""Statistics of the race: means, interquartile means and profiles with bootstrap intervals.

What Agarwal et al. 2021 ask for, with scipy's bootstrap: their package rliable brings arch, seaborn and
pandas, which nothing else here needs. The strata are the places. What is drawn again within a place is
problems, each with all its seeds: runs on one problem are not independent draws of the place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Statistic = Callable[[Floats], Floats]

CONFIDENCE = 0.95
RESAMPLES = 2000
_SEED = 2022
_QUARTER = 0.25


class Estimate(NamedTuple):
    """A value and its interval; the interval is the value alone where there is nothing to draw again."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        if self.low == self.high:
            return f"{self.value:.3f}"
        return f"{self.value:.3f} [{self.low:.3f}, {self.high:.3f}]"


def mean(shares: Floats) -> Floats:
    """Return means over the last axis."""
    return np.asarray(shares.mean(axis=-1))


def interquartile_mean(shares: Floats) -> Floats:
    """Return means of the middle half of the last axis; values at its ends count by their parts in it."""
    ordered = np.sort(shares, axis=-1)
    count = ordered.shape[-1]
    cut = _QUARTER * count
    places = np.arange(count)
    weight = np.clip(np.minimum(places + 1 - cut, count - cut - places), 0.0, 1.0)
    return np.asarray((ordered * weight).sum(axis=-1) / weight.sum())


def share_above(threshold: float) -> Statistic:
    """Return the statistic of a performance profile: the part of the runs that reach a share."""
    return lambda shares: np.asarray((shares >= threshold).mean(axis=-1))


def estimate(strata: Sequence[Floats], statistic: Statistic) -> Estimate:
    """Estimate a statistic of all runs.

    Parameters
    ----------
    strata
        An array (P, S) a place: by problem and seed.
    statistic
        Of the last axis.
    """
    from scipy.stats import bootstrap  # noqa: PLC0415 - an extra

    def of_problems(*chosen: npt.NDArray[np.int64], axis: int = -1) -> Floats:  # noqa: ARG001 - the last one
        gathered = [stratum[places] for stratum, places in zip(strata, chosen, strict=True)]
        runs = [each.reshape(*each.shape[:-2], -1) for each in gathered]
        return statistic(np.concatenate(runs, axis=-1))

    numbers = [np.arange(len(stratum)) for stratum in strata]
    value = float(of_problems(*numbers))
    if min(map(len, strata)) < 2:
        return Estimate(value, value, value)
    drawn = bootstrap(
        numbers,
        of_problems,
        n_resamples=RESAMPLES,
        vectorized=True,
        axis=-1,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(_SEED),
        batch=200,
    ).confidence_interval
    return Estimate(value, float(drawn.low), float(drawn.high))


def improvement(ours: Sequence[Floats], theirs: Sequence[Floats], same: float = 1e-9) -> list[Floats]:
    """Return, by place, for each problem the probability that one of our runs earns more than one of theirs.

    Ties count a half. Each array is (P, 1), to be estimated by :func:`mean`.
    """
    found = []
    for our, their in zip(ours, theirs, strict=True):
        ahead = our[:, :, None] - their[:, None, :]
        won = (ahead > same) + 0.5 * (np.abs(ahead) <= same)
        found.append(won.mean(axis=(1, 2))[:, None])
    return found
