"""One rule for seeds."""

import numpy as np
import pytest

from app.domain.errors import InvalidParameters
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.registry import ALGORITHMS, create_solver, parse_parameters
from app.solvers.seeds import seed_sequence
from app.solvers.stop import never

SEEDED = [name for name in ALGORITHMS if name not in ("greedy", "transfer_qmix")]


def test_purposes_have_streams_of_their_own():
    states = [tuple(seed_sequence(7, *purpose).generate_state(4)) for purpose in ((), (1,), (0, 1))]
    states.append(tuple(seed_sequence(8).generate_state(4)))
    assert len(set(states)) == 4
    assert states[0] == tuple(seed_sequence(7).generate_state(4))


@pytest.mark.parametrize("name", SEEDED)
def test_a_negative_seed_is_refused_by_name_and_value(name):
    problem = generate("uniform", 2, 3, 1, np.random.default_rng(0))
    solver = create_solver(name, parse_parameters(name, {}), SolverContext())
    with pytest.raises(InvalidParameters, match="-3") as refused:
        solver.solve(problem, -3, never, lambda _told: None)
    assert refused.value.violations[0].pointer == "/seed"
