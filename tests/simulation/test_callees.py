"""A function that compiled code calls is compiled for that alone, and for Python once Python calls it."""

import subprocess
import sys
from pathlib import Path

import pytest

MODULE = """
from numba import njit

import app.simulation.compilation

@njit(cache=True)
def halved(x):
    if x % 2:
        raise ValueError("odd", x)
    return x // 2

@njit(cache=True)
def quartered(x):
    return halved(halved(x))

@njit(cache=True)
def eighth(x):
    return halved(quartered(x))
"""


@pytest.fixture
def run(tmp_path):
    (tmp_path / "halving.py").write_text(MODULE)

    def run(program):
        """Run it in a process of its own, which finds what those before it have kept."""
        program = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nfrom halving import *\n{program}"
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)
        assert not done.returncode, done.stderr
        return done.stdout.strip()

    return run


def kept(folder: Path):
    return {file.name.partition("-")[0] for file in folder.rglob("*.nbc")}


def callees(folder: Path):
    return {file.name.split("-")[1] for file in folder.rglob("callee-*.nbc")}


def test_only_what_python_calls_is_kept_for_it(run, tmp_path):
    assert run("print(quartered(12))") == "3"
    assert kept(tmp_path) == {"callee", "halving.quartered"}
    assert callees(tmp_path) == {"halving.halved"}


@pytest.mark.parametrize("times", [1, 2], ids=["compiled", "kept"])
def test_python_may_call_it_too(run, tmp_path, times):
    for _ in range(times):
        assert run("print(quartered(12), halved(6), eighth(8), halved(4))") == "3 3 1 2"
    assert kept(tmp_path) == {"callee", "halving.quartered", "halving.halved", "halving.eighth"}


@pytest.mark.parametrize("first", ["", "quartered(4)", "halved(2)"], ids=str)
def test_an_error_of_a_callee_tells_what_it_was(run, first):
    """What it tells is kept apart from machine code, and each caller has to find it again."""
    asked = "try: eighth(12)\nexcept ValueError as error: print(error.args)"
    run(first)
    for _ in range(2):
        assert run(asked) == "('odd', 3)"


def test_functions_copied_into_one_that_python_calls_have_no_other_callers(run):
    """LLVM knows that, so it makes those with one caller a part of it."""
    linked = "sum(line.startswith('define linkonce') for line in code.splitlines())"
    assert run(f"quartered(12); code, = quartered.inspect_llvm().values(); print({linked})") == "0"


def test_it_is_told_when_functions_are_compiled_or_loaded_once_for_all_that_one_needs(run):
    asked = "from app.simulation.compilation import compile_in_turns, told_of_compiling\ncompile_in_turns()\n"
    asked += "with told_of_compiling(print): quartered(12); quartered(8)\neighth(8)"
    for _ in range(2):
        assert run(asked).split() == ["True", "False"]
