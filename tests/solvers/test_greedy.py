"""The greedy rule against the same rule written down slowly over the referee."""

import numpy as np
import pytest
from problems import random_problem
from referee import Illegal, replay

from app.domain.records import problem_to_record
from app.simulation.evaluation import reward_of
from app.solvers.greedy import greedy_plan


def slow_greedy(record):
    m, n = len(record["uavs"]), len(record["targets"])
    rows = []
    out = [not uav["ret"] for uav in record["uavs"]]
    for _ in range(record["max_steps"]):
        rows.append([n] * m)
        for i in range(m):
            # After the last row every UAV flies home, so what a visit makes that leg cost is in it.
            before = replay(record, rows)["reward"]
            gains = {}
            for j in range(n) if out[i] else ():
                rows[-1][i] = j
                try:
                    gains[j] = replay(record, rows)["reward"] - before
                except Illegal:
                    continue
            best = max(gains, key=gains.get, default=None)
            worth = best is not None and gains[best] > 1e-12
            rows[-1][i], out[i] = (best, True) if worth else (n, False)
    return replay(record, rows)["reward"]


def test_takes_the_visit_that_earns_most_at_once():
    rng = np.random.default_rng(3)
    for _ in range(60):
        problem = random_problem(rng, max_uavs=4, max_targets=6)
        assert reward_of(problem, greedy_plan(problem)) == pytest.approx(
            slow_greedy(problem_to_record(problem)), abs=1e-9
        )
