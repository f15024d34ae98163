"""Asks a worker process of its own about missions, so that no search keeps an event waiting.

The process is started when it is first needed: a service without missions has none.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from typing import Any

from app.domain.said import said
from app.jobs.errors import INTERNAL_ERROR
from app.jobs.executor import Executor, Raised, Returned
from app.missions.errors import MissionBusy, raised_elsewhere

_TRIES, _PATIENCE_S = 3, 120.0

_log = logging.getLogger(__name__)


class Judge:
    """The process that works out what becomes of missions.

    Parameters
    ----------
    executor
        Runs it; it is started and closed here.
    """

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._started = False
        self._closed = False

    async def ask(self, function: str, payload: Mapping[str, Any]) -> Mapping[str, Any]:
        """Call a function of :mod:`app.missions.judging`, and return what it returns.

        Raises
        ------
        AllocatorError
            As the function does.
        MissionBusy
            If the process dies again and again, or does not answer.
        """
        for _ in range(_TRIES):
            if self._closed:
                raise MissionBusy(said("the service is stopping"))
            if not self._started:
                self._started = True
                await self._executor.start(lambda: None)
            execution = self._executor.submit(f"app.missions.judging:{function}", payload)
            try:
                async with asyncio.timeout(_PATIENCE_S):
                    outcome = await execution.outcome()
            except TimeoutError:
                execution.kill()
                break
            if isinstance(outcome, Returned):
                return outcome.work.result
            if isinstance(outcome, Raised):
                if outcome.error["code"] == INTERNAL_ERROR:
                    trace = {"worker_traceback": outcome.traceback}
                    _log.error("a mission could not be judged: %s", outcome.error["detail"], extra=trace)
                raise raised_elsewhere(outcome.error)
        raise MissionBusy(said("the process that works out missions does not answer; try again"))

    async def close(self) -> None:
        """End the process."""
        self._closed = True
        if self._started:
            await self._executor.close()
