"""How functions are compiled, and where their machine code is kept.

Everything compiled here imports `njit` from this module. Numba keeps the machine code of a function with a
stamp of the function's file. A function of another file that is inlined into it may change without changing
that stamp, and the old code would be used. So the stamp here is a digest of the file and of every module of
this program that it imports, directly or not: an edit or an update of any of them compiles anew what may
depend on it, and nothing else.

Numba reads a function's index, adds an entry and writes it back: of two processes that do so at once, one
loses its entry, or both give their code the same name. Workers that start together do;
:func:`write_in_turns` keeps them apart.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import tempfile
from collections.abc import Iterator
from functools import cache, wraps
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.core import caching

__all__ = ["njit", "source_stamp", "stamped_files", "write_in_turns"]

_ROOT = Path(__file__).resolve().parents[2]
"""Folder that holds the package `app`."""

_LOCK = Path(tempfile.gettempdir()) / f"uav-allocator-compiling-{os.getuid()}.lock"


_IMPORT = re.compile(
    r"^[ \t]*(?:from (app[\w.]*) import (\([^)]*\)|[^\n]*)|import (app[^\n]*))", re.MULTILINE
)
_NAME = re.compile(r"\w+")


@cache
def source_stamp(file: Path) -> str:
    """Return a digest of a module and of all modules of this program that it imports, directly or not.

    Parameters
    ----------
    file
        The module's source, inside the package `app`.
    """
    digest = hashlib.sha256()
    for path in sorted(stamped_files(file)):
        digest.update(f"{path.relative_to(_ROOT)}\0{_digest(path)}\0".encode())
    return digest.hexdigest()


def stamped_files(file: Path) -> set[Path]:
    """Return the files of which the stamp of a module is the digest, the module's own among them."""
    found: set[Path] = set()
    waiting = [file.resolve()]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting.extend(_imported(path))
    return found


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def _imported(path: Path) -> tuple[Path, ...]:
    """Return the files of this program's modules that a file names in an import, wherever it stands."""
    names = set()
    for package, imported, plain in _IMPORT.findall(path.read_text("utf-8")):
        # Of `from a import b`, both a and a.b may be modules.
        names.update([package, *(f"{package}.{name}" for name in _NAME.findall(imported))])
        names.update(plain.replace(" ", "").split(","))
    return tuple(file for name in sorted(names) if name.split(".")[0] == "app" for file in _files(name))


def _files(module: str) -> Iterator[Path]:
    place = _ROOT.joinpath(*module.split("."))
    for file in (place.with_suffix(".py"), place / "__init__.py"):
        if file.is_file():
            yield file


class _FollowsImports(caching._SourceFileBackedLocatorMixin):
    """A locator of machine code whose stamp follows the imports of the function's file."""

    _py_file: str

    def get_source_stamp(self) -> Any:
        file = Path(self._py_file)
        if file.resolve().is_relative_to(_ROOT / "app"):
            return source_stamp(file)
        return super().get_source_stamp()  # type: ignore[no-untyped-call]  # untyped in numba


class ProvidedFolder(_FollowsImports, caching.UserProvidedCacheLocator):
    """Keeps machine code in the folder that ``NUMBA_CACHE_DIR`` names, where it names one."""


class BesideSource(_FollowsImports, caching.InTreeCacheLocator):
    """Keeps machine code beside the source, where that can be written."""


class UserFolder(_FollowsImports, caching.UserWideCacheLocator):
    """Keeps machine code in the user's folder of such files otherwise."""


_OWN = (ProvidedFolder, BesideSource, UserFolder)
# Numba asks for its locators by name, at every function that is decorated with ``cache=True`` from now on.
# Its own two others are for functions without a file, and for packages in a ZIP.
config.CACHE_LOCATOR_CLASSES = ",".join(  # type: ignore[attr-defined]  # numba sets its options at run time
    [*(f"{__name__}.{locator.__name__}" for locator in _OWN), "IPythonCacheLocator", "ZipCacheLocator"]
)


def write_in_turns() -> None:
    """Make this process wait, whenever it keeps compiled code, while another of the same user does so."""
    save = caching.IndexDataCacheFile.save
    if hasattr(save, "__wrapped__"):
        return

    @wraps(save)
    def in_turn(self: caching.IndexDataCacheFile, key: Any, data: Any) -> None:
        # The lock of a process that is killed is free at once.
        with _LOCK.open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            save(self, key, data)  # type: ignore[no-untyped-call]  # untyped in numba

    caching.IndexDataCacheFile.save = in_turn  # type: ignore[method-assign]  # numba has no hook for it
