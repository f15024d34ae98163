"""The algorithms by name: one line each, and everything else finds them here.

Implementations are named, not imported: listing the algorithms and checking their parameters loads neither
torch nor compiled code, so the web process can do it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple, cast, get_args

from pydantic import ValidationError

from app.domain.errors import InvalidParameters, UnknownAlgorithm, Violation
from app.domain.problem import Problem
from app.domain.said import said
from app.domain.world_use import require_unused, used_fields
from app.field_errors import in_words
from app.solvers.protocol import STORED, Parameters, Solver, SolverContext

_FLOOR = "app.solvers.floor:Floor"
"""Keeps every algorithm's answers from falling below what is known without it."""

_PLANNED_UNLOADING = "app.solvers.unloading.solver:PlannedUnloading"
"""Lends every algorithm the unloading that is planned."""

_UNOBSERVED = "app.learning.paper.observed:unobserved"
"""Which fields of a problem the paper's networks cannot take, and why."""

_PAPERS_NETWORKS = "app.learning.paper.architecture:QMIX_PAPER_1"
"""Architecture of policies that the paper's networks are."""

_PAPER = "paper"
"""The mode that is the paper's."""


class Unsupported(NamedTuple):
    """A field of a problem that an algorithm refuses.

    Attributes
    ----------
    field
        As the specification writes it, such as ``objective.half_life``.
    mode
        In which mode of the algorithm; None where it has none.
    reason
        Why, and what to do instead.
    """

    field: str
    mode: str | None
    reason: str


@dataclass(frozen=True, slots=True)
class Algorithm:
    """One line of the registry.

    Attributes
    ----------
    name
        As in ``POST /allocate``.
    summary
        One sentence for a person who chooses.
    solver
        ``"module:Class"`` of the :class:`~app.solvers.protocol.Solver`.
    parameters
        ``"module:Class"`` of its :class:`~app.solvers.protocol.Parameters`, in a module without torch.
    learns
        Whether its solutions carry a checkpoint that the library can hold.
    comparison
        Whether it is there to be compared with, as the paper's own are. Its answers are its own also where
        they earn less than the greedy rule's.
    observes
        Whether it learns by the paper's observation: always, or in paper mode where it has one. Then it
        refuses fields of a problem whose reward does not follow from what is observed.
    """

    name: str
    summary: str
    solver: str
    parameters: str
    learns: bool = False
    comparison: bool = False
    observes: bool = False

    def parameter_model(self) -> type[Parameters]:
        """Return the class of its parameters."""
        return cast(type[Parameters], _resolve(self.parameters))

    def unsupported(self) -> Iterator[Unsupported]:
        """Yield what it refuses of a problem, mode by mode."""
        field = self.parameter_model().model_fields.get("mode")
        for mode in (None,) if field is None else get_args(field.annotation):
            for name, reason in self.unsupported_in(mode).items():
                yield Unsupported(name, mode, reason)

    def unsupported_in(self, mode: str | None) -> Mapping[str, str]:
        """Return the fields that it refuses in a mode, None where it has none, each with the reason."""
        if not self.observes or mode not in (None, _PAPER):
            return {}
        return cast(Mapping[str, str], _resolve(_UNOBSERVED)())


ALGORITHMS: Mapping[str, Algorithm] = {
    algorithm.name: algorithm
    for algorithm in (
        Algorithm(
            "transfer_qmix",
            "Carries a source policy of the library over to the problem; Algorithm 2 in paper mode",
            "app.learning.transfer:TransferQmix",
            "app.learning.parameters:TransferQmixParameters",
            learns=True,
            observes=True,
        ),
        Algorithm(
            "qmix",
            "Multi-agent Q-learning with a monotonic mixing network, from scratch (Algorithm 1)",
            "app.learning.qmix:Qmix",
            "app.learning.parameters:QmixParameters",
            learns=True,
            observes=True,
        ),
        Algorithm(
            "dqn",
            "Q-learning over the joint action space (Eq. 15); small problems only, to compare with",
            "app.learning.dqn:Dqn",
            "app.learning.parameters:DqnParameters",
            comparison=True,
            observes=True,
        ),
        Algorithm(
            "ga",
            "The paper's genetic algorithm (Table 2)",
            "app.solvers.genetic:GeneticAlgorithm",
            "app.solvers.parameters:GeneticParameters",
            comparison=True,
        ),
        Algorithm(
            "local_search",
            "Simulated annealing over plans with incremental evaluation, from the greedy rule's plan",
            "app.solvers.local_search.solver:LocalSearch",
            "app.solvers.parameters:LocalSearchParameters",
        ),
        Algorithm(
            "auto",
            "The best plan in the time there is: local search from the best of several starts, the learned "
            "policy's among them where that pays",
            "app.learning.auto:Auto",
            "app.solvers.parameters:AutoParameters",
        ),
        Algorithm(
            "exact",
            "The best plan of a small problem with the proof that none is better; small problems only",
            "app.solvers.exact:Exact",
            "app.solvers.parameters:ExactParameters",
        ),
        Algorithm(
            "greedy",
            "Every UAV in turn takes the visit that earns most at once; the yardstick",
            "app.solvers.greedy:Greedy",
            "app.solvers.parameters:GreedyParameters",
        ),
        Algorithm(
            "particle_swarm",
            "Particle swarm with variable neighbourhood search",
            "app.solvers.swarms.particle_swarm:ParticleSwarm",
            "app.solvers.comparison_parameters:ParticleSwarmParameters",
            comparison=True,
        ),
        Algorithm(
            "grey_wolf",
            "Grey wolf optimisation",
            "app.solvers.swarms.grey_wolf:GreyWolf",
            "app.solvers.comparison_parameters:GreyWolfParameters",
            comparison=True,
        ),
        Algorithm(
            "beetle_antennae",
            "Beetle swarm: a particle swarm whose members feel with two antennae",
            "app.solvers.swarms.beetle_antennae:BeetleAntennae",
            "app.solvers.comparison_parameters:BeetleAntennaeParameters",
            comparison=True,
        ),
        Algorithm(
            "ant_colony",
            "Ant colony with division of labour by response thresholds, and circular competition",
            "app.solvers.ant_colony.solver:AntColony",
            "app.solvers.comparison_parameters:AntColonyParameters",
            comparison=True,
        ),
        Algorithm(
            "contract_net",
            "Contract net: announcement, bids, award and exchange of contracts by messages between UAVs",
            "app.solvers.markets.solver:ContractNetSolver",
            "app.solvers.comparison_parameters:ContractNetParameters",
            comparison=True,
        ),
        Algorithm(
            "bundles",
            "Consensus-based bundle algorithm: UAVs bid for bundles of areas and agree by messages",
            "app.solvers.markets.solver:BundleSolver",
            "app.solvers.comparison_parameters:BundleParameters",
            comparison=True,
        ),
        Algorithm(
            "semi_random_q",
            "Q-learning with a table for every UAV and semi-random exploration",
            "app.solvers.q_learning.solver:SemiRandomQLearning",
            "app.solvers.comparison_parameters:SemiRandomQParameters",
            comparison=True,
        ),
    )
}


def algorithm(name: str) -> Algorithm:
    """Find an algorithm.

    Raises
    ------
    UnknownAlgorithm
        If there is none of that name.
    """
    found = ALGORITHMS.get(name)
    if found is None:
        names = list(ALGORITHMS)
        detail = said("no algorithm is called {name!r}; there are {names}", name=name, names=names)
        raise UnknownAlgorithm(detail, [Violation("/algorithm", detail)], {"algorithms": names})
    return found


def parse_parameters(name: str, given: Mapping[str, Any], *, stored: bool = False) -> Parameters:
    """Check an algorithm's parameters and fill in the defaults.

    Parameters
    ----------
    name
        The algorithm.
    given
        Its parameters.
    stored
        Whether they come from a job, maybe of an earlier version, instead of from a request: then what their
        mode has no use for is left out, not refused.

    Raises
    ------
    UnknownAlgorithm
        If there is no such algorithm.
    InvalidParameters
        If a parameter is unknown, out of range or of no use to the mode; violations point into
        ``/parameters``.
    """
    model = algorithm(name).parameter_model()
    try:
        return model.model_validate(dict(given), context={STORED: stored})
    except ValidationError as error:
        violations = [
            Violation("/".join(("/parameters", *map(str, e["loc"]))), in_words(e, list(model.model_fields)))
            for e in error.errors(include_url=False)
        ]
        raise InvalidParameters(
            f"parameters of {name}: {violations[0].pointer}: {violations[0].detail}", violations
        ) from None


def require_supported(name: str, parameters: Parameters, problem: Problem) -> None:
    """Refuse a problem that uses a field that an algorithm cannot take.

    Raises
    ------
    UnknownAlgorithm
        If there is no such algorithm.
    InvalidProblem
        With a violation for every such field, which says what to do instead.
    """
    require_unused(problem, algorithm(name).unsupported_in(_mode_of(parameters)))


def unusable_architecture(problem: Problem) -> str | None:
    """Return the architecture whose policies cannot serve a problem, because they do not observe all of it.

    Returns
    -------
    str or None
        That of the paper's networks, or None where every policy can serve it.
    """
    unobserved = _resolve(_UNOBSERVED)()
    unusable = any(used.name in unobserved for used in used_fields(problem))
    return cast(str, _resolve(_PAPERS_NETWORKS)) if unusable else None


def create_solver(
    name: str, parameters: Parameters, context: SolverContext, *, keeps_checkpoint: bool = True
) -> Solver:
    """Load an algorithm's implementation and build it, able to plan the unloading too.

    No answer of it earns less than staying at home, and none but of the algorithms for comparison and of
    paper mode less than the greedy rule. Where no plan earns more than staying at home, it answers at once.

    Parameters
    ----------
    name, parameters, context
        The algorithm, and what it is built from.
    keeps_checkpoint
        Whether what it learns is asked for, so that it learns also where no plan earns anything.

    Raises
    ------
    UnknownAlgorithm
        If there is no such algorithm.
    """
    line = algorithm(name)
    solver = _resolve(line.solver)(parameters, context)
    own = line.comparison or _mode_of(parameters) == _PAPER
    learns = line.learns and keeps_checkpoint
    floored = _resolve(_FLOOR)(solver, parameters, greedy=not own, learns=learns)
    return cast(Solver, _resolve(_PLANNED_UNLOADING)(floored, context))


def _mode_of(parameters: Parameters) -> str | None:
    return getattr(parameters, "mode", None)


def _resolve(dotted: str) -> Any:
    module, _, name = dotted.partition(":")
    return getattr(import_module(module), name)
