"""What the fork server of the tests loads once the file of `GATE` is there, and work that tells of it."""

import os
import time
from pathlib import Path

from app.jobs.model import WorkResult

while "GATE" in os.environ and not Path(os.environ["GATE"]).exists():
    time.sleep(0.01)

LOADED_IN = os.getpid()


def where(payload, context):
    return WorkResult({"loaded_in": LOADED_IN, "pid": os.getpid(), "told": os.environ.get("TOLD")})
