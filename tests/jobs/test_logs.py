"""What workers log: JSON lines with the ids of the request and the job, and nothing beside them."""

import asyncio
import json

from harness import KINDS, database_of, eventually, finished, url_of
from structlog.contextvars import bound_contextvars

from app.jobs.local import LocalExecutor
from app.jobs.service import JobService


def test_lines_of_a_worker_are_json_and_have_the_ids(tmp_path, capfd):
    async def scenario():
        database = database_of(url_of(tmp_path))
        service = JobService(database, KINDS, LocalExecutor(1, log_level="info"))
        await service.start()
        await eventually(lambda: service.load().ready == 1)
        jobs = {}
        for number in range(3):  # one begins at once, the others wait
            with bound_contextvars(request_id=f"request-{number}"):
                job, _ = await service.submit("speak", {"said": "\n{}"})
            jobs[job.id] = f"request-{number}"
        nameless, _ = await service.submit("speak", {"said": ""})
        for job_id in (*jobs, nameless.id):
            await finished(service, await service.get(job_id))
        await service.stop(0)
        database.dispose()
        return jobs, nameless.id

    jobs, nameless = asyncio.run(scenario())
    lines = [json.loads(line) for line in capfd.readouterr().err.splitlines()]
    said = [(line["job_id"], line.get("request_id")) for line in lines if line["event"] == "said"]
    assert sorted(said) == sorted([*jobs.items(), (nameless, None)], key=str)
    for event, reason in (("caught", "ValueError: inner"), ("a thread ended with an exception", "Zero")):
        found = [line for line in lines if line["event"] == event]
        assert len(found) == 4
        assert all(reason in line["exception"] for line in found)
    assert any("thin ice" in line["event"] for line in lines)
    assert {line["job_id"] for line in lines} == {*jobs, nameless}
