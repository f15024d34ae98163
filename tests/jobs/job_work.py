"""Work functions that the tests submit; what they wait for are files, so that nothing depends on timing."""

import logging
import os
import signal
import sys
import threading
import time
import warnings
from pathlib import Path
from typing import Any

from app.domain.errors import InvalidProblem, Violation
from app.jobs.model import Progress, WorkResult
from app.jobs.worker import WorkContext

Payload = dict[str, Any]


def echo(payload: Payload, context: WorkContext) -> WorkResult:
    artifact = payload.get("artifact")
    return WorkResult({"echo": payload, "pid": os.getpid()}, artifact.encode() if artifact else None)


def nothing(payload: Payload, context: WorkContext) -> WorkResult:
    return WorkResult({})


def note(payload: Payload, context: WorkContext) -> WorkResult:
    """Write a line with the payload's number into a file: it is there as often as this was done."""
    with Path(payload["log"]).open("a") as lines:
        lines.write(f"{payload['number']}\n")
    return WorkResult({"pid": os.getpid()})


def until_file(payload: Payload, context: WorkContext) -> WorkResult:
    """Report the process id as the epoch, and end when the file is there."""
    context.report(Progress(0.25, epoch=os.getpid()))
    while not Path(payload["path"]).exists():
        time.sleep(0.002)
    return WorkResult({"pid": os.getpid()})


def share_until_file(payload: Payload, context: WorkContext) -> WorkResult:
    """Report as the epoch how many workers' cores may be used, when it changes, until the file is there."""
    told = 0
    while not Path(payload["path"]).exists():
        if context.share() != told:
            told = context.share()
            context.report(Progress(0.25, epoch=told))
        time.sleep(0.002)
    return WorkResult({})


def until_stopped(payload: Payload, context: WorkContext) -> WorkResult:
    """Improve until it is told to stop."""
    best = 0
    while not context.cancelled() and (context.time_left() is None or context.time_left() > 0):
        best += 1
        context.report(Progress(0.5, epoch=best, best_reward=float(best), assignment=[[0, best]]))
        time.sleep(0.001)
    return WorkResult({"best": best, "cancelled": context.cancelled(), "time_left": context.time_left()})


def deaf(payload: Payload, context: WorkContext) -> WorkResult:
    """Report a plan, and then never look up again."""
    context.report(Progress(0.75, best_reward=7.0, assignment=[[1, 0]], answered_by="deaf"))
    threading.Event().wait()
    raise AssertionError


def held(payload: Payload, context: WorkContext) -> WorkResult:
    """Be at something that ends by itself for some seconds; then, if asked for, never look up again."""
    context.hold(True)
    time.sleep(payload["seconds"])
    context.hold(False)
    return deaf(payload, context) if payload.get("then_deaf") else WorkResult({"pid": os.getpid()})


def chatter(payload: Payload, context: WorkContext) -> WorkResult:
    """Report without a pause for some seconds; the first reward is not finite."""
    context.report(Progress(0.0, best_reward=float("-inf")))
    begun = time.monotonic()
    count = 0
    while time.monotonic() - begun < payload["seconds"]:
        count += 1
        context.report(Progress(2.0, epoch=count))
    return WorkResult({"reports": count, "seconds": time.monotonic() - begun})


def epochs(payload: Payload, context: WorkContext) -> WorkResult:
    """Report epochs one after the other, each when the test has made its file."""
    for epoch in range(1, payload["epochs"] + 1):
        while not Path(payload["folder"], str(epoch)).exists():
            time.sleep(0.002)
        context.report(Progress(epoch / payload["epochs"], epoch=epoch))
    while not Path(payload["folder"], "end").exists():
        time.sleep(0.002)
    return WorkResult({})


def die(payload: Payload, context: WorkContext) -> WorkResult:
    """Kill its own process as often as the payload says, then succeed; deaths are lines of a file."""
    log = Path(payload["log"])
    deaths = len(log.read_text().splitlines()) if log.exists() else 0
    if deaths >= payload["deaths"]:
        return WorkResult({"deaths": deaths})
    context.report(Progress(0.5, best_reward=3.0))
    with log.open("a") as lines:
        lines.write(f"{os.getpid()}\n")
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def refuse(payload: Payload, context: WorkContext) -> WorkResult:
    violations = [Violation("/uavs/0/speed", "speed is 0, must be > 0")]
    raise InvalidProblem("uav 'uav-1': speed is 0", violations, {"limit": 3})


def defect(payload: Payload, context: WorkContext) -> WorkResult:
    raise ZeroDivisionError("no targets")


def leave(payload: Payload, context: WorkContext) -> WorkResult:
    sys.exit(3)


def speak(payload: Payload, context: WorkContext) -> WorkResult:
    """Log in every way there is, and let a thread end with an exception."""
    logging.getLogger("work").info("said", extra={"said": payload["said"]})
    warnings.warn("thin ice", stacklevel=1)
    try:
        raise ValueError("inner\nline")
    except ValueError:
        logging.getLogger("work").exception("caught")
    thread = threading.Thread(target=lambda: 1 // 0, name="careless")
    thread.start()
    thread.join()
    return WorkResult({})


def not_json(payload: Payload, context: WorkContext) -> WorkResult:
    return WorkResult({"reward": float("nan")})


def surroundings(payload: Payload, context: WorkContext) -> WorkResult:
    return WorkResult(
        {
            "threads": [os.environ.get(f"{name}_NUM_THREADS") for name in ("OMP", "OPENBLAS", "MKL")],
            "warm": "WARM" in os.environ,
            "heavy": sorted({"torch", "numba", "sqlalchemy"} & set(sys.modules)),
        }
    )


def warm_up() -> None:
    os.environ["WARM"] = "1"


def never() -> None:
    """Warm up for as long as the process lives."""
    threading.Event().wait()


def until_gate() -> None:
    """Warm up until a file is there."""
    while not Path(os.environ["GATE"]).exists():
        time.sleep(0.002)


def warm_up_at_second_try() -> None:
    """Fail in the first worker, which leaves a file behind."""
    marker = Path(os.environ["WARM_UP_MARKER"])
    if not marker.exists():
        marker.touch()
        raise OSError("not yet")


def half(payload: Payload, context: WorkContext) -> WorkResult:
    """Return a result that is to be completed."""
    return WorkResult({"half": 1, "rest": None}, unfinished=True)


def other_half(payload: Payload, context: WorkContext) -> WorkResult:
    return WorkResult({"rest": [payload["n"], payload["result"]]})


def until_cancelled(payload: Payload, context: WorkContext) -> WorkResult:
    """Say that it has begun; give up where that is asked for, and otherwise end when the file is there."""
    Path(payload["begun"]).touch()
    while not Path(payload["path"]).exists():
        if context.cancelled():
            return WorkResult({"rest": "too early"}, unfinished=True)
        time.sleep(0.002)
    return WorkResult({"rest": "all"})
