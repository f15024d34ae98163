"""Algorithm 2's similarity as a vectorised look-up.

The paper compares a new task with each source task in a loop: the sum of the squared differences of their
descriptions, keeping the smallest. Here the descriptions of a space are one matrix.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

# Rows a block: a block of differences stays in the processor's cache (256 rows of 64 numbers: 128 KiB).
_BLOCK_ROWS = 256


def squared_distances(
    matrix: npt.NDArray[np.float32], query: npt.NDArray[np.float32]
) -> npt.NDArray[np.float64]:
    """Return the sum of squared differences of every row from the query (Algorithm 2, line 3).

    The differences are taken and summed in double precision. Expanding the square,
    ``|a|² - 2ab + |b|²``, would be one matrix product, but cancels where it matters: between near tasks.

    Parameters
    ----------
    matrix
        Shape (P, D), finite.
    query
        Shape (D,), finite.

    Returns
    -------
    numpy.ndarray
        Shape (P,).
    """
    wide_query = query.astype(np.float64)
    distances = np.empty(len(matrix))
    for start in range(0, len(matrix), _BLOCK_ROWS):
        difference = matrix[start : start + _BLOCK_ROWS] - wide_query  # (≤ 256, D) float64
        np.einsum("pd,pd->p", difference, difference, out=distances[start : start + _BLOCK_ROWS])
    return distances


def nearest(
    matrix: npt.NDArray[np.float32], query: npt.NDArray[np.float32], k: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Find the k rows nearest to the query.

    Parameters
    ----------
    matrix
        Shape (P, D), finite; the descriptions of the source tasks in the order in which they were stored.
    query
        Shape (D,), finite; the description of the new task.
    k
        How many, at least 1. With fewer rows than that, all of them are returned.

    Returns
    -------
    indices
        Shape (min(k, P),), nearest first. Among equal distances the row stored last comes first:
        Algorithm 2 replaces its candidate when ``total <= min``.
    distances
        Shape (min(k, P),), their sums of squared differences.

    Raises
    ------
    ValueError
        If k is less than 1 or the shapes do not fit together.
    """
    if k < 1:
        raise ValueError(f"k is {k}, at least 1 neighbour can be asked for")
    if matrix.ndim != 2 or query.shape != matrix.shape[1:]:
        raise ValueError(f"a query of shape {query.shape} does not fit a matrix of shape {matrix.shape}")
    distances = squared_distances(matrix, query)
    candidates = np.arange(len(matrix))
    if k < len(matrix):
        # All that are as near as the k-th: the partition alone would choose among equals as it likes.
        threshold = np.partition(distances, k - 1)[k - 1]
        candidates = np.flatnonzero(distances <= threshold)
    order = np.lexsort((-candidates, distances[candidates]))[:k]
    indices = candidates[order]
    return indices, distances[indices]
