"""A service in a process of its own, to be killed: submits jobs that wait for a file, and says so."""

import asyncio
import sys

from harness import GATED, LEASE_S, database_of, eventually, make_service


async def main(url: str, gate: str, count: int) -> None:
    service = make_service(database_of(url), kinds=(GATED,), slots=2, lease_s=LEASE_S)
    await service.start()
    for number in range(count):
        job, _ = await service.submit("gated", {"path": gate, "number": number})
        print("accepted", job.id, flush=True)

    async def pids() -> list[int]:
        jobs = (await service.list(count)).jobs
        return [job.progress.epoch for job in jobs if job.progress.epoch is not None]

    async def two_work() -> bool:
        return len(await pids()) == 2

    await eventually(two_work)
    print("working", *(await pids()), flush=True)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], sys.argv[2], int(sys.argv[3])))
