"""Playing episodes with the policy: in every step the surest UAV acts, then all are asked again.

So who acts first is the policy's choice, and each sees what those before it have committed to. Where there
are many UAVs, some act on one answer: those that are surest, no two at the same place.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.pairwise.agent import PairwiseAgent
from app.learning.pairwise.architecture import RETURNS_FROM
from app.learning.pairwise.gains import (
    Gains,
    begin_step,
    in_order,
    look,
    look_again,
    look_at,
    nearness,
    new_gains,
)
from app.learning.pairwise.inference import CompiledAgent, ask, compile_agent, place_bias
from app.learning.pairwise.observation import observe
from app.learning.pairwise.seen import Seen, new_seen
from app.learning.universal.episodes.observation import FORBIDDEN
from app.learning.universal.episodes.played import Played, acting_on_an_answer
from app.learning.universal.network.parallel import helpers, parallel_threads
from app.simulation.arrays import Flags, Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, close, end_step, new_episodes
from app.solvers.protocol import StopCriterion, no_spare_threads
from app.solvers.stop import never

# Where many UAVs are out, several act on one answer, so that a step takes about as many answers as with few.
_acting = compiled(acting_on_an_answer)


def play(
    agent: PairwiseAgent,
    arrays: ProblemArrays,
    problem: Integers,
    rng: np.random.Generator | None = None,
    temperature: float = 1.0,
    stop: StopCriterion = never,
    spare: Callable[[], int] = no_spare_threads,
    epsilon: Floats | None = None,
) -> Played:
    """Play one episode of each listed problem, all in lock-step.

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
        Asked before every answer; once it is true, every UAV that is still out flies home.
    spare
        Asked at every answer how many threads more it may use then.
    epsilon
        (B,) of sampled episodes, the chance that an action is any that is allowed, each as likely; none where
        None.
    """
    m, n, _ = arrays.shape
    batch, steps = len(problem), int(arrays.max_steps.max())
    episodes, gains = new_episodes(arrays, batch, problem), new_gains(arrays, batch)
    look(arrays, episodes, gains)
    plans, rewards = np.full((batch, steps, m), n, np.int64), np.zeros(batch)
    _close_empty(arrays, episodes, rewards)
    compiled_agent, sharpness = compile_agent(agent), float(agent.sharpness.detach().exp())
    biases = place_bias(agent, nearness(arrays, gains.span))
    seen = new_seen(batch, arrays)
    values = np.empty((batch, m, n + 1 + arrays.n_bases), np.float32)
    branch = list(range(batch)) if rng is None else problem.tolist()
    asked = np.empty(batch, np.int64)
    for s in range(steps):
        _begin_steps(arrays, episodes, gains, plans, s, rewards)
        while (count := _open(episodes, gains, asked)) > 0:
            if stop():
                _send_home(arrays, episodes, rewards)
                return Played(plans, rewards)
            who = asked[:count]
            # Sampled episodes begin alike: those that are still the same are asked about once.
            _, first, place = np.unique([branch[b] for b in who], return_index=True, return_inverse=True)
            once = who[first]
            _observe_all(arrays, episodes, gains, once, seen)
            part = Seen(*(each[: len(once)] for each in seen))
            _ask_together(compiled_agent, part, biases, episodes.problem[once], values[: len(once)], spare())
            logits = values[place] * sharpness
            if rng is None:
                choice = most_likely(logits, n)
            else:
                if epsilon is not None:
                    explores = rng.random(logits.shape[:2]) < epsilon[who][:, None]
                    logits = np.where(explores[:, :, None] & np.isfinite(logits), 0.0, logits)
                choice = (logits / temperature + rng.gumbel(size=logits.shape)).argmax(axis=2)
            sure = _log_probability(logits, choice)
            _commit(arrays, episodes, gains, who, choice, sure, plans, s, rewards)
            if rng is not None:
                _branch_out(branch, who, plans[:, s], gains.acted)
        _end_steps(arrays, episodes, gains, rewards)
        if episodes.done.all():
            break
    return Played(plans, rewards)


def most_likely(logits: Float32s, home: int) -> Integers:
    """Return each UAV's action, (B, M): "return" if it is likely enough, otherwise the likeliest place.

    Parameters
    ----------
    logits
        (B, M, N+1+D), minus infinity where an action is not allowed.
    home
        The number of "return".
    """
    places = logits.copy()
    places[:, :, home] = -np.inf
    choice = places.argmax(axis=2)
    best = np.take_along_axis(places, choice[:, :, None], axis=2)
    with np.errstate(invalid="ignore", over="ignore"):
        # Odds of a return against all places together; infinite or undefined where there is none.
        odds = np.exp(logits[:, :, home] - best[:, :, 0]) / np.exp(places - best).sum(axis=2)
    return np.where(odds < RETURNS_FROM / (1 - RETURNS_FROM), choice, home)


def _log_probability(logits: Float32s, choice: Integers) -> Floats:
    """Return that of each UAV's choice, (B, M), from the odds of all else: so none is rounded to 0."""
    chosen = np.take_along_axis(logits, choice[:, :, None], axis=2)
    with np.errstate(over="ignore"):
        odds = np.exp((logits - chosen).astype(np.float64))
    np.put_along_axis(odds, choice[:, :, None], 0.0, axis=2)
    return np.asarray(-np.log1p(odds.sum(axis=2)))


def _branch_out(branch: list[int], who: Integers, joint: Integers, acted: Flags) -> None:
    """Number the episodes anew by what they had in common, and what their UAVs have done since."""
    known: dict[tuple[int, bytes], int] = {}
    offset = max(branch) + 1
    for b in who:
        done = np.where(acted[b], joint[b], -1).tobytes()
        branch[b] = known.setdefault((branch[b], done), offset + len(known))


def _ask_together(
    agent: CompiledAgent, seen: Seen, biases: Float32s, problem: Integers, values: Float32s, spare: int
) -> None:
    """Do what :func:`ask` does with up to so many threads more; the values are the same with any number."""
    states = len(problem)
    parts = min(parallel_threads(spare), states)
    if parts <= 1:
        ask(agent, seen, biases, problem, values)
        return
    ends = [states * part // parts for part in range(parts + 1)]
    mine, *others = (
        (Seen(*(each[a:b] for each in seen)), biases, problem[a:b], values[a:b]) for a, b in pairwise(ends)
    )
    pending = [helpers().submit(ask, agent, *other) for other in others]
    ask(agent, *mine)
    for each in pending:
        each.result()


@njit(cache=True, nogil=True, error_model="numpy")
def _close_empty(arrays: ProblemArrays, episodes: Episodes, rewards: Floats) -> None:
    """Let all fly home where nobody may do anything else from the beginning: that too can cost reward."""
    for b in range(episodes.done.shape[0]):
        if episodes.done[b]:
            rewards[b] += close(arrays, episodes, b)


@njit(cache=True, nogil=True, error_model="numpy")
def _begin_steps(
    arrays: ProblemArrays, episodes: Episodes, gains: Gains, plans: Integers, s: int, rewards: Floats
) -> None:
    for b in range(episodes.done.shape[0]):
        if episodes.done[b]:
            continue
        begin_step(episodes, gains, b)
        rewards[b] += send_idle(arrays, episodes, gains, b, plans[b, s])


@compiled
def send_idle(arrays: ProblemArrays, episodes: Episodes, gains: Gains, b: int, joint: Integers) -> float:
    """Send home whoever may do nothing else, and return what that earns."""
    earned = 0.0
    for i in range(episodes.at.shape[1]):
        if not gains.acted[b, i] and not _may_act(gains, b, i):
            joint[i] = gains.net.shape[2]
            earned += act(arrays, episodes, b, i, joint[i])
            look_again(arrays, episodes, gains, b, i, joint[i])
    return earned


@compiled
def _may_act(gains: Gains, b: int, i: int) -> bool:
    """Whether a visit or a reload is allowed."""
    n = gains.net.shape[2]
    for j in range(n):
        if gains.net[b, i, j] > FORBIDDEN:
            return True
    found = False
    for d in range(gains.reloads.shape[2]):
        found |= gains.reloads[b, i, d]
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _open(episodes: Episodes, gains: Gains, asked: Integers) -> int:
    """List the episodes in which somebody has to act in this step; return how many they are."""
    count = 0
    for b in range(episodes.done.shape[0]):
        if not episodes.done[b] and not gains.acted[b].all():
            asked[count] = b
            count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _observe_all(arrays: ProblemArrays, episodes: Episodes, gains: Gains, who: Integers, seen: Seen) -> None:
    for t in range(len(who)):
        observe(arrays, episodes, gains, who[t], seen, t)


@njit(cache=True, nogil=True, error_model="numpy")
def _commit(
    arrays: ProblemArrays,
    episodes: Episodes,
    gains: Gains,
    who: Integers,
    choice: Integers,
    sure: Floats,
    plans: Integers,
    s: int,
    rewards: Floats,
) -> None:
    """Let the surest UAVs of each listed episode act."""
    m, n = gains.net.shape[1], gains.net.shape[2]
    for q in range(len(who)):
        b = who[q]
        out = 0
        for i in range(m):
            out += not episodes.ret[b, i]
        left = _acting(out)
        taken = np.zeros(n + 1 + gains.reloads.shape[2], np.bool_)
        for i in np.argsort(-sure[q]):
            if left == 0:
                break
            a = choice[q, i]
            if gains.acted[b, i] or taken[a] or not in_order(arrays, episodes, gains, b, i, a):
                continue
            plans[b, s, i] = a
            rewards[b] += act(arrays, episodes, b, i, a)
            look_again(arrays, episodes, gains, b, i, a)
            taken[a] = a < n
            left -= 1
        rewards[b] += send_idle(arrays, episodes, gains, b, plans[b, s])


@njit(cache=True, nogil=True, error_model="numpy")
def _end_steps(arrays: ProblemArrays, episodes: Episodes, gains: Gains, rewards: Floats) -> None:
    for b in range(episodes.done.shape[0]):
        if not episodes.done[b]:
            rewards[b] += end_step(arrays, episodes, b)
            for i in range(episodes.at.shape[1]):
                look_at(arrays, episodes, gains, b, i)


@njit(cache=True, nogil=True, error_model="numpy")
def _send_home(arrays: ProblemArrays, episodes: Episodes, rewards: Floats) -> None:
    for b in range(episodes.done.shape[0]):
        if not episodes.done[b]:
            rewards[b] += close(arrays, episodes, b)
