"""UAVs that decide at the same time, as the paper's do: what the turns within a step are measured against.

All UAVs see the state at the beginning of a step. Their choices are carried out in index order; where an
earlier UAV has made a visit pointless, the next best one by the same values is taken, as in paper mode.
"""

from __future__ import annotations

import numpy as np
import torch
from numba import njit

from app.learning.universal.episodes.observation import (
    FORBIDDEN,
    look,
    look_again,
    nearness,
    new_gains,
    observe,
)
from app.learning.universal.episodes.played import Played
from app.learning.universal.episodes.turns import Turns
from app.learning.universal.network.architecture import OWN_FEATURES, PAIR_FEATURES, RIVAL_FEATURES
from app.simulation.simulator import act, end_step, new_episodes


def replay_turns_at_once(arrays, problem, plans):
    """Like :func:`app.learning.universal.episodes.turns.replay_turns`, but for what each UAV sees."""
    episodes, gains = new_episodes(arrays, len(plans), problem), new_gains(arrays, len(plans))
    m, n, _ = arrays.shape
    most = plans.size
    turns = Turns(
        pair=np.empty((most, n, PAIR_FEATURES), np.float32),
        own=np.empty((most, OWN_FEATURES), np.float32),
        rivals=np.empty((most, n, m, RIVAL_FEATURES), np.float32),
        action=np.empty(most, np.int64),
        episode=np.empty(most, np.int64),
        step=np.empty(most, np.int64),
        uav=np.empty(most, np.int64),
        reward=np.zeros(plans.shape[:2]),
    )
    count = _replay_turns(arrays, episodes, gains, plans, turns)
    columns = {name: column[:count] for name, column in turns._asdict().items() if name != "reward"}
    return Turns(**columns, reward=turns.reward)


@torch.inference_mode()
def play_at_once(agent, arrays, problem, rng=None):
    """Like :func:`app.learning.universal.episodes.rollout.play`; a step's UAVs decide on the same state."""
    m, n, _ = arrays.shape
    batch, steps = len(problem), int(arrays.max_steps.max())
    episodes, gains = new_episodes(arrays, batch, problem), new_gains(arrays, batch)
    look(arrays, episodes, gains)
    plans, rewards = np.full((batch, steps, m), n, np.int64), np.zeros(batch)
    scaled = torch.from_numpy(nearness(arrays, gains.span))
    bias, hidden = agent.bias(scaled), torch.zeros(m, batch, agent.home.shape[0])
    pair = np.empty((batch, n, PAIR_FEATURES), np.float32)
    own = np.empty((batch, OWN_FEATURES), np.float32)
    rivals = np.empty((batch, n, m, RIVAL_FEATURES), np.float32)
    turn = np.empty(batch, np.int64)
    for s in range(steps):
        preferences = np.zeros((m, batch, n + 1))
        for i in range(m):
            count = _observe(arrays, episodes, gains, i, pair, own, rivals, turn)
            if not count:
                continue
            who = torch.from_numpy(turn[:count])
            tokens = agent.encode(
                torch.from_numpy(pair[:count]),
                torch.from_numpy(own[:count]),
                torch.from_numpy(rivals[:count]),
                bias[episodes.problem[turn[:count]]],
            )
            hidden[i, who] = agent.remember(tokens, hidden[i, who])
            logits = agent.logits(agent.values(tokens, hidden[i, who])).numpy()
            noise = 0.0 if rng is None else rng.gumbel(size=logits.shape)
            preferences[i, turn[:count]] = logits + noise
        _take(arrays, episodes, gains, preferences, plans[:, s], rewards)
        if episodes.done.all():
            break
    return Played(plans, rewards)


@njit(error_model="numpy")
def _replay_turns(arrays, episodes, gains, plans, turns):
    look(arrays, episodes, gains)
    count = 0
    for b in range(plans.shape[0]):
        for s in range(plans.shape[1]):
            if episodes.done[b]:
                break
            for i in range(plans.shape[2]):
                if episodes.ret[b, i]:
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
                count += 1
            for i in range(plans.shape[2]):
                if not episodes.ret[b, i]:
                    turns.reward[b, s] += act(arrays, episodes, b, i, plans[b, s, i])
                    look_again(arrays, episodes, gains, b, i, plans[b, s, i])
            turns.reward[b, s] += end_step(arrays, episodes, b)
    return count


@njit(error_model="numpy")
def _observe(arrays, episodes, gains, i, pair, own, rivals, turn):
    count = 0
    for b in range(episodes.done.shape[0]):
        if episodes.done[b] or episodes.ret[b, i] or gains.net[b, i].max() <= FORBIDDEN:
            continue
        observe(arrays, episodes, gains, b, i, pair[count], own[count], rivals[count])
        turn[count] = b
        count += 1
    return count


@njit(error_model="numpy")
def _take(arrays, episodes, gains, preferences, joint, rewards):
    n = gains.net.shape[2]
    for b in range(episodes.done.shape[0]):
        if episodes.done[b]:
            continue
        for i in range(episodes.ret.shape[1]):
            if episodes.ret[b, i]:
                continue
            action = n
            for j in range(n):
                allowed = gains.net[b, i, j] > FORBIDDEN
                if allowed and preferences[i, b, j] > preferences[i, b, action]:
                    action = j
            joint[b, i] = action
            rewards[b] += act(arrays, episodes, b, i, action)
            look_again(arrays, episodes, gains, b, i, action)
        rewards[b] += end_step(arrays, episodes, b)
