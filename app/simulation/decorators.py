"""The ways in which functions are compiled, beside numba's own (:mod:`app.simulation.compilation`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from app.simulation.compilation import njit

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}
compiled: Callable[[Function], Function] = njit(**_OPTIONS)
"""Compiles functions that allocate nothing and slice nothing.

Without reference counts (``_nrt=False``, numba's own switch for such code) a call that carries the two dozen
arrays costs 6 ns instead of 340. Allocate in Python or in an ordinary ``njit`` function around it.
"""

merged: Callable[[Function], Function] = njit(forceinline=True, **_OPTIONS)
"""The same, and made a part of its callers: for what every action of every plan goes through.

Passing all arrays of a problem and of its episodes takes 50 ns, several times as long as the action itself.
"""

compiled_nogil: Callable[[Function], Function] = njit(nogil=True, **_OPTIONS)
"""The same, and other threads run meanwhile: for the outermost function of long work."""

inlined: Callable[[Function], Function] = njit(inline="always", **_OPTIONS)
"""For small functions, and those with one caller: they are compiled as a part of their callers.

Whatever is compiled by itself takes long where all the arrays of a plan are its arguments, and once more in
each of its callers. Functions that are not inlined take only the arrays that they need.
"""
