"""Processes that compile the same functions share the work, lose nothing and mix nothing up."""

import importlib
import inspect
import pickle
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import numba
import pytest
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher

from app.simulation import callees, compilation
from app.simulation.compilation import first_at, source_stamp, stamped_files

MODULE = """
from numba import njit

@njit(cache=True)
def count(x):
    return x.size
"""

PROGRAM = """
import sys, time
from pathlib import Path
import numpy as np
from app.simulation.compilation import compile_in_turns, compiled_here
from counting import count

number, start = int(sys.argv[1]), Path(sys.argv[2])
compile_in_turns()
compile_in_turns()
kinds = [np.int8, np.int16, np.int32, np.int64, np.uint8, np.uint16, np.uint32, np.float32]
kinds = kinds[: int(sys.argv[3])]
while number and not start.exists():
    time.sleep(0.001)
for kind in kinds[number % 4:] + kinds[: number % 4]:
    assert count(np.zeros(3, kind)) == 3
    assert count(np.zeros((4, 1), kind)) == 4
if not number:
    assert not count.stats.cache_misses, count.stats
    assert sum(count.stats.cache_hits.values()) == 2 * len(kinds), count.stats
assert compiled_here() == sum(count.stats.cache_misses.values())
print(compiled_here())
"""


def test_several_writers_of_one_cache(tmp_path):
    (tmp_path / "counting.py").write_text(MODULE)
    start = tmp_path / "start"
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{PROGRAM}"]
    writers = [
        subprocess.Popen([*command, str(number), str(start), "4"], stdout=subprocess.PIPE)
        for number in (1, 2, 3)
    ]
    start.touch()
    compiled = [int(writer.communicate(timeout=120)[0]) for writer in writers]
    assert [writer.returncode for writer in writers] == [0] * 3
    assert sum(compiled) == 8
    subprocess.run([*command, "0", str(start), "4"], check=True, timeout=120)


@pytest.mark.parametrize(
    ("kind", "kept"),
    [("nbi", pickle.dumps(numba.__version__) + b"capp.no_such_module\nNo\n."), ("nbc", b"\x80\x04\x95")],
    ids=["an index of code that has moved", "a part of machine code"],
)
def test_what_cannot_be_read_is_compiled_anew(tmp_path, kind, kept):
    (tmp_path / "counting.py").write_text(MODULE)
    start = tmp_path / "start"
    start.touch()
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{PROGRAM}"]
    run = partial(subprocess.run, check=True, timeout=120, capture_output=True)
    run([*command, "1", str(start), "1"])
    files = list(tmp_path.rglob(f"*.{kind}"))
    assert files
    for file in files:
        file.write_bytes(kept)
    assert int(run([*command, "1", str(start), "1"]).stdout) == 2
    assert int(run([*command, "0", str(start), "1"]).stdout) == 0


ROOT = Path(__file__).parents[2]

AT_WORK = """
import sys
from app.simulation import callees, compilation
from app.simulation.compilation import first_at

with first_at("sorting") as first:
    print(first, flush=True)
    sys.stdin.readline()
"""


def test_one_process_at_a_time_is_first_at_a_piece_of_work():
    pipe = subprocess.PIPE
    other = subprocess.Popen([sys.executable, "-c", AT_WORK], stdin=pipe, stdout=pipe, text=True, cwd=ROOT)
    assert other.stdout.readline() == "True\n"
    with first_at("sorting") as first:
        assert not first
    with first_at("counting") as first:
        assert first
    other.communicate("\n", timeout=60)
    with first_at("sorting") as first:
        assert first


FIRST_LEG = """
import numpy as np
from app.simulation import simulator
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate

simulator.reset = lambda *_: None  # It is not asked for, and would be compiled too.
arrays = compile_problem(generate("uniform", 4, 6, 2, np.random.default_rng(3)))
episodes = simulator.new_episodes(arrays, 1)
episodes.at[:] = simulator.START
print(simulator.leg_to(arrays, episodes, 0, 0, 0))
"""


def test_a_changed_rule_is_followed_wherever_it_is_inlined(tmp_path):
    """The rule is changed in one file; its caller, in another, has machine code with the old rule in it."""
    shutil.copytree(ROOT / "app", tmp_path / "app")
    command = [sys.executable, "-c", FIRST_LEG]

    def first_leg():
        done = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True, timeout=300)
        return float(done.stdout)

    assert first_leg() > 0.0
    file = tmp_path / "app" / "simulation" / "visit.py"
    rule = "return (\n        arrays.start_target[p, i, j] if at == START"
    changed = file.read_text().replace(rule, f"return -1.0 if j == 0 else {rule.removeprefix('return ')}")
    assert changed != file.read_text()
    file.write_text(changed)
    assert first_leg() == -1.0


def compiled_functions():
    """Every function of the program that numba compiles, with the module that defines it."""
    for path in sorted((ROOT / "app").rglob("*.py")):
        if any(word in path.read_text() for word in ("njit", "compiled", "inlined", "merged")):
            module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
            for function in vars(module).values():
                if isinstance(function, Dispatcher) and function.py_func.__module__ == module.__name__:
                    yield module, function


def test_the_stamp_of_a_function_covers_all_that_it_may_inline_and_how_it_is_compiled():
    functions = list(compiled_functions())
    assert len(functions) > 100
    how = {Path(inspect.getfile(module)) for module in (callees, compilation)}
    for module, function in functions:
        covered = stamped_files(Path(module.__file__))
        assert how <= covered, module.__name__
        for name in function.py_func.__code__.co_names:
            inlined = function.py_func.__globals__.get(name)
            if isinstance(inlined, Dispatcher):
                assert Path(inspect.getfile(inlined.py_func)) in covered, (module.__name__, name)


def test_machine_code_is_kept_by_that_stamp_or_not_at_all():
    for module, function in compiled_functions():
        if isinstance(function._cache, NullCache):
            continue  # It is inlined into functions that keep theirs.
        stamp = function._cache._impl.locator.get_source_stamp()
        assert stamp == source_stamp(Path(module.__file__)), function
