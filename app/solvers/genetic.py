"""The paper's genetic algorithm (section 5.2.2, Table 2) on the compiled simulator.

The paper gives its parameters and no operators. Here a chromosome holds, for every UAV, an ordered list of
S targets. It is decoded through the simulator: at each step a UAV makes the visit that it is committed to,
or takes the first entry left in its list that is allowed at that moment, and flies home when the list is
used up or says so; every chromosome is a legal plan. Parents are chosen by binary tournaments, a child takes
each UAV's whole list from either parent, each gene may be redrawn, and the best chromosome survives.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.errors import ProblemTooLarge
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.domain.said import said
from app.simulation.arrays import Floats, Integers, ProblemArrays, compile_problem
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, close, new_episodes, promised, reset_one, verdict
from app.simulation.visit import ALLOWED
from app.solvers.parameters import GeneticParameters
from app.solvers.protocol import History, Progress, Report, Solution, SolverContext, StopCriterion
from app.solvers.seeds import seed_sequence

CHUNK_GENES = 100_000
"""Genes decoded between two looks at the stop criterion: some milliseconds."""

_EQUAL = 1e-12
"""Relative difference of rewards that is only rounding."""

MAX_GENES = 50_000_000
"""Largest population times steps times UAVs; a population of that size takes 400 MB, twice."""


class Flight(NamedTuple):
    """What it takes to fly one chromosome after the other.

    Attributes
    ----------
    arrays
        A stack of one problem.
    episodes
        One episode, overwritten by every flight.
    cursor
        (M,) first entry of each UAV's list that is left.
    actions
        (S, M) the plan of the last flight.
    """

    arrays: ProblemArrays
    episodes: Episodes
    cursor: Integers
    actions: Integers


class GeneticAlgorithm:
    """A :class:`~app.solvers.protocol.Solver`; an epoch of its history is a generation."""

    def __init__(self, parameters: GeneticParameters, context: SolverContext) -> None:  # noqa: ARG002 - as the protocol has it
        self.parameters = parameters

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`."""
        _check_size(self.parameters.num_total, problem)
        rng = np.random.default_rng(seed_sequence(seed))
        genes = (problem.max_steps, problem.n_uavs)
        arrays = compile_problem(problem)
        flight = Flight(
            arrays, new_episodes(arrays, 1), np.empty(problem.n_uavs, np.int64), np.empty(genes, np.int64)
        )
        size, generations = self.parameters.num_total, self.parameters.iteration
        rates = self.parameters.crossover_rate, self.parameters.mutation_rate
        slices = _slices(size, problem.max_steps * problem.n_uavs)
        population, fitness = np.empty((size, *genes), np.int64), np.full(size, -np.inf)
        complete = _begin(flight, population, fitness, slices, rng, stop)
        if len(slices) > 1:
            children, child_fitness = np.empty_like(population), np.empty_like(fitness)

        def incumbent() -> Plan:
            decode(flight, population[fittest(fitness)])
            return Plan.of(flight.actions, problem.n_targets)

        history = History()
        history.add(0, float(fitness.max()))
        done = 0
        while complete and done < generations and not stop():
            if len(slices) == 1:
                best = np.empty(min(max(1, CHUNK_GENES // population.size), generations - done))
                population, fitness = evolve(flight, population, fitness, best, rates, rng)
            else:
                complete = _next(
                    flight, population, fitness, children, child_fitness, slices, rates, rng, stop
                )
                population, children = children, population
                fitness, child_fitness = child_fitness, fitness
                best = np.array([fitness[fittest(fitness)]])
            for reward in best:
                done += 1
                history.add(done, float(reward))
            report(Progress(done / generations, done, float(best[-1]), incumbent()))
        return Solution(incumbent(), history, self.parameters)


def _slices(size: int, genes: int) -> list[tuple[int, int]]:
    """Cut a population of chromosomes into ranges that take some milliseconds each."""
    length = max(1, CHUNK_GENES // genes)
    return [(first, min(first + length, size)) for first in range(0, size, length)]


def _begin(
    flight: Flight,
    population: Integers,
    fitness: Floats,
    slices: list[tuple[int, int]],
    rng: np.random.Generator,
    stop: StopCriterion,
) -> bool:
    """Draw and fly the first generation; False if it was stopped, then at least the first has flown."""
    home = flight.arrays.areas["level"].shape[1]
    for first, last in slices:
        if first > 0 and stop():
            return False
        actions = home + 1 + flight.arrays.n_bases
        population[first:last] = rng.integers(0, actions, population[first:last].shape)
        if first == 0:
            # Flying nowhere is a plan too: the answer is legal and earns 0 however early it must stop.
            population[0] = home
            fitness[0] = decode(flight, population[0])
            if stop():
                return False
        for c in range(max(1, first), last):
            fitness[c] = decode(flight, population[c])
    return True


def _next(
    flight: Flight,
    population: Integers,
    fitness: Floats,
    children: Integers,
    child_fitness: Floats,
    slices: list[tuple[int, int]],
    rates: tuple[float, float],
    rng: np.random.Generator,
    stop: StopCriterion,
) -> bool:
    """Breed one generation; False if it was stopped, then the best parent and some children are in it."""
    child_fitness[:] = -np.inf
    for first, last in slices:
        if first > 0 and stop():
            return False
        breed(flight, population, fitness, children, child_fitness, first, last, rates, rng)
    return True


def _check_size(num_total: int, problem: Problem) -> None:
    genes = num_total * problem.max_steps * problem.n_uavs
    if genes > MAX_GENES:
        raise ProblemTooLarge(
            said(
                "num_total {num_total} times {steps} steps times {uavs} UAVs are {genes} genes; the limit is "
                "{limit}",
                num_total=num_total,
                steps=problem.max_steps,
                uavs=problem.n_uavs,
                genes=genes,
                limit=MAX_GENES,
            ),
            details={"genes": genes, "limit": MAX_GENES},
        )


@compiled
def decode(flight: Flight, genes: Integers) -> float:
    """Fly a chromosome, leave its plan in ``flight.actions`` and return its reward.

    Parameters
    ----------
    flight
        Scratch space.
    genes
        (S, M); column i is UAV i's list of targets and bases, N ends it.
    """
    arrays, episodes = flight.arrays, flight.episodes
    home = arrays.need.shape[1]
    steps, m = genes.shape
    reset_one(arrays, episodes, 0)
    reward = 0.0
    for i in range(m):
        flight.cursor[i] = 0
    for s in range(steps):
        for i in range(m):
            action = promised(arrays, episodes, 0, i)
            while action == home and flight.cursor[i] < steps:
                gene = genes[flight.cursor[i], i]
                flight.cursor[i] += 1
                if gene == home or verdict(arrays, episodes, 0, i, gene) == ALLOWED:
                    action = gene
                    break
            flight.actions[s, i] = action
            reward += act(arrays, episodes, 0, i, action)
    return reward + close(arrays, episodes, 0)


@njit(cache=True, error_model="numpy")
def evolve(
    flight: Flight,
    population: Integers,
    fitness: Floats,
    best: Floats,
    rates: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[Integers, Floats]:
    """Breed as many generations as `best` has room for, writing each one's best reward there.

    Parameters
    ----------
    flight
        Scratch space.
    population, fitness
        (P, S, M) chromosomes and (P,) their rewards.
    best
        (G,), overwritten.
    rates
        Probability that two parents are crossed, and that a gene is redrawn.
    rng
        The only source of randomness.

    Returns
    -------
    population, fitness
        After G generations.
    """
    children, child_fitness = np.empty_like(population), np.empty_like(fitness)
    # A literal 0 would be a type of its own, and the call from Python compile a second time.
    start = int(np.int64(0))
    for generation in range(len(best)):
        breed(flight, population, fitness, children, child_fitness, start, len(fitness), rates, rng)
        population, children = children, population
        fitness, child_fitness = child_fitness, fitness
        best[generation] = fitness[fittest(fitness)]
    return population, fitness


@njit(cache=True, error_model="numpy")
def breed(
    flight: Flight,
    population: Integers,
    fitness: Floats,
    children: Integers,
    child_fitness: Floats,
    first: int,
    last: int,
    rates: tuple[float, float],
    rng: np.random.Generator,
) -> None:
    """Breed some children of a generation; the first child is the best parent.

    Parameters
    ----------
    flight
        Scratch space.
    population, fitness
        (P, S, M) parents and (P,) their rewards.
    children, child_fitness
        The same of the next generation, overwritten where children are born.
    first, last
        The first child, and the one after the last.
    rates, rng
        As in :func:`evolve`.
    """
    crossover_rate, mutation_rate = rates
    _, steps, m = population.shape
    actions = flight.arrays.need.shape[1] + 1 + flight.arrays.stock.shape[1]
    if first == 0:
        best = fittest(fitness)
        children[0], child_fitness[0] = population[best], fitness[best]
        first = 1
    for c in range(first, last):
        mother = population[_winner(fitness, rng)]
        father = population[_winner(fitness, rng)] if rng.random() < crossover_rate else mother
        for i in range(m):
            parent = mother if rng.random() < 0.5 else father
            for s in range(steps):
                redrawn = rng.random() < mutation_rate
                children[c, s, i] = rng.integers(0, actions) if redrawn else parent[s, i]
        child_fitness[c] = decode(flight, children[c])


@njit(cache=True, error_model="numpy")
def _winner(fitness: Floats, rng: np.random.Generator) -> int:
    """Binary tournament."""
    a, b = rng.integers(0, len(fitness)), rng.integers(0, len(fitness))
    return int(a if fitness[a] >= fitness[b] - _EQUAL * abs(fitness[b]) else b)


@njit(cache=True, error_model="numpy")
def fittest(fitness: Floats) -> int:
    """Return the first of the best chromosomes; rewards that differ by rounding only are equal."""
    most = fitness.max()
    for c in range(len(fitness)):
        if fitness[c] >= most - _EQUAL * abs(most):
            return c
    return 0
