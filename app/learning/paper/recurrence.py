"""The GRU along whole episodes, forward and backward, with its element-wise part compiled.

Same function as ``torch.gru``, and tested against it. There, most of the time goes into some forty small
element-wise operations; here each step is one matrix product and one pass over memory that stays in the
processor's cache. At 5 UAVs and 10 targets a forward and backward pass takes 1.3 ms instead of 1.8 ms.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from app.learning.compute.kernels import Float32s, add, candidate, interpolate, kernel, sigmoid_of_sum

_ONE = np.float32(1.0)

# One loop a function: the compiler vectorises a loop over a few arrays, and gives up on one over ten.


@kernel
def _multiply(out: Float32s, a: Float32s, b: Float32s) -> None:
    for c in range(out.shape[0]):
        out[c] = a[c] * b[c]


@kernel
def _candidate_gradient(out: Float32s, d: Float32s, z: Float32s, n: Float32s) -> None:
    for c in range(out.shape[0]):
        out[c] = d[c] * (_ONE - z[c]) * (_ONE - n[c] * n[c])


@kernel
def _update_gradient(out: Float32s, d: Float32s, before: Float32s, n: Float32s, z: Float32s) -> None:
    for c in range(out.shape[0]):
        out[c] = d[c] * (before[c] - n[c]) * z[c] * (_ONE - z[c])


@kernel
def _reset_gradient(out: Float32s, dn: Float32s, recurrent: Float32s, r: Float32s) -> None:
    for c in range(out.shape[0]):
        out[c] = dn[c] * recurrent[c] * r[c] * (_ONE - r[c])


@kernel
def _forward_step(
    gates: Float32s,
    products: Float32s,
    bias: Float32s,
    before: Float32s,
    recurrent: Float32s,
    hidden: Float32s,
) -> None:
    """One step of every row.

    Parameters
    ----------
    gates
        (R, 3H) parts of the gates' pre-activations that come from the input; overwritten by r, z and n.
    products
        (R, 3H) parts that come from the hidden state before, without biases.
    bias
        (H,) recurrent bias of the candidate n; the other biases are in `gates`.
    before
        (R, H) hidden state before.
    recurrent, hidden
        (R, H), overwritten: what r multiplies, and the new hidden state.
    """
    rows, h = hidden.shape
    for i in range(rows):
        sigmoid_of_sum(gates[i, : 2 * h], products[i, : 2 * h])
        add(recurrent[i], products[i, 2 * h :], bias)
        candidate(gates[i, 2 * h :], gates[i, :h], recurrent[i])
        interpolate(hidden[i], gates[i, 2 * h :], gates[i, h : 2 * h], before[i])


@kernel
def _backward_step(
    gradient: Float32s,
    carry: Float32s,
    gates: Float32s,
    recurrent: Float32s,
    before: Float32s,
    d_input: Float32s,
    d_products: Float32s,
) -> None:
    """One step of every row, backward.

    Parameters
    ----------
    gradient
        (R, H) of the loss by this step's hidden state, as read by later layers.
    carry
        (R, H) the same by way of the next step; overwritten by the part for the step before that does not go
        through the matrix product.
    gates, recurrent, before
        As left by :func:`_forward_step`.
    d_input, d_products
        (R, 3H), overwritten: gradients of the two parts of the pre-activations.
    """
    rows, h = carry.shape
    for i in range(rows):
        r, z, n = gates[i, :h], gates[i, h : 2 * h], gates[i, 2 * h :]
        d, dn = carry[i], d_input[i, 2 * h :]
        add(d, d, gradient[i])
        _candidate_gradient(dn, d, z, n)
        _update_gradient(d_input[i, h : 2 * h], d, before[i], n, z)
        _reset_gradient(d_input[i, :h], dn, recurrent[i], r)
        for c in range(2 * h):
            d_products[i, c] = d_input[i, c]
        _multiply(d_products[i, 2 * h :], dn, r)
        _multiply(d, d, z)


class _Gru(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, inputs: Tensor, weight_ih: Tensor, weight_hh: Tensor, bias_ih: Tensor, bias_hh: Tensor
    ) -> Tensor:
        steps, rows, h = *inputs.shape[:2], weight_hh.shape[1]
        bias = bias_ih.clone()
        bias[: 2 * h] += bias_hh[: 2 * h]
        gates = torch.addmm(bias, inputs.flatten(0, 1), weight_ih.t()).view(steps, rows, 3 * h)
        hidden = inputs.new_empty(steps + 1, rows, h)
        hidden[0] = 0.0
        recurrent = inputs.new_empty(steps, rows, h)
        products = inputs.new_zeros(rows, 3 * h)
        views = gates.numpy(), products.numpy(), bias_hh[2 * h :].numpy(), hidden.numpy(), recurrent.numpy()
        for t in range(steps):
            if t > 0:
                torch.mm(hidden[t], weight_hh.t(), out=products)
            _forward_step(views[0][t], views[1], views[2], views[3][t], views[4][t], views[3][t + 1])
        ctx.save_for_backward(inputs, weight_ih, weight_hh, gates, hidden, recurrent)
        return hidden[1:]

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, ...]:
        inputs, weight_ih, weight_hh, gates, hidden, recurrent = ctx.saved_tensors
        steps, rows, h = recurrent.shape
        d_input, d_products = torch.empty_like(gates), torch.empty_like(gates)
        carry = torch.zeros_like(recurrent[0])
        arrays = (
            gradient.contiguous().numpy(),
            carry.numpy(),
            gates.numpy(),
            recurrent.numpy(),
            hidden.numpy(),
        )
        d_views = d_input.numpy(), d_products.numpy()
        for t in range(steps - 1, -1, -1):
            _backward_step(
                arrays[0][t],
                arrays[1],
                arrays[2][t],
                arrays[3][t],
                arrays[4][t],
                d_views[0][t],
                d_views[1][t],
            )
            if t > 0:
                carry.addmm_(d_products[t], weight_hh)
        flat, flat_products = d_input.view(-1, 3 * h), d_products.view(-1, 3 * h)
        d_bias_ih = flat.sum(0)
        return (
            torch.mm(flat, weight_ih).view(steps, rows, -1),
            torch.mm(flat.t(), inputs.flatten(0, 1)),
            # The first step's hidden state is zero: it adds nothing to the recurrent weights' gradient.
            torch.mm(flat_products[rows:].t(), hidden[1:-1].reshape(-1, h)),
            d_bias_ih,
            torch.cat((d_bias_ih[: 2 * h], flat_products[:, 2 * h :].sum(0))),
        )


def gru(inputs: Tensor, weight_ih: Tensor, weight_hh: Tensor, bias_ih: Tensor, bias_hh: Tensor) -> Tensor:
    """Hidden states of a GRU along sequences, each from zeros.

    Parameters
    ----------
    inputs
        (T, R, I) float32.
    weight_ih, weight_hh, bias_ih, bias_hh
        Of a :class:`torch.nn.GRUCell` with H hidden units: (3H, I), (3H, H), (3H,), (3H,).

    Returns
    -------
    Tensor
        (T, R, H).
    """
    hidden: Tensor = _Gru.apply(inputs, weight_ih, weight_hh, bias_ih, bias_hh)  # type: ignore[no-untyped-call]  # untyped in torch
    return hidden
