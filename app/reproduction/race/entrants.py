"""Who runs: each in a race of equal evaluations, of equal seconds, or as a reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from app.reproduction.methods import TABLE_1_EPOCHS
from app.reproduction.scale import Scale

_ENDLESS = 1_000_000
"""Generations or epochs of what would otherwise end before the time does."""


class Budget(StrEnum):
    """What all get as much of. A reference has a budget of its own: it says how good a plan can be."""

    EVALUATIONS = "evaluations"
    SECONDS = "seconds"
    REFERENCE = "reference"


@dataclass(frozen=True, slots=True)
class Entrant:
    """One algorithm in one race.

    Attributes
    ----------
    name
        In file names and tables.
    label
        In figures.
    algorithm
        In the registry; of a general optimiser, its name.
    budget
        Which race.
    parameters
        By scale.
    first, per_epoch
        Evaluations before the first epoch of its history, and in each.
    learns
        Whether it learns a network, so that it is run on few problems and seeds.
    """

    name: str
    label: str
    algorithm: str
    budget: Budget
    parameters: Callable[[Scale], dict[str, Any]]
    first: int = 0
    per_epoch: int = 1
    learns: bool = False

    def evaluations(self, epoch: int) -> int:
        """Return how many plans were flown until an epoch of its history was over."""
        return self.first + epoch * self.per_epoch


_POPULATION = 30
"""Table 2."""

COMPARED = {
    "particle_swarm": "particle swarm, VNS [4]",
    "grey_wolf": "grey wolf [5]",
    "ant_colony": "ant colony [6]",
    "contract_net": "contract net [7]",
    "bundles": "consensus-based bundles",
    "beetle_antennae": "beetle swarm [8]",
    "semi_random_q": "semi-random Q-learning [14]",
}
"""The algorithms for comparison that have no paper mode, with the number of the paper's reference."""


def _qmix(scale: Scale) -> dict[str, Any]:
    epochs = max(1, scale.race_evaluations)
    return {"mode": "paper", "n_epochs": epochs, "epsilon_anneal_steps": min(epochs, TABLE_1_EPOCHS)}


def _entrants() -> list[Entrant]:
    equal, timed, reference = Budget
    found = [
        Entrant(
            "ga",
            "genetic algorithm (Table 2)",
            "ga",
            equal,
            lambda scale: {"iteration": max(0, scale.race_evaluations // _POPULATION - 1)},
            _POPULATION,
            _POPULATION,
        ),
        Entrant("qmix-paper", "QMIX from scratch (Algorithm 1)", "qmix", equal, _qmix, learns=True),
        Entrant(
            "transfer-paper",
            "transfer QMIX (Algorithm 2)",
            "transfer_qmix",
            equal,
            lambda _scale: {"mode": "paper"},
            learns=True,
        ),
        *(
            Entrant(name, label, name, equal, lambda scale: {"evaluations": scale.race_evaluations})
            for name, label in COMPARED.items()
        ),
        Entrant(
            "timed-ga",
            "genetic algorithm (Table 2)",
            "ga",
            timed,
            lambda _scale: {"iteration": _ENDLESS},
            _POPULATION,
            _POPULATION,
        ),
        Entrant(
            "timed-qmix-paper",
            "QMIX from scratch (Algorithm 1)",
            "qmix",
            timed,
            lambda _scale: {"mode": "paper", "n_epochs": _ENDLESS},
            learns=True,
        ),
        Entrant(
            "timed-transfer-service",
            "transfer_qmix of the service",
            "transfer_qmix",
            timed,
            lambda _scale: {},
        ),
        *(
            Entrant(f"timed-{name}", label, name, timed, lambda _scale: {})
            for name, label in COMPARED.items()
        ),
        Entrant("timed-auto", "auto", "auto", timed, lambda _scale: {}),
        Entrant("timed-pyvrp", "PyVRP", "pyvrp", timed, lambda _scale: {}),
        Entrant("timed-ortools", "OR-Tools routing", "ortools", timed, lambda _scale: {}),
        Entrant("greedy", "greedy rule", "greedy", reference, lambda _scale: {}),
        Entrant(
            "local-search",
            "long local search",
            "local_search",
            reference,
            lambda scale: {"moves": scale.reference_moves},
        ),
        Entrant("exact", "branch and bound", "exact", reference, lambda scale: {"nodes": scale.nodes}),
    ]
    return found


ENTRANTS: Mapping[str, Entrant] = {entrant.name: entrant for entrant in _entrants()}
"""Every entrant by its name."""
