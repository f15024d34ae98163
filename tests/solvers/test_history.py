"""A history of any length has its first and its newest evaluation, and evenly spaced ones between them."""

import itertools

import pytest

from app.solvers.protocol import MOST_EVALUATIONS, History


@pytest.mark.parametrize(
    "count", [1, 2, MOST_EVALUATIONS, MOST_EVALUATIONS + 1, MOST_EVALUATIONS + 2, 123_457]
)
def test_it_is_thinned_evenly(count):
    history = History()
    for epoch in range(count):
        history.add(epoch, -float(epoch))
    assert len(history.epoch) <= MOST_EVALUATIONS + 1
    assert history.reward == [-float(epoch) for epoch in history.epoch]
    assert history.epoch[0] == 0
    assert history.epoch[-1] == count - 1
    steps = [after - before for before, after in itertools.pairwise(history.epoch)]
    assert len(set(steps[:-1])) <= 1
    assert not steps or steps[-1] <= steps[0]
    if count <= MOST_EVALUATIONS:
        assert history.epoch == list(range(count))
    else:
        assert len(history.epoch) > MOST_EVALUATIONS // 2
