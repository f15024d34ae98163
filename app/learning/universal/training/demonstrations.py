"""Plans of generated problems, by the compiled local search: what the policy learns from; and their files."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from app.domain.plan import Actions, Plan
from app.domain.problem import Problem
from app.domain.records import problem_from_record, problem_to_record
from app.learning.universal.training.curriculum import draw_problem
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.solvers.protocol import SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.scale import largest_level
from app.solvers.stop import never

_NOTHING = 1e-9
"""Reward, in largest levels, up to which a plan has earned nothing."""


class Demonstration(NamedTuple):
    """A problem and a searched plan of it.

    Attributes
    ----------
    problem
        With greedy unloading.
    plan
        (S', M) joint actions, with a row after the last visit that sends everybody home, if there is one.
    reward
        Of the plan, above 0.
    first
        Step, from 0, from which on its actions are worth imitating.
    played
        Of a correction, the reward of what the policy did.
    """

    problem: Problem
    plan: Actions
    reward: float
    first: int = 0
    played: float | None = None


def moves_for(problem: Problem, search: float) -> int:
    """Return the moves of a search: more for larger problems, and a share of these."""
    moves = np.clip(180 * problem.n_uavs * problem.n_targets, 9_000, 180_000)
    return max(1, round(search * float(moves)))


def demonstrate(problem: Problem, moves: int, rng: np.random.Generator) -> Demonstration | None:
    """Search a plan, from the greedy rule's or the problem's own; None where nothing can be earned."""
    solver = create_solver(
        "local_search", parse_parameters("local_search", {"moves": moves, "restarts": 0}), SolverContext()
    )
    plan = solver.solve(problem, int(rng.integers(2**31)), never, lambda _progress: None).plan
    reward = reward_of(problem, plan)
    if reward <= _NOTHING * largest_level(compile_problem(problem)):
        return None
    return Demonstration(problem, with_return(plan, problem), reward)


def with_return(plan: Plan, problem: Problem) -> Actions:
    """Return the actions of a plan, with a row that sends everybody home at the end, if there is a step."""
    actions = Plan.of(plan.assignment, problem.n_targets).as_array()
    if len(actions) == problem.max_steps:
        return actions
    return np.pad(actions, ((0, 1), (0, 0)), constant_values=problem.n_targets)


Make = Callable[[Problem, np.random.Generator], Demonstration | None]
"""Makes a demonstration of a problem, or finds that there is nothing to show."""


@dataclass(frozen=True, slots=True)
class Series:
    """Files of demonstrations of one kind, numbered from 0.

    Attributes
    ----------
    name
        Begins the names of the files.
    stream
        Tells their random numbers from those of other series.
    size
        Demonstrations a file.
    """

    name: str
    stream: tuple[int, ...]
    size: int

    def write(self, folder: Path, seed: int, number: int, make: Make) -> Path:
        """Make one file, unless it is there.

        Parameters
        ----------
        folder
            Where the files are.
        seed, number
            They decide, with the stream, which problems it has and how they are searched.
        make
            Makes its demonstrations, of problems that are drawn until there are enough.
        """
        path = folder / f"{self.name}-{seed}-{number:05}.jsonl"
        if not path.exists():
            rng = np.random.default_rng([seed, number, *self.stream])
            shown: list[Demonstration] = []
            while len(shown) < self.size:
                made = make(draw_problem(rng), rng)
                if made is not None:
                    shown.append(made)
            write_demonstrations(path, shown)
        return path


def write_demonstrations(path: Path, shown: Sequence[Demonstration]) -> None:
    """Write a JSON object a line, so that the file is there whole or not at all."""
    partial = path.with_suffix(".part")
    with partial.open("w", encoding="utf-8") as file:
        for each in shown:
            record = each._replace(plan=each.plan.tolist())._asdict()
            record["problem"] = problem_to_record(each.problem)
            file.write(json.dumps(record, allow_nan=False, separators=(",", ":")) + "\n")
    os.replace(partial, path)


def read_demonstrations(path: Path) -> list[Demonstration]:
    """Read what :func:`write_demonstrations` wrote."""
    with path.open(encoding="utf-8") as file:
        return [_read(json.loads(line)) for line in file]


def _read(record: dict[str, Any]) -> Demonstration:
    problem, plan = problem_from_record(record.pop("problem")), np.array(record.pop("plan"), np.int64)
    return Demonstration(problem, plan, **record)
