"""The agent network of one turn after the other, compiled: what roll-outs ask, without gradients.

The same function as :class:`~app.learning.universal.network.agent.UniversalAgent`, and tested against it.
A turn of a roll-out is some forty operations on small arrays, which PyTorch takes longer to begin than to do;
here all of a turn stays in the cache of the processor.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch

from app.learning.compute.kernels import (
    Float32s,
    add,
    affine,
    candidate,
    copy,
    dot,
    gelu,
    interpolate,
    kernel,
    normalise,
    sigmoid_of_sum,
)
from app.learning.compute.transformer import (
    Affine,
    Affines,
    affine_of,
    affines_of,
    array_of,
    attend,
    feed_forward,
)
from app.learning.universal.network.agent import UniversalAgent
from app.learning.universal.network.architecture import HEADS
from app.learning.universal.network.parallel import helpers, parallel_threads
from app.simulation.arrays import Integers
from app.simulation.compilation import njit

_ZERO, _LEAST = np.float32(0.0), np.float32(-3e38)


class CompiledAgent(NamedTuple):
    """The weights of an agent, by the names they have there."""

    pair_in: Affine
    pair_hidden: Affine
    rival_in: Affine
    rival_out: Affine
    own_in: Affine
    home: Float32s
    attention_norm: Affines
    attention_in: Affines
    attention_out: Affines
    feed_norm: Affines
    feed_in: Affines
    feed_out: Affines
    norm: Affine
    memory_input: Affine
    memory_hidden: Affine
    token_head: Affine
    memory_head: Affine
    score_weight: Float32s
    score_bias: Float32s


def compile_agent(agent: UniversalAgent) -> CompiledAgent:
    """Copy the weights of an agent, on whatever device it is."""
    weight_ih, weight_hh, bias_ih, bias_hh = agent.memory.all_weights[0]
    return CompiledAgent(
        pair_in=affine_of(agent.pair_in),
        pair_hidden=affine_of(agent.pair_hidden),
        rival_in=affine_of(agent.rival_in),
        rival_out=affine_of(agent.rival_out),
        own_in=affine_of(agent.own_in),
        home=array_of(agent.home),
        attention_norm=affines_of(agent.layers, "attention_norm"),
        attention_in=affines_of(agent.layers, "attention_in"),
        attention_out=affines_of(agent.layers, "attention_out"),
        feed_norm=affines_of(agent.layers, "feed_norm"),
        feed_in=affines_of(agent.layers, "feed_in"),
        feed_out=affines_of(agent.layers, "feed_out"),
        norm=affine_of(agent.norm),
        memory_input=Affine(array_of(weight_ih.t()), array_of(bias_ih)),
        memory_hidden=Affine(array_of(weight_hh.t()), array_of(bias_hh)),
        token_head=affine_of(agent.token_head),
        memory_head=affine_of(agent.memory_head),
        score_weight=array_of(agent.score.weight[0]),
        score_bias=array_of(agent.score.bias),
    )


@torch.inference_mode()
def attention_bias(agent: UniversalAgent, scaled: Float32s) -> Float32s:
    """Attention biases (P, L * H, N+1, N+1) of problems with scaled distances (P, N, N)."""
    biases: Float32s = agent.bias(torch.from_numpy(scaled).to(agent.home.device)).cpu().numpy()
    return biases


def ask_together(
    agent: CompiledAgent,
    pair: Float32s,
    own: Float32s,
    rivals: Float32s,
    bias: Float32s,
    problem: Integers,
    hidden: Float32s,
    values: Float32s,
    spare: int,
) -> None:
    """Do what :func:`ask` does with up to so many threads more; the values are the same with any number."""
    turns, tokens = values.shape
    parts = min(parallel_threads(spare), turns * tokens // _TOKENS_A_THREAD)
    if parts <= 1:
        ask(agent, pair, own, rivals, bias, problem, hidden, values)
        return
    ends = [turns * part // parts for part in range(parts + 1)]
    mine, *others = (
        (pair[a:b], own[a:b], rivals[a:b], bias, problem[a:b], hidden[a:b], values[a:b])
        for a, b in pairwise(ends)
    )
    asked = [helpers().submit(ask, agent, *other) for other in others]
    ask(agent, *mine)
    for each in asked:
        each.result()


_TOKENS_A_THREAD = 80
"""Half a millisecond of work, several times what handing it over takes."""


@njit(cache=True, nogil=True, error_model="numpy")
def ask(
    agent: CompiledAgent,
    pair: Float32s,
    own: Float32s,
    rivals: Float32s,
    bias: Float32s,
    problem: Integers,
    hidden: Float32s,
    values: Float32s,
) -> None:
    """Value the actions of T turns, and remember them.

    Parameters
    ----------
    agent
        Of width W.
    pair, own, rivals
        (T, N, F), (T, G) and (T, N, M, R) observations.
    bias
        (P, L * H, N+1, N+1) attention biases.
    problem
        (T,) which of them holds for a turn.
    hidden
        (T, W) recurrent states after the turn before; replaced by those after this one.
    values
        (T, N+1), filled with Q values in largest levels.
    """
    n, a, w = pair.shape[1], pair.shape[1] + 1, agent.home.shape[0]
    scratch = Scratch(
        mine=np.empty((1, w), np.float32),
        pooled=np.empty((n, w), np.float32),
        tokens=np.empty((a, w), np.float32),
        once=np.empty((a, w), np.float32),
        again=np.empty((a, w), np.float32),
        feed=np.empty((a, 2 * w), np.float32),
        mixed=np.empty((a, 3 * w), np.float32),
        query=np.empty((a, w // HEADS), np.float32),
        key=np.empty((w // HEADS, a), np.float32),
        value=np.empty((a, w // HEADS), np.float32),
        share=np.empty((a, a), np.float32),
        seen=np.empty((a, w // HEADS), np.float32),
        gates=np.empty((1, 3 * w), np.float32),
        recurrent=np.empty((1, 3 * w), np.float32),
    )
    for t in range(pair.shape[0]):
        _encode(agent, pair[t], own[t : t + 1], rivals[t], bias[problem[t]], scratch)
        _remember(agent, hidden[t : t + 1], scratch)
        _value(agent, hidden[t : t + 1], values[t], scratch)


class Scratch(NamedTuple):
    """Memory for a turn."""

    mine: Float32s
    pooled: Float32s
    tokens: Float32s
    once: Float32s
    again: Float32s
    feed: Float32s
    mixed: Float32s
    query: Float32s
    key: Float32s
    value: Float32s
    share: Float32s
    seen: Float32s
    gates: Float32s
    recurrent: Float32s


@kernel
def _encode(
    agent: CompiledAgent, pair: Float32s, own: Float32s, rivals: Float32s, bias: Float32s, scratch: Scratch
) -> None:
    """Fill the scratch's tokens (A, W)."""
    n = pair.shape[0]
    mine, tokens, once = scratch.mine, scratch.tokens, scratch.once
    affine(own, agent.own_in.weight, agent.own_in.bias, mine)
    for target in range(n):
        _pool(agent.rival_in, rivals[target], scratch.pooled[target])
    affine(scratch.pooled, agent.rival_out.weight, agent.rival_out.bias, once[:n])
    affine(pair, agent.pair_in.weight, agent.pair_in.bias, tokens[:n])
    for target in range(n):
        add(once[target], once[target], tokens[target])
        add(once[target], once[target], mine[0])
        gelu(once[target])
    affine(once[:n], agent.pair_hidden.weight, agent.pair_hidden.bias, tokens[:n])
    copy(tokens[n], agent.home)
    for token in range(n + 1):
        add(tokens[token], tokens[token], mine[0])
    for layer in range(agent.feed_in.bias.shape[0]):
        attend(agent, layer, bias[layer * HEADS : (layer + 1) * HEADS], scratch)
        feed_forward(agent, layer, scratch)
    for token in range(n + 1):
        normalise(tokens[token], agent.norm.weight, agent.norm.bias, once[token])
        copy(tokens[token], once[token])


@kernel
def _pool(rival_in: Affine, rivals: Float32s, pooled: Float32s) -> None:
    """Fill pooled (W,) with mean and maximum over what the others (M, R) could do at a target."""
    w, bias = rival_in.weight, rival_in.bias
    half, count = bias.shape[0], rivals.shape[0]
    mean, most = pooled[:half], pooled[half:]
    for c in range(half):
        mean[c], most[c] = _ZERO, _LEAST
    for other in range(count):
        f0, f1, f2 = rivals[other, 0], rivals[other, 1], rivals[other, 2]
        f3, f4, f5 = rivals[other, 3], rivals[other, 4], rivals[other, 5]
        if f0 == _ZERO:
            # A UAV that may not go there adds nothing.
            for c in range(half):
                most[c] = max(most[c], _ZERO)
            continue
        for c in range(half):
            one = bias[c] + f0 * w[0, c] + f1 * w[1, c] + f2 * w[2, c]
            one = f0 * max(one + f3 * w[3, c] + f4 * w[4, c] + f5 * w[5, c], _ZERO)
            mean[c] += one
            most[c] = max(most[c], one)
    share = np.float32(1.0) / np.float32(count)
    for c in range(half):
        mean[c] *= share


@kernel
def _remember(agent: CompiledAgent, hidden: Float32s, scratch: Scratch) -> None:
    """Replace hidden (1, W) by the state after seeing the tokens."""
    tokens, mean = scratch.tokens, scratch.once[:1]
    a, w = tokens.shape
    gates, recurrent = scratch.gates[0], scratch.recurrent[0]
    for c in range(w):
        mean[0, c] = _ZERO
    for token in range(a):
        add(mean[0], mean[0], tokens[token])
    share = np.float32(1.0) / np.float32(a)
    for c in range(w):
        mean[0, c] *= share
    affine(mean, agent.memory_input.weight, agent.memory_input.bias, scratch.gates)
    affine(hidden, agent.memory_hidden.weight, agent.memory_hidden.bias, scratch.recurrent)
    sigmoid_of_sum(gates[: 2 * w], recurrent[: 2 * w])
    candidate(gates[2 * w :], gates[:w], recurrent[2 * w :])
    interpolate(hidden[0], gates[2 * w :], gates[w : 2 * w], hidden[0])


@kernel
def _value(agent: CompiledAgent, hidden: Float32s, values: Float32s, scratch: Scratch) -> None:
    """Fill values (A,)."""
    tokens, once, memory = scratch.tokens, scratch.once, scratch.mine
    affine(hidden, agent.memory_head.weight, agent.memory_head.bias, memory)
    affine(tokens, agent.token_head.weight, agent.token_head.bias, once)
    for token in range(tokens.shape[0]):
        add(once[token], once[token], memory[0])
        gelu(once[token])
        values[token] = dot(once[token], agent.score_weight) + agent.score_bias[0]
