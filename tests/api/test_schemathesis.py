"""Schemathesis with all its checks against the running service: what it answers is what `/docs` says."""

import json
import os
import subprocess
import sys
from pathlib import Path

SUPPORT = Path(__file__).parents[1] / "support"


def test_every_answer_is_as_documented(start_service, tmp_path):
    service = start_service(
        workers=1, queue_limit=64
    ).await_ready()  # its own: source policies are deleted here
    report = tmp_path / "report.json"
    process = subprocess.run(
        [
            *(str(Path(sys.executable).with_name("schemathesis")), "run", "--checks", "all"),
            *("--mode", "all", "--max-examples", "5", "--seed", "1", "--generation-deterministic"),
            *("--request-timeout", "120", "--wait-for-schema", "60", "--no-color"),
            *("--report", "json", "--report-json-path", str(report)),
            f"{service.client.base_url}/openapi.json",
        ],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(SUPPORT), "SCHEMATHESIS_HOOKS": "schemathesis_hooks"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    told = json.loads(report.read_text())
    assert told["complete"]
    assert told["operations"]["tested"] == told["operations"]["total"]
    assert {phase["status"] for phase in told["phases"].values()} == {"success"}
    assert "allocator_worker_restarts_total 0.0" in service.client.get("/metrics").text
