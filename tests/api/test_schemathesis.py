"""Schemathesis with all its checks against the running service: what it answers is what `/docs` says."""

import json
import os
import subprocess
import sys
from pathlib import Path

from metric_samples import samples

SUPPORT = Path(__file__).parents[1] / "support"


def test_every_answer_is_as_documented(narrow, tmp_path):
    """On a service whose source policies no other test needs: all are deleted here."""
    client = narrow.await_ready().client
    report = tmp_path / "report.json"
    process = subprocess.run(
        [
            *(str(Path(sys.executable).with_name("schemathesis")), "run", "--checks", "all"),
            *("--mode", "all", "--max-examples", "5", "--seed", "1", "--generation-deterministic"),
            *("--request-timeout", "120", "--wait-for-schema", "60", "--no-color"),
            *("--report", "json", "--report-json-path", str(report)),
            f"{client.base_url}/openapi.json",
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
    assert samples(client)[("allocator_worker_restarts_total",)] == 0
