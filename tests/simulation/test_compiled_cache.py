"""Processes that compile the same functions at the same time lose nothing and mix nothing up."""

import subprocess
import sys

MODULE = """
from numba import njit

@njit(cache=True)
def double(x):
    return x + x
"""

PROGRAM = """
import sys, time
from pathlib import Path
import numpy as np
from app.simulation.compiled_cache import write_in_turns
from doubling import double

number, start = int(sys.argv[1]), Path(sys.argv[2])
write_in_turns()
write_in_turns()
kinds = [np.int8, np.int16, np.int32, np.int64, np.uint8, np.uint16, np.uint32, np.float32]
while number and not start.exists():
    time.sleep(0.001)
for kind in kinds[number % 4:] + kinds[: number % 4]:
    assert double(np.full(3, 21, kind)).tolist() == [42] * 3
    assert double(np.full((3, 1), 21, kind)).tolist() == [[42]] * 3
if not number:
    assert not double.stats.cache_misses, double.stats
    assert sum(double.stats.cache_hits.values()) == 16, double.stats
"""


def test_several_writers_of_one_cache(tmp_path):
    (tmp_path / "doubling.py").write_text(MODULE)
    start = tmp_path / "start"
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{PROGRAM}"]
    writers = [subprocess.Popen([*command, str(number), str(start)]) for number in (1, 2, 3, 4)]
    start.touch()
    assert [writer.wait(timeout=120) for writer in writers] == [0] * 4
    subprocess.run([*command, "0", str(start)], check=True, timeout=120)
