"""The agent network, compiled: what roll-outs ask, without gradients.

The same function as :class:`~app.learning.pairwise.agent.PairwiseAgent`, and tested against it. A state of a
roll-out is some sixty operations on small arrays, which PyTorch takes longer to begin than to do; here all of
it stays in the cache of the processor, and pairs that are not allowed cost nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch

from app.learning.compute.kernels import (
    Float32s,
    add,
    affine,
    copy,
    dot,
    gelu,
    kernel,
    normalise,
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
from app.learning.pairwise.agent import PairwiseAgent
from app.learning.pairwise.seen import Seen
from app.learning.universal.network.architecture import HEADS
from app.simulation.arrays import Integers
from app.simulation.compilation import njit

_ZERO = np.float32(0.0)


class CompiledAgent(NamedTuple):
    """The weights of an agent, by the names they have there."""

    uav_in: Affine
    area_in: Affine
    base_in: Affine
    visit_in: Affine
    reload_in: Affine
    uav_pool: Affine
    area_pool: Affine
    base_pool: Affine
    visit_bias: Affine
    reload_bias: Affine
    attention_norm: Affines
    attention_in: Affines
    attention_out: Affines
    feed_norm: Affines
    feed_in: Affines
    feed_out: Affines
    norm: Affine
    uav_head: Affine
    area_head: Affine
    base_head: Affine
    visit_head: Affine
    reload_head: Affine
    home_head: Affine
    score_weight: Float32s
    score_bias: Float32s


_LINEAR = (
    "uav_in", "area_in", "base_in", "visit_in", "reload_in", "uav_pool", "area_pool", "base_pool",
    "visit_bias", "reload_bias", "norm", "uav_head", "area_head", "base_head", "visit_head", "reload_head",
    "home_head",
)  # fmt: skip
_LAYERS = ("attention_norm", "attention_in", "attention_out", "feed_norm", "feed_in", "feed_out")


def compile_agent(agent: PairwiseAgent) -> CompiledAgent:
    """Copy the weights of an agent, on whatever device it is."""
    parts: dict[str, Any] = {name: affine_of(getattr(agent, name)) for name in _LINEAR}
    parts |= {name: affines_of(agent.layers, name) for name in _LAYERS}
    return CompiledAgent(
        **parts,
        score_weight=array_of(agent.score.weight[0]),
        score_bias=array_of(agent.score.bias),
    )


@torch.inference_mode()
def place_bias(agent: PairwiseAgent, distance: Float32s) -> Float32s:
    """Attention biases (P, L * H, N+D, N+D) between places at scaled distances (P, N+D, N+D)."""
    biases: Float32s = agent.place_bias(torch.from_numpy(distance).to(agent.sharpness.device)).cpu().numpy()
    return np.ascontiguousarray(biases)


@njit(cache=True, nogil=True, error_model="numpy")
def ask(agent: CompiledAgent, seen: Seen, biases: Float32s, problem: Integers, values: Float32s) -> None:
    """Value the actions of all UAVs in T states.

    Parameters
    ----------
    agent
        Of width W.
    seen
        T states of M UAVs, N areas, D bases.
    biases
        (P, L * H, N+D, N+D) attention biases between places.
    problem
        (T,) which of them holds for a state.
    values
        (T, M, N+1+D), filled with Q values in largest levels; minus infinite where an action is not allowed.
    """
    m, n, d = seen.uavs.shape[1], seen.areas.shape[1], seen.bases.shape[1]
    w, a = agent.norm.bias.shape[0], m + n + d
    edges = agent.visit_bias.bias.shape[0]
    scratch = Scratch(
        listed=np.empty((m * max(n, d), max(seen.visits.shape[3], seen.reloads.shape[3])), np.float32),
        visits=np.empty((m * n, w // 2), np.float32),
        reloads=np.empty((m * d, w // 2), np.float32),
        by_uav=np.empty((m, 2 * w), np.float32),
        by_place=np.empty((n + d, w), np.float32),
        heads=np.empty((m * max(n, d), edges), np.float32),
        bias=np.empty((edges // 2, a, a), np.float32),
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
        pairs=np.empty((m * max(n, d), w), np.float32),
    )
    for t in range(len(problem)):
        _embed(agent, seen, t, biases[problem[t]], scratch)
        for layer in range(agent.feed_in.bias.shape[0]):
            attend(agent, layer, scratch.bias[layer * HEADS : (layer + 1) * HEADS], scratch)
            feed_forward(agent, layer, scratch)
        _score(agent, seen, t, scratch, values[t])


class Scratch(NamedTuple):
    """Memory for a state; A is M + N + D, E twice the layers times the heads.

    Attributes
    ----------
    listed, heads, pairs
        What is seen of allowed pairs, row by row, and what is made of that.
    visits, reloads
        (M N, W / 2) and (M D, W / 2) edges of allowed pairs, one after the other.
    by_uav, by_place
        (M, 2 W) and (N+D, W) what is pooled of them.
    bias
        (E / 2, A, A)
    """

    listed: Float32s
    heads: Float32s
    pairs: Float32s
    visits: Float32s
    reloads: Float32s
    by_uav: Float32s
    by_place: Float32s
    bias: Float32s
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


@kernel
def _embed(agent: CompiledAgent, seen: Seen, t: int, biases: Float32s, scratch: Scratch) -> None:
    """Fill tokens (A, W), edges and attention biases."""
    m, n, d = seen.uavs.shape[1], seen.areas.shape[1], seen.bases.shape[1]
    tokens, once, bias = scratch.tokens, scratch.once, scratch.bias
    half = scratch.visits.shape[1]
    for e in range(bias.shape[0]):
        for token in range(m):
            for other in range(bias.shape[1]):
                bias[e, token, other] = _ZERO
        for place in range(n + d):
            for other in range(m):
                bias[e, m + place, other] = _ZERO
            copy(bias[e, m + place, m:], biases[e, place])
    for i in range(m):
        for c in range(4 * half):
            scratch.by_uav[i, c] = _ZERO
    for place in range(n + d):
        for c in range(2 * half):
            scratch.by_place[place, c] = _ZERO
    _add_edges(agent.visit_in, agent.visit_bias, seen.visits[t], scratch.visits, scratch, 0)
    if d > 0:
        _add_edges(agent.reload_in, agent.reload_bias, seen.reloads[t], scratch.reloads, scratch, n)
    of_areas, of_bases, of_uavs = (
        np.float32(1.0) / np.float32(n),
        np.float32(1.0) / np.float32(max(d, 1)),
        np.float32(1.0) / np.float32(m),
    )
    for i in range(m):
        for c in range(half):
            scratch.by_uav[i, c] *= of_areas
            scratch.by_uav[i, 2 * half + c] *= of_bases
    for place in range(n + d):
        for c in range(half):
            scratch.by_place[place, c] *= of_uavs
    affine(seen.uavs[t], agent.uav_in.weight, agent.uav_in.bias, tokens[:m])
    affine(scratch.by_uav, agent.uav_pool.weight, agent.uav_pool.bias, once[:m])
    affine(seen.areas[t], agent.area_in.weight, agent.area_in.bias, tokens[m : m + n])
    affine(scratch.by_place[:n], agent.area_pool.weight, agent.area_pool.bias, once[m : m + n])
    if d > 0:
        affine(seen.bases[t], agent.base_in.weight, agent.base_in.bias, tokens[m + n :])
        affine(scratch.by_place[n:], agent.base_pool.weight, agent.base_pool.bias, once[m + n :])
    for token in range(m + n + d):
        add(tokens[token], tokens[token], once[token])


@kernel
def _add_edges(
    inner: Affine, heads: Affine, rows: Float32s, edges: Float32s, scratch: Scratch, first: int
) -> None:
    """Fill the edges of allowed pairs, pool them, and set what they add to the attention of their tokens.

    Parameters
    ----------
    inner, heads
        What makes edges, and biases of attention.
    rows
        (M, Q, F) what is seen of UAVs and Q places.
    edges
        (M Q, W / 2), filled as far as pairs are allowed, in their order.
    first
        Number of the first of the places.
    """
    m, places, features = rows.shape
    half, count = edges.shape[1], 0
    biases = scratch.bias.shape[0]
    listed, of_heads = scratch.listed[:, :features], scratch.heads
    for i in range(m):
        for q in range(places):
            if rows[i, q, 0] > _ZERO:
                copy(listed[count], rows[i, q])
                count += 1
    affine(listed[:count], inner.weight, inner.bias, edges[:count])
    for r in range(count):
        for c in range(half):
            edges[r, c] = max(edges[r, c], _ZERO)
    affine(edges[:count], heads.weight, heads.bias, of_heads[:count])
    count, begin = 0, 2 * half if first > 0 else 0
    for i in range(m):
        for q in range(places):
            if rows[i, q, 0] > _ZERO:
                for e in range(biases):
                    scratch.bias[e, i, m + first + q] = of_heads[count, e]
                    scratch.bias[e, m + first + q, i] = of_heads[count, biases + e]
                _pool(edges[count], scratch.by_uav[i, begin : begin + 2 * half])
                _pool(edges[count], scratch.by_place[first + q])
                count += 1


@kernel
def _pool(edge: Float32s, pooled: Float32s) -> None:
    """Add an edge (C,) to sum and maximum (2 C,) of edges."""
    half = edge.shape[0]
    for c in range(half):
        pooled[c] += edge[c]
        pooled[half + c] = max(pooled[half + c], edge[c])


@kernel
def _score(agent: CompiledAgent, seen: Seen, t: int, scratch: Scratch, values: Float32s) -> None:
    """Fill values (M, N+1+D)."""
    m, n, d = seen.uavs.shape[1], seen.areas.shape[1], seen.bases.shape[1]
    tokens, mine, places = scratch.tokens, scratch.once, scratch.again
    for token in range(m + n + d):
        normalise(tokens[token], agent.norm.weight, agent.norm.bias, places[token])
        copy(tokens[token], places[token])
    affine(tokens[:m], agent.home_head.weight, agent.home_head.bias, mine[:m])
    for i in range(m):
        gelu(mine[i])
        values[i, n] = dot(mine[i], agent.score_weight) + agent.score_bias[0]
    affine(tokens[:m], agent.uav_head.weight, agent.uav_head.bias, mine[:m])
    affine(tokens[m : m + n], agent.area_head.weight, agent.area_head.bias, places[:n])
    if d > 0:
        affine(tokens[m + n :], agent.base_head.weight, agent.base_head.bias, places[n : n + d])
    _score_pairs(agent, agent.visit_head, seen.visits[t], scratch.visits, scratch, places[:n], values[:, :n])
    if d > 0:
        _score_pairs(
            agent,
            agent.reload_head,
            seen.reloads[t],
            scratch.reloads,
            scratch,
            places[n : n + d],
            values[:, n + 1 :],
        )


@kernel
def _score_pairs(
    agent: CompiledAgent,
    head: Affine,
    rows: Float32s,
    edges: Float32s,
    scratch: Scratch,
    places: Float32s,
    values: Float32s,
) -> None:
    """Fill values (M, Q) of UAVs and Q places with parts (Q, W); those of the UAVs are in `once`."""
    count, mine, pairs = 0, scratch.once, scratch.pairs
    for i in range(rows.shape[0]):
        for q in range(rows.shape[1]):
            count += rows[i, q, 0] > _ZERO
    affine(edges[:count], head.weight, head.bias, pairs[:count])
    count = 0
    for i in range(rows.shape[0]):
        for q in range(rows.shape[1]):
            values[i, q] = -np.inf
            if rows[i, q, 0] > _ZERO:
                pair = pairs[count]
                add(pair, pair, mine[i])
                add(pair, pair, places[q])
                gelu(pair)
                values[i, q] = dot(pair, agent.score_weight) + agent.score_bias[0]
                count += 1
