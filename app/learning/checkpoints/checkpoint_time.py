"""Time for what was learned: networks of large problems have megabytes, which are coded, moved and stored."""

from __future__ import annotations

from torch import nn

from app.solvers.protocol import StopCriterion
from app.solvers.stop import Sooner

_SECONDS_A_BYTE = 3e-8
"""For coding, the way to the service and its disk: with 39 MB the slowest of ten took about a second."""

_LARGEST_SHARE = 0.25


class CheckpointReserve(Sooner):
    """Stops before the given criterion does, by the time that a network's checkpoint takes.

    Where that would be a large part of the time limit, what could be learned in the rest is not worth it: the
    whole time goes to the plan, and no checkpoint is left behind.

    Parameters
    ----------
    stop
        The criterion.
    network
        What is trained.

    Attributes
    ----------
    checkpoint
        Whether there is time for one.
    """

    def __init__(self, stop: StopCriterion, network: nn.Module) -> None:
        needed = _SECONDS_A_BYTE * sum(4 * parameter.numel() for parameter in network.parameters())
        left = stop.seconds_left()
        self.checkpoint = needed <= _LARGEST_SHARE * left
        super().__init__(stop, needed if self.checkpoint else 0.0)
