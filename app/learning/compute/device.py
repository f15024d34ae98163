"""Where policies for every size learn: on a GPU where there is one, otherwise on the processor."""

from __future__ import annotations

import torch


def learning_device() -> torch.device:
    """Return the device that a training or a fine-tuning uses; workers see only GPUs that they were given."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")
