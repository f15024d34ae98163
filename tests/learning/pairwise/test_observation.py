"""Every feature of the observation is what its name says, by a plain reading on states of many problems."""

from typing import NamedTuple

import numpy as np
import pytest
from plain_sight import area_row, base_row, reload_row, uav_row, visit_row
from plain_state import PlainState
from problems import strained
from worlds import random_sorties, random_world

from app.domain.problem import Problem
from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)
from app.learning.pairwise.gains import begin_step, in_order, look, look_again, look_at, new_gains
from app.learning.pairwise.observation import observe
from app.learning.pairwise.seen import Seen, new_seen
from app.simulation.arrays import compile_problem
from app.simulation.drawn_generator import drawn
from app.simulation.generator import FAMILIES, generate
from app.simulation.simulator import act, end_step, new_episodes, verdict
from app.simulation.visit import ALLOWED

KINDS = (UavFeature, AreaFeature, BaseFeature, VisitFeature, ReloadFeature)
FEATURES = [(kind, feature) for kind in KINDS for feature in kind]


class Pair(NamedTuple):
    """A number seen, by the policy and by the plain reading, and where."""

    seen: float
    plain: float
    where: str


def problems():
    """Problems of all kinds, small enough for plain Python."""
    rng = np.random.default_rng(20)
    for family in FAMILIES:
        yield family, strained(generate(family, 3, 5, 2, rng), rng)
    for number in range(10):
        yield f"drawn {number}", drawn(3, 5, int(rng.integers(1, 4)), rng)
    yield "more areas than are near", drawn(2, 20, 2, rng)
    for number in range(24):
        yield f"world {number}", random_world(rng)
    for number in range(40):
        yield f"sorties {number}", random_sorties(rng, 3, 5)


class Game:
    """A problem that the simulator and the plain reading play side by side."""

    def __init__(self, problem: Problem):
        self.plain, self.arrays = PlainState(problem), compile_problem(problem)
        self.episodes, self.gains = new_episodes(self.arrays, 1), new_gains(self.arrays, 1)
        look(self.arrays, self.episodes, self.gains)
        begin_step(self.episodes, self.gains, 0)

    def choices(self, i):
        places = range(self.plain.n + 1 + self.plain.d)
        return [
            j
            for j in places
            if j != self.plain.n
            and verdict(self.arrays, self.episodes, 0, i, j) == ALLOWED
            and in_order(self.arrays, self.episodes, self.gains, 0, i, j)
        ]

    def act(self, i, action):
        act(self.arrays, self.episodes, 0, i, action)
        look_again(self.arrays, self.episodes, self.gains, 0, i, action)
        self.plain.act(i, action)

    def end_step(self):
        end_step(self.arrays, self.episodes, 0)
        for i in range(self.plain.m):
            look_at(self.arrays, self.episodes, self.gains, 0, i)
        begin_step(self.episodes, self.gains, 0)
        self.plain.end_step()

    def observe(self) -> Seen:
        # What was there before must not be seen.
        seen = Seen(*(np.full_like(part, np.nan) for part in new_seen(1, self.arrays)))
        observe(self.arrays, self.episodes, self.gains, 0, seen, 0)
        return Seen(*(part[0] for part in seen))


def states(problem, rng):
    """Play any allowed actions, UAVs in any order, and yield the game in states between them."""
    game = Game(problem)
    yield game
    while not game.episodes.done[0]:
        for i in rng.permutation(game.plain.m):
            if game.gains.acted[0, i]:
                continue
            choices = game.choices(i)
            game.act(i, int(rng.choice(choices)) if choices and rng.random() < 0.9 else game.plain.n)
            if rng.random() < 0.4:
                yield game
        game.end_step()
        if not game.episodes.done[0]:
            yield game


def plain_rows(plain):
    """(kind, place, row) of everything that is seen, by the plain reading."""
    for i in range(plain.m):
        yield UavFeature, (i,), uav_row(plain, i)
        for j in range(plain.n):
            yield VisitFeature, (i, j), visit_row(plain, i, j)
        for d in range(plain.d):
            yield ReloadFeature, (i, d), reload_row(plain, i, d)
    for j in range(plain.n):
        yield AreaFeature, (j,), area_row(plain, j)
    for d in range(plain.d):
        yield BaseFeature, (d,), base_row(plain, d)


@pytest.fixture(scope="module")
def pairs():
    """Every feature's numbers, seen and plain."""
    found = {each: [] for each in FEATURES}
    rng = np.random.default_rng(21)
    for name, problem in problems():
        for game in states(problem, rng):
            seen = game.observe()
            parts = dict(
                zip((UavFeature, AreaFeature, BaseFeature, VisitFeature, ReloadFeature), seen, strict=True)
            )
            for kind, place, row in plain_rows(game.plain):
                for feature in kind:
                    where = f"{name}, step {game.plain.step}, {place}"
                    value = float(parts[kind][place][feature])
                    found[kind, feature].append(Pair(value, float(row.get(feature.name, 0.0)), where))
    return found


@pytest.mark.parametrize(
    ("kind", "feature"), FEATURES, ids=[f"{kind.__name__}.{each.name}" for kind, each in FEATURES]
)
def test_a_feature_is_what_its_name_says(pairs, kind, feature):
    numbers = pairs[kind, feature]
    different = [each for each in numbers if abs(each.seen - each.plain) > 2e-5]
    assert not different, different[:5]
    assert not any(np.isnan(each.seen) for each in numbers)
    assert len({round(each.plain, 3) for each in numbers}) > 1, "it never changed, so nothing was proved"
