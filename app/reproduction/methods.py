"""What is run: the paper's algorithms, the service's own, what proves, and what a user would take instead."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from app.reproduction.scale import GRID, SHOWN, SMALL, Cell, Scale

ParametersOf = Callable[[Scale, Cell], dict[str, Any]]

TABLE_1_EPOCHS = 50_000
"""Epochs over which the exploration of Table 1 falls; with fewer epochs it falls as much faster."""

MAX_DQN_CELL = 5
"""Most UAVs and areas that DQN is given: (N+1)^M = 7,776 joint actions."""


class Kind(StrEnum):
    """How a method is run.

    ``SOLVE``: an algorithm of the registry without a time limit. ``NEAR``: a source policy is trained on a
    neighbouring task first, then transferred. ``TIMED``: within a time limit, so that its values differ from
    run to run.
    """

    SOLVE = "solve"
    NEAR = "near"
    TIMED = "timed"


class Breadth(StrEnum):
    """How many problems and seeds a method gets."""

    ALL = "all"
    LEARNING = "learning"
    ONCE = "once"
    TIMED = "timed"


@dataclass(frozen=True, slots=True)
class Method:
    """One way of solving a problem.

    Attributes
    ----------
    name
        In file names and tables.
    label
        In figures.
    algorithm
        In the registry; of a general optimiser, its name.
    parameters
        By scale and size.
    warm_up
        Parameters with which it runs for a moment, so that what is timed afterwards is compiled.
    cells
        Where it is run.
    """

    name: str
    label: str
    algorithm: str
    parameters: ParametersOf
    warm_up: Mapping[str, Any]
    breadth: Breadth = Breadth.ALL
    kind: Kind = Kind.SOLVE
    cells: tuple[Cell, ...] = GRID


_FEW_EPOCHS = {"n_epochs": 4, "buffer_size": 2, "batch_size": 2}
_DQN_CELLS = tuple(cell for cell in (*SMALL, *GRID) if max(cell) <= MAX_DQN_CELL)


def _table_1(scale: Scale, cell: Cell) -> dict[str, Any]:
    return {"mode": "paper", **_epochs(scale.epochs if cell in SHOWN else scale.grid_epochs)}


def _near(scale: Scale, cell: Cell) -> dict[str, Any]:  # noqa: ARG001 - the same at every size
    return {"mode": "paper", **_epochs(scale.grid_epochs)}


def _epochs(n_epochs: int) -> dict[str, int]:
    # Table 1's 50,000 steps of annealing belong to its 50,000 epochs.
    return {"n_epochs": n_epochs, "epsilon_anneal_steps": max(1, min(n_epochs, TABLE_1_EPOCHS))}


def _fixed(**parameters: Any) -> ParametersOf:
    return lambda _scale, _cell: dict(parameters)


def _timed(scale: Scale, _cell: Cell) -> dict[str, Any]:
    return {"seconds": scale.seconds}


METHODS: Mapping[str, Method] = {
    method.name: method
    for method in (
        Method(
            "ga",
            "genetic algorithm (Table 2)",
            "ga",
            _fixed(),
            {"iteration": 3},
            cells=(*GRID, *SMALL),
        ),
        Method(
            "qmix-paper",
            "QMIX from scratch (Algorithm 1)",
            "qmix",
            _table_1,
            {"mode": "paper", **_FEW_EPOCHS},
            Breadth.LEARNING,
            cells=(*GRID, *SMALL),
        ),
        Method(
            "transfer-paper",
            "transfer QMIX (Algorithm 2)",
            "transfer_qmix",
            _fixed(mode="paper"),
            {},
        ),
        Method(
            "transfer-near",
            "transfer QMIX from a neighbouring task",
            "transfer_qmix",
            _near,
            {},
            Breadth.LEARNING,
            Kind.NEAR,
            SHOWN,
        ),
        Method(
            "dqn",
            "DQN over joint actions (Eq. 15)",
            "dqn",
            lambda scale, _cell: _epochs(scale.grid_epochs),
            _FEW_EPOCHS,
            Breadth.LEARNING,
            cells=_DQN_CELLS,
        ),
        Method(
            "transfer-service",
            "transfer_qmix of the service",
            "transfer_qmix",
            _fixed(),
            {"samples": 2, "n_epochs": 1, "polish_moves": 1000},
        ),
        Method(
            "qmix-service",
            "qmix of the service",
            "qmix",
            lambda scale, _cell: {"n_epochs": scale.service_epochs},
            {"n_epochs": 4, "batch_size": 2},
            Breadth.LEARNING,
        ),
        Method("auto", "auto", "auto", _fixed(), {"moves": 1000, "policy": True}),
        Method("greedy", "greedy rule", "greedy", _fixed(), {}, Breadth.ONCE, cells=(*GRID, *SMALL)),
        Method(
            "local-search",
            "long local search",
            "local_search",
            lambda scale, _cell: {"moves": scale.reference_moves},
            {"moves": 1000},
            Breadth.ONCE,
            cells=(*GRID, *SMALL),
        ),
        Method(
            "exact",
            "branch and bound",
            "exact",
            lambda scale, _cell: {"nodes": scale.nodes},
            {"nodes": 1},
            Breadth.ONCE,
            cells=(*GRID, *SMALL),
        ),
        Method("timed-auto", "auto", "auto", _timed, {}, Breadth.TIMED, Kind.TIMED),
        Method(
            "timed-transfer-service",
            "transfer_qmix of the service",
            "transfer_qmix",
            _timed,
            {},
            Breadth.TIMED,
            Kind.TIMED,
        ),
        Method("timed-pyvrp", "PyVRP", "pyvrp", _timed, {}, Breadth.TIMED, Kind.TIMED),
        Method("timed-ortools", "OR-Tools routing", "ortools", _timed, {}, Breadth.TIMED, Kind.TIMED),
    )
}
"""Every method by its name."""

GENERAL_OPTIMISERS = ("pyvrp", "ortools")
"""Algorithms that are packages of the extra ``compare``."""
