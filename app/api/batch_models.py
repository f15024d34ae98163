"""A batch on the wire: what is asked, and a line of what is answered."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from app.api.allocation_models import Allocation, AllocationRequest, AnswerModel
from app.api.errors import BatchTooLarge
from app.api.wire_fields import Identifier, WireModel
from app.domain.identifiers import fault_of
from app.settings import Settings


def _sound(identifier: str) -> str:
    fault = fault_of(identifier)
    if fault is not None:
        raise ValueError(fault)
    return identifier


class BatchItem(AllocationRequest):
    """An allocation, with a name by which its answer is known."""

    # Without an enum: a name that is none is told in the line of its problem, and refuses no batch.
    algorithm: str = Field(
        default="transfer_qmix", description="See `GET /algorithms`", examples=["auto", "transfer_qmix"]
    )
    id: Annotated[Identifier, AfterValidator(_sound)] | None = Field(
        default=None, description="Comes back with the answer; need not be unique"
    )

    @classmethod
    def require_sizes(cls, body: Mapping[str, Any], settings: Settings, at: str) -> None:
        """Let it be: a problem that is too large is told in its line, and refuses no batch."""


class BatchRequest(WireModel):
    """Allocations that have nothing to do with one another."""

    problems: list[BatchItem] = Field(
        min_length=1, description="As many bodies of `POST /allocate` as the operator takes"
    )

    @classmethod
    def require_sizes(cls, body: Mapping[str, Any], settings: Settings, at: str) -> None:  # noqa: ARG003 - of all models
        """Refuse a batch that is too large before its problems are looked at.

        Raises
        ------
        BatchTooLarge
            If it has more problems than the operator takes.
        """
        problems, limit = body.get("problems"), settings.batch_limit
        if isinstance(problems, list) and len(problems) > limit:
            raise BatchTooLarge(limit, len(problems))


class BatchLine(AnswerModel):
    """The answer to one allocation of a batch: a plan, or why there is none."""

    index: int = Field(description="Its place in the request, from 0")
    id: str | None = Field(default=None, description="As in the request, if it has one there")
    allocation: Allocation | None = Field(default=None, description="The plan")
    problem: dict[str, Any] | None = Field(
        default=None, description="Problem details (RFC 9457), as `POST /allocate` would have answered"
    )
