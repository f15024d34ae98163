"""What a process loads from which workers are forked."""

from __future__ import annotations

import os
from contextlib import suppress

from numba.core.event import Event, Listener, install_listener

from app.allocation.warm_up import load_all
from app.jobs.worker import resolve

# Named, not imported, so that this room does not depend on the learners.
_DEVICE = "app.learning.compute.device:learning_device"

_CHECK = "PYTORCH_NVML_BASED_CUDA_CHECK"
"""The variable that has torch look for a GPU without using it."""


def load_what_is_kept() -> None:
    """Load what all workers need, and what of the compiled code is kept already; compile nothing.

    It leaves no thread behind, as a forked process has none but its first. What has to be compiled is left to
    the workers, which share that work. Where torch would learn on a GPU, no compiled code is loaded either:
    loading tries it, and a process that is forked from one that has used a GPU cannot use it.
    """
    if _learns_on_a_gpu():
        return
    with install_listener("numba:compile", _NothingIsCompiled()), suppress(_IsNotKept):
        load_all()


def _learns_on_a_gpu() -> bool:
    """Say so without what torch does by itself to find out, after which no forked process can use a GPU."""
    before = os.environ.get(_CHECK)
    os.environ[_CHECK] = "1"
    try:
        return bool(resolve(_DEVICE)().type != "cpu")
    finally:
        if before is None:
            del os.environ[_CHECK]
        else:
            os.environ[_CHECK] = before


class _IsNotKept(Exception):
    """Code would have to be compiled."""


class _NothingIsCompiled(Listener):
    """Ends what is about to compile."""

    def on_start(self, event: Event) -> None:
        """Raise, before numba begins."""
        raise _IsNotKept(event.data)

    def on_end(self, event: Event) -> None:
        """Do nothing: nothing ends that was not begun."""
