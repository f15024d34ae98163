"""Episodes of known plans, turn by turn: what each UAV saw, and what it did."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.universal.episodes.observation import VisitGains, look, look_again, new_gains, observe
from app.learning.universal.network.architecture import OWN_FEATURES, PAIR_FEATURES, RIVAL_FEATURES
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, end_step, new_episodes


class Turns(NamedTuple):
    """T turns of B episodes, in the order in which they are taken.

    Attributes
    ----------
    pair, own, rivals
        (T, N, F), (T, G) and (T, N, M, R) observations.
    action
        (T,) what was done.
    episode, step, uav
        (T,) where the turn belongs.
    reward
        (B, S) what each step of each episode earned.
    """

    pair: Float32s
    own: Float32s
    rivals: Float32s
    action: Integers
    episode: Integers
    step: Integers
    uav: Integers
    reward: Floats


def replay_turns(arrays: ProblemArrays, problem: Integers, plans: Integers) -> Turns:
    """Replay legal plans and write down every turn.

    Parameters
    ----------
    arrays
        A stack of problems of one shape.
    problem, plans
        (B,) and (B, S, M): the plans and whose they are.
    """
    episodes = new_episodes(arrays, len(plans), problem)
    gains = new_gains(arrays, len(plans))
    n = arrays.shape[1]
    most = plans.size
    turns = Turns(
        pair=np.empty((most, n, PAIR_FEATURES), np.float32),
        own=np.empty((most, OWN_FEATURES), np.float32),
        rivals=np.empty((most, n, plans.shape[2], RIVAL_FEATURES), np.float32),
        action=np.empty(most, np.int64),
        episode=np.empty(most, np.int64),
        step=np.empty(most, np.int64),
        uav=np.empty(most, np.int64),
        reward=np.zeros(plans.shape[:2]),
    )
    count = _replay_turns(arrays, episodes, gains, plans, turns)
    columns = {name: column[:count] for name, column in turns._asdict().items() if name != "reward"}
    return Turns(**columns, reward=turns.reward)


def of_uavs(turns: Turns, uavs: Integers) -> Turns:
    """Keep the turns of some UAVs only."""
    kept = np.isin(turns.uav, uavs)
    columns = {name: column[kept] for name, column in turns._asdict().items() if name != "reward"}
    return Turns(**columns, reward=turns.reward)


@njit(cache=True, nogil=True, error_model="numpy")
def _replay_turns(
    arrays: ProblemArrays, episodes: Episodes, gains: VisitGains, plans: Integers, turns: Turns
) -> int:
    look(arrays, episodes, gains)
    count = 0
    for b in range(plans.shape[0]):
        for s in range(plans.shape[1]):
            if episodes.done[b]:
                break
            gains.acted[b] = False
            for i in range(plans.shape[2]):
                if episodes.ret[b, i]:
                    gains.acted[b, i] = True
                    continue
                observe(
                    arrays,
                    episodes,
                    gains,
                    b,
                    i,
                    turns.pair[count],
                    turns.own[count],
                    turns.rivals[count],
                )
                turns.action[count] = plans[b, s, i]
                turns.episode[count], turns.step[count], turns.uav[count] = b, s, i
                turns.reward[b, s] += act(arrays, episodes, b, i, plans[b, s, i])
                look_again(arrays, episodes, gains, b, i, plans[b, s, i])
                gains.acted[b, i] = True
                count += 1
            turns.reward[b, s] += end_step(arrays, episodes, b)
    return count
