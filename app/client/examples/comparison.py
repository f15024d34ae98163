"""A researcher's comparison: every problem with every algorithm and seed, in a table of means.

    python comparison.py http://127.0.0.1:8000

Requests are sent at the same time; the service queues them. The idempotency key of each names its experiment,
so that the same command goes on where it was interrupted. Needs the package uav-allocator-client.
"""

import asyncio
import statistics
import sys

from uav_allocator_client import AsyncClient, types

PROBLEMS = ("paper-5x10", "cyclone-idai")
ALGORITHMS: tuple[types.AlgorithmName, ...] = ("greedy", "ga", "local_search", "transfer_qmix")
SEEDS = (1, 2, 3)
TIME_LIMIT_S = 1.0


async def run(service: AsyncClient, name: str, algorithm: types.AlgorithmName, seed: int) -> float:
    """Return the reward of one run."""
    problem = await service.example(name)
    key = f"comparison/{name}/{algorithm}/{seed}/{TIME_LIMIT_S:g}"
    job = await service.submit(
        problem, algorithm=algorithm, seed=seed, time_limit_s=TIME_LIMIT_S, idempotency_key=key
    )
    answer = await service.answer(job["id"])
    assert answer["answered_by"] == algorithm, "another algorithm has answered: the service was too busy"
    return answer["reward"]


async def main(url: str, key: str | None = None) -> None:
    """Run all, and print a row for each problem and algorithm."""
    async with AsyncClient(url, key, retry_s=600) as service:
        runs = [(name, each, seed) for name in PROBLEMS for each in ALGORITHMS for seed in SEEDS]
        at_once = asyncio.Semaphore((await service.readiness())["workers"])

        async def limited(name: str, algorithm: types.AlgorithmName, seed: int) -> float:
            async with at_once:  # a run that waits has less of its time limit left to search
                return await run(service, name, algorithm, seed)

        rewards = await asyncio.gather(*(limited(*each) for each in runs))
    found = dict(zip(runs, rewards, strict=True))
    print(f"{'problem':14} {'algorithm':14} {'mean':>8} {'worst':>8} {'best':>8}")
    for name in PROBLEMS:
        for algorithm in ALGORITHMS:
            each = [found[name, algorithm, seed] for seed in SEEDS]
            print(f"{name:14} {algorithm:14} {statistics.mean(each):8.3f} {min(each):8.3f} {max(each):8.3f}")


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
