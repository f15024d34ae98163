"""The training of one source task: the same wherever it is done."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from app.domain.errors import InvalidCheckpoint
from app.domain.records import problem_from_record
from app.learning.parameters import QmixParameters
from app.learning.qmix import Qmix
from app.solvers.protocol import Progress, SolverContext, StopCriterion

SEED = 123
"""Table 1; tasks are drawn from it too."""


def train_source(
    record: dict[str, Any],
    parameters: QmixParameters,
    stop: StopCriterion,
    report: Callable[[Progress], None],
) -> bytes:
    """Train on a task, given as a record, and return the checkpoint.

    Raises
    ------
    InvalidCheckpoint
        If the training has diverged.
    """
    solution = Qmix(parameters, SolverContext()).solve(problem_from_record(record), SEED, stop, report)
    if solution.checkpoint is None:
        raise InvalidCheckpoint("the training has diverged")
    return solution.checkpoint
