"""Compiled pieces of networks, in single precision: what small arrays spend most of their time on elsewhere.

Each is a few loops that the compiler turns into vector instructions; calls of the mathematical library would
keep it from that, so the exponential and the hyperbolic tangent are short polynomials here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from app.simulation.compilation import njit

Float32s = npt.NDArray[np.float32]
Function = TypeVar("Function", bound=Callable[..., Any])

# Contraction to fused multiply-adds, and no care for NaN, infinity or the sign of zero: without these the
# loops are not vectorised. Nothing is reordered, so the same input gives the same output.
_OPTIONS: dict[str, Any] = {
    "cache": True,
    "error_model": "numpy",
    "_nrt": False,
    "fastmath": {"contract", "nnan", "ninf", "nsz"},
}
kernel: Callable[[Function], Function] = njit(**_OPTIONS)

# Sums and maxima over an array are vectorised only where their terms may be reordered: always the same way.
_reduction: Callable[[Function], Function] = njit(**(_OPTIONS | {"fastmath": True}))

_ZERO, _HALF, _ONE, _TWO = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(2.0)

_SATURATED = np.float32(9.0)
_P0, _P1, _P2 = np.float32(135135.0), np.float32(17325.0), np.float32(378.0)
_Q1, _Q2, _Q3 = np.float32(62370.0), np.float32(3150.0), np.float32(28.0)

_LEAST, _MOST = np.float32(-87.0), np.float32(88.0)
_LOG2_E = np.float32(1.442695041)
_LN2_HIGH, _LN2_LOW = np.float32(0.693359375), np.float32(-2.12194440e-4)
_E2, _E3, _E4 = np.float32(1 / 2), np.float32(1 / 6), np.float32(1 / 24)
_E5, _E6, _E7 = np.float32(1 / 120), np.float32(1 / 720), np.float32(1 / 5040)
_BIAS, _MANTISSA = np.int32(127), np.int32(23)

_SQRT_HALF = np.float32(0.70710678)
_G = np.float32(0.3275911)
_G1, _G2, _G3 = np.float32(0.254829592), np.float32(-0.284496736), np.float32(1.421413741)
_G4, _G5 = np.float32(-1.453152027), np.float32(1.061405429)

_EPSILON = np.float32(1e-5)


_intrinsic: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic


@_intrinsic
def _float_of_bits(_context: Any, _bits: Any) -> Any:
    def generate(_c: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.FloatType())

    return types.float32(types.int32), generate


@kernel
def tanh(x: Any) -> Any:
    """Hyperbolic tangent to 3e-7: Lambert's continued fraction of x/2, then the double angle."""
    x = _SATURATED if x > _SATURATED else x
    x = -_SATURATED if x < -_SATURATED else x
    y = _HALF * x
    s = y * y
    p = y * (_P0 + s * (_P1 + s * (_P2 + s)))
    q = _P0 + s * (_Q1 + s * (_Q2 + s * _Q3))
    return _TWO * p * q / (p * p + q * q)


@kernel
def exp(x: Any) -> Any:
    """Exponential to 2e-7 of its value: a power of two times a Taylor series within half of ln 2."""
    x = _MOST if x > _MOST else x
    x = _LEAST if x < _LEAST else x
    power = np.floor(x * _LOG2_E + _HALF)
    r = x - power * _LN2_HIGH - power * _LN2_LOW
    series = _E4 + r * (_E5 + r * (_E6 + r * _E7))
    series = _ONE + r * (_ONE + r * (_E2 + r * (_E3 + r * series)))
    return series * _float_of_bits(np.int32((np.int32(power) + _BIAS) << _MANTISSA))


@kernel
def gelu(x: Float32s) -> None:
    """Multiply each entry of (C,) by the normal distribution's probability below it, to 3e-7 of the entry.

    By Abramowitz and Stegun, Handbook of Mathematical Functions, 7.1.26.
    """
    for c in range(x.shape[0]):
        size = abs(x[c])
        u = size * _SQRT_HALF
        t = _ONE / (_ONE + _G * u)
        tail = t * (_G1 + t * (_G2 + t * (_G3 + t * (_G4 + t * _G5)))) * exp(-u * u)
        x[c] = _HALF * (x[c] + size * (_ONE - tail))


@kernel
def affine(rows: Float32s, weight: Float32s, bias: Float32s, out: Float32s) -> None:
    """Fill out (R, J) with rows (R, I) times weight (I, J) plus bias (J,)."""
    for r in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[r, j] = bias[j]
    add_product(rows, weight, out)


@kernel
def add_product(rows: Float32s, weight: Float32s, out: Float32s) -> None:
    """Add rows (R, I) times weight (I, J) to out (R, J).

    Two rows and four inputs at a time: each weight that is loaded is used twice, and each sum is loaded and
    stored once for four products.
    """
    count, inputs = rows.shape
    outputs = weight.shape[1]
    fours = inputs // 4 * 4
    for r in range(0, count - 1, 2):
        for i in range(0, fours, 4):
            a0, a1, a2, a3 = rows[r, i], rows[r, i + 1], rows[r, i + 2], rows[r, i + 3]
            b0, b1, b2, b3 = rows[r + 1, i], rows[r + 1, i + 1], rows[r + 1, i + 2], rows[r + 1, i + 3]
            for j in range(outputs):
                w0, w1, w2, w3 = weight[i, j], weight[i + 1, j], weight[i + 2, j], weight[i + 3, j]
                out[r, j] += a0 * w0 + a1 * w1 + a2 * w2 + a3 * w3
                out[r + 1, j] += b0 * w0 + b1 * w1 + b2 * w2 + b3 * w3
        for i in range(fours, inputs):
            a0, b0 = rows[r, i], rows[r + 1, i]
            for j in range(outputs):
                out[r, j] += a0 * weight[i, j]
                out[r + 1, j] += b0 * weight[i, j]
    if count % 2:
        _add_product_of_row(rows[count - 1], weight, out[count - 1])


@kernel
def _add_product_of_row(row: Float32s, weight: Float32s, out: Float32s) -> None:
    inputs, outputs = weight.shape
    fours = inputs // 4 * 4
    for i in range(0, fours, 4):
        a0, a1, a2, a3 = row[i], row[i + 1], row[i + 2], row[i + 3]
        for j in range(outputs):
            w0, w1, w2, w3 = weight[i, j], weight[i + 1, j], weight[i + 2, j], weight[i + 3, j]
            out[j] += a0 * w0 + a1 * w1 + a2 * w2 + a3 * w3
    for i in range(fours, inputs):
        for j in range(outputs):
            out[j] += row[i] * weight[i, j]


@kernel
def copy(out: Float32s, a: Float32s) -> None:
    """Fill out (C,) with a (C,)."""
    for c in range(out.shape[0]):
        out[c] = a[c]


@kernel
def add(out: Float32s, a: Float32s, b: Float32s) -> None:
    """Fill out (C,), which may be one of them, with the sum of a (C,) and b (C,)."""
    for c in range(out.shape[0]):
        out[c] = a[c] + b[c]


@_reduction
def normalise(row: Float32s, gain: Float32s, shift: Float32s, out: Float32s) -> None:
    """Fill out (C,) with a row (C,), made of mean 0 and variance 1, times gain plus shift: ``LayerNorm``."""
    size = row.shape[0]
    total = _ZERO
    for c in range(size):
        total += row[c]
    mean = total / np.float32(size)
    squares = _ZERO
    for c in range(size):
        squares += (row[c] - mean) * (row[c] - mean)
    scale = _ONE / np.sqrt(squares / np.float32(size) + _EPSILON)
    for c in range(size):
        out[c] = (row[c] - mean) * scale * gain[c] + shift[c]


@_reduction
def softmax(logits: Float32s) -> None:
    """Replace logits (C,) by probabilities."""
    highest = logits[0]
    for c in range(logits.shape[0]):
        highest = max(highest, logits[c])
    for c in range(logits.shape[0]):
        logits[c] = exp(logits[c] - highest)
    total = _ZERO
    for c in range(logits.shape[0]):
        total += logits[c]
    scale = _ONE / total
    for c in range(logits.shape[0]):
        logits[c] *= scale


@_reduction
def dot(a: Float32s, b: Float32s) -> Any:
    """Sum of the products of (C,) and (C,)."""
    total = _ZERO
    for c in range(a.shape[0]):
        total += a[c] * b[c]
    return total


@kernel
def sigmoid_of_sum(a: Float32s, b: Float32s) -> None:
    """Replace a (C,) by the logistic function of its sum with b (C,)."""
    for c in range(a.shape[0]):
        a[c] = _HALF * tanh(_HALF * (a[c] + b[c])) + _HALF


@kernel
def candidate(n: Float32s, r: Float32s, recurrent: Float32s) -> None:
    """Replace n (C,), the input's part, by a GRU's candidate state with reset gate r and recurrent part."""
    for c in range(n.shape[0]):
        n[c] = tanh(n[c] + r[c] * recurrent[c])


@kernel
def interpolate(out: Float32s, n: Float32s, z: Float32s, before: Float32s) -> None:
    """Fill out (C,), which may be `before`, with z of the state before and 1 - z of the candidate n."""
    for c in range(out.shape[0]):
        out[c] = n[c] + z[c] * (before[c] - n[c])
