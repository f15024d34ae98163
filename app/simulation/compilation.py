"""How functions are compiled, and where their machine code is kept.

Everything compiled here imports `njit` from this module. Numba keeps the machine code of a function with a
stamp of the function's file. A function of another file that is inlined into it may change without changing
that stamp, and the old code would be used. So the stamp here is a digest of the file and of every module of
this program that it imports, directly or not: an edit or an update of any of them compiles anew what may
depend on it, and nothing else.

Numba reads a function's index, adds an entry and writes it back: of two processes that do so at once, one
loses its entry, or both give their code the same name. Workers that start together do, and would compile
everything once each; :func:`compile_in_turns` keeps them apart.
"""

from __future__ import annotations

import fcntl
import gc
import hashlib
import os
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.core import caching, sigutils
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

import app.simulation.callees  # noqa: F401 - it changes how numba compiles

__all__ = [
    "compile_in_turns",
    "compiled_here",
    "first_at",
    "njit",
    "source_stamp",
    "stamped_files",
    "told_of_compiling",
]

_ROOT = Path(__file__).resolve().parents[2]
"""Folder that holds the package `app`."""

_LOCK = Path(tempfile.gettempdir()) / f"uav-allocator-compiling-{os.getuid()}.lock"


_IMPORT = re.compile(
    r"^[ \t]*(?:from (app[\w.]*) import (\([^)]*\)|[^\n]*)|import (app[^\n]*))", re.MULTILINE
)
_NAME = re.compile(r"\w+")
_NAME_OF_MODULE = re.compile(r"app[\w.]*")


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
        names.update(_NAME_OF_MODULE.findall(plain.split("#")[0]))
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


class UnreadableIsMissing(caching.IndexDataCacheFile):
    """Kept machine code that cannot be read is compiled anew.

    Its index names modules and classes, which may have moved since, and a power cut may have left a part.
    """

    def load(self, key: Any) -> Any:
        """Return the entry of a key; None where there is none that can be read."""
        try:
            return super().load(key)  # type: ignore[no-untyped-call]  # untyped in numba
        except Exception:  # what stands in the file decides what reading it raises
            return None

    def _load_index(self) -> Any:
        try:
            return super()._load_index()  # type: ignore[no-untyped-call]  # untyped in numba
        except Exception:  # as above
            return {}


caching.IndexDataCacheFile = UnreadableIsMissing  # type: ignore[misc]  # numba has no hook for it

_OWN = (ProvidedFolder, BesideSource, UserFolder)
# Numba asks for its locators by name, at every function that is decorated with ``cache=True`` from now on.
# Its own two others are for functions without a file, and for packages in a ZIP.
config.CACHE_LOCATOR_CLASSES = ",".join(  # type: ignore[attr-defined]  # numba sets its options at run time
    [*(f"{__name__}.{locator.__name__}" for locator in _OWN), "IPythonCacheLocator", "ZipCacheLocator"]
)


def compile_in_turns() -> None:
    """Make this process wait, whenever it needs a function, while another of the same user compiles it.

    After that it finds the function's code kept. Processes that need the same functions so share the work.
    A function is compiled while its callers are, so locks are taken in the order of calls, in which there are
    no circles: no two processes wait for each other.
    """
    alone = Dispatcher.compile
    if hasattr(alone, "__wrapped__"):
        return

    @wraps(alone)
    def in_turn(self: Any, sig: Any) -> Any:
        args, _ = sigutils.normalize_signature(sig)  # type: ignore[no-untyped-call]  # untyped in numba
        if tuple(args) in self.overloads or isinstance(self._cache, caching.NullCache):
            return alone(self, sig)
        # A file's lock is the process's: its threads take turns at numba's own lock.
        with global_compiler_lock, _told(), _turn(self._cache._cache_file._index_path), _few_collections():
            misses = self._cache_misses.total()
            entry = alone(self, sig)
            _compiled_here[0] += self._cache_misses.total() - misses
            return entry

    Dispatcher.compile = in_turn  # type: ignore[method-assign]  # numba has no hook for it


def compiled_here() -> int:
    """Return how many functions this process has compiled since :func:`compile_in_turns`, not found kept."""
    return _compiled_here[0]


_compiled_here = [0]


@contextmanager
def told_of_compiling(tell: Callable[[bool], None]) -> Iterator[None]:
    """Have it told when this process begins to compile, load or wait for a function, and when that has ended.

    That cannot be stopped. It is told with :func:`compile_in_turns` only.
    """
    _to_tell.append(tell)
    try:
        yield
    finally:
        _to_tell.remove(tell)


@contextmanager
def _told() -> Iterator[None]:
    """Tell it of the outermost function: others are compiled for it."""
    _depth[0] += 1
    try:
        if _depth[0] == 1:
            for tell in _to_tell:
                tell(True)
        yield
    finally:
        _depth[0] -= 1
        if _depth[0] == 0:
            for tell in _to_tell:
                tell(False)


_to_tell: list[Callable[[bool], None]] = []
_depth = [0]


@contextmanager
def _few_collections() -> Iterator[None]:
    """Compile without looking for garbage all the time, as most objects are kept."""
    before = gc.get_threshold()
    gc.set_threshold(_ALLOCATIONS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


_ALLOCATIONS = 200_000
"""How many more objects there are before the youngest are looked through."""


@contextmanager
def first_at(work: str) -> Iterator[bool]:
    """Say whether no other process of this user is at a piece of work; meanwhile this one is."""
    byte = _byte(f"{_ROOT}\0{work}")
    try:
        fcntl.lockf(_lock_file(), fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
    except OSError:
        yield False
        return
    try:
        yield True
    finally:
        fcntl.lockf(_lock_file(), fcntl.LOCK_UN, 1, byte)


@contextmanager
def _turn(name: str) -> Iterator[None]:
    """Hold the lock of a name, which one process of this user has at a time; a killed one has none."""
    byte = _byte(name)
    fcntl.lockf(_lock_file(), fcntl.LOCK_EX, 1, byte)
    try:
        yield
    finally:
        fcntl.lockf(_lock_file(), fcntl.LOCK_UN, 1, byte)


def _byte(name: str) -> int:
    """Return which byte of the file is locked for a name; there need be none."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:6], "big")


@cache
def _lock_file() -> int:
    # Never closed: with that a process gives back all its locks of the file.
    return os.open(_LOCK, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
