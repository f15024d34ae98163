"""The state of episodes: where every UAV is, when and with what, what is needed, and what was earned."""

from __future__ import annotations

from typing import NamedTuple

from app.simulation.arrays import Flags, Floats, Integers
from app.simulation.decorators import compiled


class Episodes(NamedTuple):
    """The state of B episodes in lock-step.

    Attributes
    ----------
    problem
        (B,) index into the stack of problems.
    at
        (B, M) where each UAV is: ``START``, a target or base, or N where it has landed for good.
    flown, clock
        (B, M) air length flown in this flight, and the time.
    aloft
        (B, M) time in the air in this flight, of UAVs for which it counts.
    visits
        (B, M) visits and reloads made.
    ret
        (B, M) UAVs that have been sent home.
    load
        (B, M, K) amounts still carried.
    stock
        (B, D, K) amounts still at the bases.
    need
        (B, N, K) amounts still needed.
    kept
        (B, M, W) visits of ``start_plan`` that were made.
    satisfaction, distance
        (B,) what the episode has earned, and flown against the reward.
    step
        (B,) decision steps closed.
    done
        (B,) episodes that are over.
    """

    problem: Integers
    at: Integers
    flown: Floats
    clock: Floats
    aloft: Floats
    visits: Integers
    ret: Flags
    load: Floats
    stock: Floats
    need: Floats
    kept: Flags
    satisfaction: Floats
    distance: Floats
    step: Integers
    done: Flags


@compiled
def copy_episode(episodes: Episodes, b: int, others: Episodes, other: int) -> None:
    """Put episode `b` in the place of one of others of the same problems."""
    others.problem[other] = episodes.problem[b]
    for i in range(episodes.at.shape[1]):
        others.at[other, i], others.visits[other, i] = episodes.at[b, i], episodes.visits[b, i]
        others.flown[other, i], others.clock[other, i] = episodes.flown[b, i], episodes.clock[b, i]
        others.aloft[other, i], others.ret[other, i] = episodes.aloft[b, i], episodes.ret[b, i]
        for k in range(episodes.load.shape[2]):
            others.load[other, i, k] = episodes.load[b, i, k]
        for w in range(episodes.kept.shape[2]):
            others.kept[other, i, w] = episodes.kept[b, i, w]
    for k in range(episodes.load.shape[2]):
        for j in range(episodes.need.shape[1]):
            others.need[other, j, k] = episodes.need[b, j, k]
        for d in range(episodes.stock.shape[1]):
            others.stock[other, d, k] = episodes.stock[b, d, k]
    others.satisfaction[other], others.distance[other] = episodes.satisfaction[b], episodes.distance[b]
    others.step[other], others.done[other] = episodes.step[b], episodes.done[b]
