"""The compiled pieces of networks against NumPy in double precision, or PyTorch."""

import numpy as np
import pytest
import torch
from torch.nn import functional

from app.learning.compute import kernels


def single(values):
    return np.asarray(values, np.float32)


@pytest.mark.parametrize(
    ("kernel", "exact", "low", "high"),
    [(kernels.exp, np.exp, -80.0, 80.0), (kernels.tanh, np.tanh, -20.0, 20.0)],
)
def test_functions_are_as_good_as_single_precision(kernel, exact, low, high):
    points = single(np.linspace(low, high, 4001))
    found = np.array([kernel(x) for x in points])
    np.testing.assert_allclose(found, exact(points.astype(np.float64)), rtol=4e-7, atol=3e-7)


def test_tanh_ends_at_one():
    assert [kernels.tanh(np.float32(x)) for x in (-1e30, 0.0, 1e30)] == pytest.approx(
        [-1.0, 0.0, 1.0], abs=3e-7
    )


def test_exp_ends_at_the_limits_of_single_precision():
    assert 0.0 < kernels.exp(np.float32(-1e30)) < 1e-37
    assert 1e38 < kernels.exp(np.float32(1e30)) < np.inf


def test_gelu_is_pytorchs():
    points = single(np.linspace(-12.0, 12.0, 2001))
    exact = functional.gelu(torch.from_numpy(points.astype(np.float64))).numpy()
    kernels.gelu(points)
    np.testing.assert_allclose(points, exact, rtol=3e-7, atol=2e-6)


@pytest.mark.parametrize(
    ("rows", "inputs", "outputs"), [(1, 1, 1), (1, 6, 3), (2, 4, 8), (5, 30, 64), (8, 7, 17)]
)
def test_affine_whatever_the_remainders(rows, inputs, outputs):
    rng = np.random.default_rng(rows + 10 * inputs)
    a, weight, bias = (
        single(rng.normal(size=shape)) for shape in ((rows, inputs), (inputs, outputs), outputs)
    )
    out = np.full((rows, outputs), np.nan, np.float32)
    kernels.affine(a, weight, bias, out)
    np.testing.assert_allclose(out, a.astype(np.float64) @ weight + bias, rtol=1e-5, atol=1e-5)


def test_normalise_is_a_layer_norm():
    rng = np.random.default_rng(3)
    row, gain, shift = (single(rng.normal(size=37)) for _ in range(3))
    out = np.empty_like(row)
    kernels.normalise(row, gain, shift, out)
    tensors = (torch.from_numpy(each) for each in (gain, shift))
    exact = functional.layer_norm(torch.from_numpy(row), (37,), *tensors)
    np.testing.assert_allclose(out, exact.numpy(), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("size", [1, 2, 9, 64])
def test_softmax_adds_up_to_one(size):
    logits = single(np.random.default_rng(size).normal(size=size, scale=30.0))
    exact = torch.softmax(torch.from_numpy(logits.copy()), 0).numpy()
    kernels.softmax(logits)
    np.testing.assert_allclose(logits, exact, rtol=1e-5, atol=1e-7)
    assert logits.sum() == pytest.approx(1.0, abs=1e-6)
