import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from policy_store.similarity import nearest


def algorithm_2(matrix: list[list[float]], query: list[float]) -> tuple[int, float]:
    """Return the source task and its total as the paper's loop finds them."""
    minimum, flag = math.inf, -1
    for i, row in enumerate(matrix):
        total = math.fsum((a - b) ** 2 for a, b in zip(row, query, strict=True))
        if total <= minimum:
            minimum, flag = total, i
    return flag, minimum


@st.composite
def questions(draw: st.DrawFn, elements: st.SearchStrategy[float]) -> tuple[np.ndarray, np.ndarray, int]:
    rows, dimension = draw(st.integers(1, 40)), draw(st.integers(1, 9))
    matrix = draw(npst.arrays(np.float32, (rows, dimension), elements=elements))
    query = draw(npst.arrays(np.float32, (dimension,), elements=elements))
    return matrix, query, draw(st.integers(1, rows + 2))


SMALL_INTEGERS = st.integers(-2, 2).map(float)  # sums are exact, and ties are frequent
ANY_FLOATS = st.floats(-(2.0**100), 2.0**100, width=32)


@given(questions(SMALL_INTEGERS))
def test_order_and_ties_are_those_of_algorithm_2_repeated(question) -> None:
    matrix, query, k = question
    indices, distances = nearest(matrix, query, k)

    left = list(range(len(matrix)))
    expected = []
    while left and len(expected) < k:
        flag, total = algorithm_2(matrix[left].tolist(), query.tolist())
        expected.append((left.pop(flag), total))
    assert list(zip(indices.tolist(), distances.tolist(), strict=True)) == expected


@given(questions(ANY_FLOATS))
def test_distances_of_any_numbers_are_those_of_exact_summation(question) -> None:
    matrix, query, k = question
    indices, distances = nearest(matrix, query, k)
    exact = [
        math.fsum((a - b) ** 2 for a, b in zip(row, query.tolist(), strict=True)) for row in matrix.tolist()
    ]
    assert len(set(indices.tolist())) == len(indices) == min(k, len(matrix))
    assert distances == pytest.approx([exact[index] for index in indices], rel=1e-12, abs=0)
    assert distances == pytest.approx(sorted(exact)[:k], rel=1e-12, abs=0)


def test_near_tasks_far_from_the_origin_are_told_apart() -> None:
    # Their squares agree in the first seven digits: |a|² - 2ab + |b|² in single precision gives noise.
    query = np.full(64, 1000.0, np.float32)
    matrix = np.stack([query + np.float32(step) for step in (0.5, 0.25, 0.0, 0.125)])
    indices, distances = nearest(matrix, query, 4)
    assert indices.tolist() == [2, 3, 1, 0]
    assert distances.tolist() == [0.0, 64 * 0.125**2, 64 * 0.25**2, 64 * 0.5**2]


def test_equal_rows_tie_wherever_they_stand() -> None:
    generator = np.random.default_rng(5)
    row, query = generator.normal(size=(2, 37)).astype(np.float32)
    matrix = np.tile(row, (1000, 1))
    indices, distances = nearest(matrix, query, 10)
    assert indices.tolist() == list(range(999, 989, -1))
    assert len(set(distances.tolist())) == 1


def test_a_large_library_agrees_with_brute_force() -> None:
    generator = np.random.default_rng(7)
    matrix = generator.random((20_000, 64), dtype=np.float32)
    query = generator.random(64, dtype=np.float32)
    exact = ((matrix.astype(np.float64) - query.astype(np.float64)) ** 2).sum(axis=1)
    indices, distances = nearest(matrix, query, 50)
    assert indices.tolist() == np.argsort(exact)[:50].tolist()
    assert distances == pytest.approx(exact[indices], rel=1e-13)


def test_no_rows_no_neighbours() -> None:
    indices, distances = nearest(np.empty((0, 3), np.float32), np.zeros(3, np.float32), 2)
    assert (len(indices), len(distances)) == (0, 0)


@pytest.mark.parametrize(("shape", "k"), [((4,), 1), ((3, 1), 1), ((3,), 0)])
def test_questions_that_make_no_sense_are_refused(shape: tuple[int, ...], k: int) -> None:
    with pytest.raises(ValueError, match=r"shape|at least 1"):
        nearest(np.zeros((2, 3), np.float32), np.zeros(shape, np.float32), k)
