"""Attention and feed-forward parts of a transformer, compiled, on small arrays.

An agent is a tuple that has ``attention_norm``, ``attention_in``, ``attention_out``, ``feed_norm``,
``feed_in`` and ``feed_out`` as :class:`Affines`; scratch memory is one that has ``tokens``, ``once`` and
``again`` (A, W), ``feed`` (A, 2 W), ``mixed`` (A, 3 W), ``query``, ``value`` and ``seen`` (A, W / H), ``key``
(W / H, A) and ``share`` (A, A).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, cast

import numpy as np
from torch import Tensor, nn

from app.learning.compute.kernels import (
    Float32s,
    add,
    add_product,
    affine,
    copy,
    gelu,
    kernel,
    normalise,
    softmax,
)

_ZERO = np.float32(0.0)


class Affine(NamedTuple):
    """A linear part: weight (I, J), transposed against PyTorch's, and bias (J,), 0 where it has none."""

    weight: Float32s
    bias: Float32s


class Affines(NamedTuple):
    """The same of L layers: (L, I, J) and (L, J). Of a norm: gains and shifts, both (L, J)."""

    weight: Float32s
    bias: Float32s


def array_of(tensor: Tensor) -> Float32s:
    """Copy a tensor, on whatever device it is."""
    return np.ascontiguousarray(tensor.detach().cpu().numpy())


def affine_of(part: nn.Module) -> Affine:
    """Copy the weights of a linear part, or of a norm."""
    weight, bias = part.weight, part.bias
    assert isinstance(weight, Tensor)
    shift = np.zeros(len(weight), np.float32) if bias is None else array_of(cast(Tensor, bias))
    return Affine(array_of(weight.t()), shift)


def affines_of(layers: Iterable[nn.Module], name: str) -> Affines:
    """Copy the weights of a part of each layer."""
    parts = [affine_of(getattr(layer, name)) for layer in layers]
    return Affines(np.stack([part.weight for part in parts]), np.stack([part.bias for part in parts]))


@kernel
def attend(agent: Any, layer: int, bias: Float32s, scratch: Any) -> None:
    """Add to each token what it sees of the others, with logits raised by bias (H, A, A)."""
    tokens, once, again, mixed = scratch.tokens, scratch.once, scratch.again, scratch.mixed
    query, key, value, seen = scratch.query, scratch.key, scratch.value, scratch.seen
    a, w = tokens.shape
    heads = bias.shape[0]
    size = w // heads
    scale = np.float32(1.0) / np.sqrt(np.float32(size))
    norm = agent.attention_norm
    for token in range(a):
        normalise(tokens[token], norm.weight[layer], norm.bias[layer], once[token])
    affine(once, agent.attention_in.weight[layer], agent.attention_in.bias[layer], mixed)
    for head in range(heads):
        begin = head * size
        for token in range(a):
            for c in range(size):
                query[token, c] = mixed[token, begin + c] * scale
                key[c, token] = mixed[token, w + begin + c]
                value[token, c] = mixed[token, 2 * w + begin + c]
                seen[token, c] = _ZERO
            copy(scratch.share[token], bias[head, token])
        add_product(query, key, scratch.share)
        for token in range(a):
            softmax(scratch.share[token])
        add_product(scratch.share, value, seen)
        for token in range(a):
            for c in range(size):
                once[token, begin + c] = seen[token, c]
    affine(once, agent.attention_out.weight[layer], agent.attention_out.bias[layer], again)
    for token in range(a):
        add(tokens[token], tokens[token], again[token])


@kernel
def feed_forward(agent: Any, layer: int, scratch: Any) -> None:
    """Add to each token what its feed-forward part makes of it."""
    tokens, once, feed = scratch.tokens, scratch.once, scratch.feed
    norm = agent.feed_norm
    for token in range(tokens.shape[0]):
        normalise(tokens[token], norm.weight[layer], norm.bias[layer], once[token])
    affine(once, agent.feed_in.weight[layer], agent.feed_in.bias[layer], feed)
    for token in range(tokens.shape[0]):
        gelu(feed[token])
    affine(feed, agent.feed_out.weight[layer], agent.feed_out.bias[layer], once)
    for token in range(tokens.shape[0]):
        add(tokens[token], tokens[token], once[token])
