"""What workers are forked from: it compiles nothing, and has one thread."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.jobs.executor import SINGLE_THREADED

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux only")

_PROGRAM = """
import app.allocation.preloaded
import gc, os, sys
from numba.core.dispatcher import Dispatcher
gc.unfreeze()
loaded = [each for each in gc.get_objects() if issubclass(type(each), Dispatcher) and each.signatures]
print(len(os.listdir("/proc/self/task")), "torch" in sys.modules, len(loaded) > 50)
"""


def loaded(**environment):
    """The threads of a process that has loaded what is kept; whether it has torch, and compiled code."""
    command = [sys.executable, "-c", _PROGRAM]
    surroundings = os.environ | SINGLE_THREADED | environment
    ended = subprocess.run(command, cwd=ROOT, env=surroundings, capture_output=True, text=True, check=True)
    assert ended.stderr == ""
    return ended.stdout.split()


def test_it_loads_what_is_kept_and_leaves_no_thread():
    assert loaded() == ["1", "True", "True"]


def test_it_compiles_nothing(tmp_path):
    assert loaded(NUMBA_CACHE_DIR=str(tmp_path)) == ["1", "True", "False"]
    assert not list(tmp_path.rglob("*.nb*"))
