"""How long learning takes: an epoch of QMIX, and a whole transfer with its look-up in the library.

    python tests/benchmarks/bench_training.py

One thread. An epoch is one episode of exploration and one update on 32 episodes, measured after the buffer
has 32; the median is printed with the fastest tenth, which other programs on the machine disturb least. A
transfer is `transfer_qmix` with Table 3's parameters from a library with one source task of each size; the
first of a process also loads compiled code and opens the library, the others show what a warm worker takes.
The paper's 120 s and 8 s (Table 4, Apple M1 Pro) are of its own instance and code, and not comparable.
"""

import platform
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parents[2]))

from app.learning.parameters import QmixParameters, TransferQmixParameters
from app.learning.qmix import Qmix
from app.learning.transfer import TransferQmix
from app.library.entries import new_policy
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.stop import never
from policy_store.database import Database
from policy_store.library import PolicyLibrary

SIZES = ((5, 10, 3), (10, 20, 3), (20, 30, 3))
EPOCHS = 250
FIRST_UPDATE = 32


def epoch_times(problem):
    """Milliseconds of every epoch with an update."""
    moments = []
    parameters = QmixParameters(mode="paper", n_epochs=EPOCHS, learning_starts=FIRST_UPDATE)
    solver = Qmix(parameters, SolverContext())
    solver.solve(problem, 123, never, lambda progress: moments.append(time.perf_counter()))
    return 1e3 * np.diff(moments)[FIRST_UPDATE:]


def transfer_times(url, problem, repeats):
    """Seconds of whole transfers."""
    solver = TransferQmix(TransferQmixParameters(mode="paper"), SolverContext(url))
    times = []
    for seed in range(repeats):
        start = time.perf_counter()
        solver.solve(problem, seed, never, lambda progress: None)
        times.append(time.perf_counter() - start)
    return times


def fill(library):
    """One untrained source policy of each size: what it has learned does not matter to the clock."""
    for m, n, k in SIZES:
        task = generate("uniform", m, n, k, np.random.default_rng(1))
        solver = Qmix(QmixParameters(mode="paper", n_epochs=0), SolverContext())
        checkpoint = solver.solve(task, 1, never, lambda progress: None).checkpoint
        library.add(new_policy(f"{m}x{n}", task, checkpoint))


def main():
    """Print the table."""
    torch.set_num_threads(1)
    print(f"{platform.machine()}, {platform.python_implementation()} {platform.python_version()}, "
          f"torch {torch.__version__}, numpy {np.__version__}, one thread\n")  # fmt: skip
    print("| size | epoch, ms (fastest tenth) | transfer, 200 epochs, s (first) |")
    print("| --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite:///{Path(folder) / 'library.db'}"
        database = Database(url)
        library = PolicyLibrary(database)
        library.migrate()
        fill(library)
        for m, n, k in SIZES:
            problem = generate("uniform", m, n, k, np.random.default_rng(2))
            first, *transfers = transfer_times(url, problem, 4)
            epochs = epoch_times(problem)
            print(
                f"| {m}x{n}x{k} | {np.median(epochs):.2f} ({np.percentile(epochs, 10):.2f}) "
                f"| {np.median(transfers):.2f} ({first:.2f}) |"
            )
        database.dispose()


if __name__ == "__main__":
    main()
