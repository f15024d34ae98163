"""Playing episodes with the policy: greedily, or sampling from it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.universal.episodes.observation import (
    FORBIDDEN,
    VisitGains,
    look,
    look_again,
    nearness,
    new_gains,
    observe,
)
from app.learning.universal.episodes.played import Played
from app.learning.universal.network.agent import UniversalAgent
from app.learning.universal.network.architecture import OWN_FEATURES, PAIR_FEATURES, RIVAL_FEATURES
from app.learning.universal.network.inference import ask_together, attention_bias, compile_agent
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, close, end_step, new_episodes
from app.solvers.protocol import StopCriterion, no_spare_threads
from app.solvers.stop import never


def play(
    agent: UniversalAgent,
    arrays: ProblemArrays,
    problem: Integers,
    rng: np.random.Generator | None = None,
    temperature: float = 1.0,
    stop: StopCriterion = never,
    spare: Callable[[], int] = no_spare_threads,
    epsilon: Floats | None = None,
) -> Played:
    """Play one episode of each listed problem, all in lock-step, UAV after UAV.

    The network is not asked where "return" is all that is allowed: a UAV that returns has no later turn,
    so what it would remember of this one does not matter.

    Parameters
    ----------
    agent
        The policy, on any device; it is asked on the processor.
    arrays, problem
        A stack of problems, and (B,) which of them to play.
    rng
        Samples actions with these random numbers; greedy where None.
    temperature
        Of the sampling; less is greedier.
    stop
        Asked before every turn; once it is true, every UAV that is still out flies home.
    spare
        Asked at every turn how many threads more it may use then.
    epsilon
        (B,) of sampled episodes, the chance that a turn's action is any that is allowed, each as likely; none
        where None.
    """
    m, n, _ = arrays.shape
    batch, steps = len(problem), int(arrays.max_steps.max())
    episodes, gains = new_episodes(arrays, batch, problem), new_gains(arrays, batch)
    look(arrays, episodes, gains)
    plans = np.full((batch, steps, m), n, np.int64)
    rewards = np.zeros(batch)
    compiled, sharpness = compile_agent(agent), float(agent.sharpness.detach().exp())
    bias = attention_bias(agent, nearness(arrays, gains.span))
    hidden = np.zeros((m, batch, len(compiled.home)), np.float32)
    pair = np.empty((batch, n, PAIR_FEATURES), np.float32)
    own = np.empty((batch, OWN_FEATURES), np.float32)
    rivals = np.empty((batch, n, m, RIVAL_FEATURES), np.float32)
    turn = np.empty(batch, np.int64)
    branch, branches = problem.copy(), len(bias)
    for s in range(steps):
        gains.acted[:] = False
        for i in range(m):
            if i:
                gains.acted[:, i - 1] = True
            if stop():
                _send_home(arrays, episodes, rewards)
                return Played(plans, rewards)
            count = _observe_turn(arrays, episodes, gains, i, pair, own, rivals, turn, rewards)
            if not count:
                continue
            who = turn[:count]
            first = place = np.arange(count)
            if rng is not None:
                # Sampled episodes begin alike: those that are still the same are asked about once.
                _, first, place = np.unique(branch[who], return_index=True, return_inverse=True)
            once = who[first]
            remembered = hidden[i, once]
            values = np.empty((len(first), n + 1), np.float32)
            ask_together(
                compiled,
                pair[first],
                own[first],
                rivals[first],
                bias,
                episodes.problem[once],
                remembered,
                values,
                spare(),
            )
            hidden[i, who] = remembered[place]
            logits = values[place] * sharpness
            logits[:, :n][pair[:count, :, 0] == 0] = -np.inf
            if rng is not None:
                if epsilon is not None:
                    explores = rng.random(count) < epsilon[who]
                    logits[explores[:, None] & np.isfinite(logits)] = 0.0
                logits = logits / temperature + rng.gumbel(size=logits.shape)
            actions = logits.argmax(axis=1)
            if rng is not None:
                _, which = np.unique(place * (n + 1) + actions, return_inverse=True)
                branch[who] = branches + which
                branches += count
            _act_turn(arrays, episodes, gains, i, who, actions, plans, s, rewards)
        _end_steps(arrays, episodes, rewards)
        if episodes.done.all():
            break
    return Played(plans, rewards)


@njit(cache=True, nogil=True, error_model="numpy")
def _observe_turn(
    arrays: ProblemArrays,
    episodes: Episodes,
    gains: VisitGains,
    i: int,
    pair: Float32s,
    own: Float32s,
    rivals: Float32s,
    turn: Integers,
    rewards: Floats,
) -> int:
    """Observe for UAV `i` in every episode in which it may visit a target; return how many those are.

    Where it is out but may only return, it does.
    """
    count = 0
    for b in range(episodes.done.shape[0]):
        if episodes.done[b] or episodes.ret[b, i]:
            continue
        if gains.net[b, i].max() <= FORBIDDEN:
            rewards[b] += act(arrays, episodes, b, i, gains.net.shape[2])
        else:
            observe(arrays, episodes, gains, b, i, pair[count], own[count], rivals[count])
            turn[count] = b
            count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _act_turn(
    arrays: ProblemArrays,
    episodes: Episodes,
    gains: VisitGains,
    i: int,
    turn: Integers,
    actions: Integers,
    plans: Integers,
    s: int,
    rewards: Floats,
) -> None:
    for q in range(len(turn)):
        b, action = turn[q], actions[q]
        plans[b, s, i] = action
        rewards[b] += act(arrays, episodes, b, i, action)
        look_again(arrays, episodes, gains, b, i, action)


@njit(cache=True, nogil=True, error_model="numpy")
def _end_steps(arrays: ProblemArrays, episodes: Episodes, rewards: Floats) -> None:
    for b in range(episodes.done.shape[0]):
        if not episodes.done[b]:
            rewards[b] += end_step(arrays, episodes, b)


@njit(cache=True, nogil=True, error_model="numpy")
def _send_home(arrays: ProblemArrays, episodes: Episodes, rewards: Floats) -> None:
    for b in range(episodes.done.shape[0]):
        if not episodes.done[b]:
            rewards[b] += close(arrays, episodes, b)
