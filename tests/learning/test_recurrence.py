import numpy as np
import pytest
import torch

from app.learning.paper.recurrence import gru


@pytest.mark.parametrize(("steps", "rows", "hidden"), [(1, 1, 1), (2, 3, 5), (5, 33, 64), (7, 10, 17)])
def test_is_torchs_gru_forward_and_backward(steps, rows, hidden):
    generator = torch.Generator().manual_seed(steps)
    shapes = [(steps, rows, hidden), (3 * hidden, hidden), (3 * hidden, hidden), (3 * hidden,), (3 * hidden,)]
    scales = [1.0, *[2 / np.sqrt(hidden)] * 4]  # the gates saturate in places, but nothing is chaotic
    tensors = [
        (scale * torch.randn(shape, generator=generator)).requires_grad_()
        for scale, shape in zip(scales, shapes, strict=True)
    ]
    upstream = torch.randn(steps, rows, hidden, generator=generator)

    ours = gru(*tensors)
    inputs, *weights = tensors
    theirs, _ = torch.gru(
        inputs, torch.zeros(1, rows, hidden), tuple(weights), True, 1, 0.0, True, False, False
    )

    torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-5)
    ours_gradients = torch.autograd.grad(ours, tensors, upstream)
    theirs_gradients = torch.autograd.grad(theirs, tensors, upstream)
    for our, their in zip(ours_gradients, theirs_gradients, strict=True):
        torch.testing.assert_close(our, their, rtol=1e-3, atol=1e-4)
