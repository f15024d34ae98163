"""Whether two versions of the service give the same answers, to the byte.

200 requests of every algorithm, family and option, none with a time limit, so that an answer follows from
its request. `record` keeps them with their answers; `compare` sends the same ones to another version:

    python tests/benchmarks/same_answers.py record answers.jsonl --url http://127.0.0.1:8000
    python tests/benchmarks/same_answers.py compare answers.jsonl --url http://127.0.0.1:9000

Times and ids of jobs are left out, and nothing else.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from app.api.openapi_examples import example_problem
from app.domain.problem import Problem
from app.domain.records import problem_to_record
from app.simulation.generator import FAMILIES, generate

COUNT = 200
OF_TIME = ("job_id", "elapsed_s", "timings")
ALGORITHMS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("greedy", {}),
    ("local_search", {"moves": 20_000}),
    ("auto", {"moves": 20_000}),
    ("ga", {}),
    ("transfer_qmix", {}),
    ("transfer_qmix", {"n_epochs": 0, "polish": False, "samples": 16}),
    ("transfer_qmix", {"mode": "paper", "n_epochs": 20}),
    ("qmix", {"n_epochs": 20}),
    ("qmix", {"mode": "paper", "n_epochs": 60, "evaluate_per_epoch": 20, "learning_starts": 32}),
    ("dqn", {"n_epochs": 60, "evaluate_per_epoch": 20, "learning_starts": 32}),
    ("exact", {"nodes": 30}),
)
SIZES = ((3, 5, 2), (5, 10, 3), (10, 20, 3), (5, 10, 3), (20, 30, 2))
LEARNS_SIZE = (5, 10, 3)
"""The only size of those above that paper mode transfers to, and that a learner is quick at."""


def requests() -> Iterator[dict[str, Any]]:
    """Make the requests; the same ones each time."""
    rng = np.random.default_rng(20)
    families = itertools.cycle(sorted(FAMILIES))
    for number in range(COUNT):
        algorithm, parameters = ALGORITHMS[number % len(ALGORITHMS)]
        size = SIZES[number % len(SIZES)]
        if parameters.get("mode") == "paper" or algorithm in ("qmix", "dqn", "exact"):
            size = LEARNS_SIZE
        problem = _with_options(generate(next(families), *size, rng), number, algorithm)
        yield {
            **problem_to_record(problem),
            "algorithm": algorithm,
            "parameters": parameters,
            "seed": number,
            "bound": number % 7 == 0 and size == SIZES[0],
        }
    yield {**example_problem("cyclone-idai")}


def _with_options(problem: Problem, number: int, algorithm: str) -> Problem:
    """Give a problem what its family has not: each option in some requests, none in most."""
    objective = problem.objective
    planned = number % 4 == 1 and algorithm in ("greedy", "local_search", "auto")
    objective = replace(
        objective,
        return_to_base=number % 5 != 2,
        charge_return=number % 6 == 3,
        unloading="planned" if planned else "greedy",
    )
    targets = tuple(
        replace(
            target,
            service_time=0.1 * (j % 3) if number % 3 == 0 else target.service_time,
            requested=tuple(2.0 * need for need in target.loadlist) if (number + j) % 9 == 0 else None,
        )
        for j, target in enumerate(problem.targets)
    )
    return replace(problem, objective=objective, targets=targets)


def answer_of(client: httpx.Client, request: dict[str, Any]) -> dict[str, Any]:
    """Return status and answer, without what a clock says."""
    response = client.post("/allocate", json=request)
    told = response.json()
    for name in (*OF_TIME, "instance"):
        told.pop(name, None)
    return {"status": response.status_code, "answer": told}


def main() -> int:
    """Record or compare; the exit status is 1 where something differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    given = parser.parse_args()
    with httpx.Client(base_url=given.url, timeout=600) as client:
        if given.what == "record":
            with given.file.open("w", encoding="utf-8") as file:
                for request in requests():
                    line = {"request": request, **answer_of(client, request)}
                    file.write(json.dumps(line, allow_nan=False) + "\n")
            return 0
        differ = 0
        lines = given.file.read_text(encoding="utf-8").splitlines()
        for number, line in enumerate(map(json.loads, lines)):
            now = answer_of(client, line["request"])
            for name in sorted({*line["answer"], *now["answer"]}):
                before, after = line["answer"].get(name), now["answer"].get(name)
                if before != after or line["status"] != now["status"]:
                    differ += 1
                    print(
                        f"{number} {line['request']['algorithm']} {name}: {before!r:.200} -> {after!r:.200}"
                    )
                    break
        print(f"{differ} of {len(lines)} answers differ")
        return int(differ > 0)


if __name__ == "__main__":
    sys.exit(main())
