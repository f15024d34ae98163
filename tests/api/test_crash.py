"""`kill -9` of the server, of a worker and of both under load: a small round of `bench_crash.py`."""

import random

from crash_trial import KINDS, Ledger, crash, load, reckon
from live_service import SMALL, LiveService


def test_every_promise_outlives_a_crash(tmp_path):
    service, ledger, rng = LiveService(tmp_path, workers=1, **SMALL), Ledger(), random.Random(1)
    try:
        service.start().await_ready()
        with load(service, ledger, clients=3, seed=1):
            for kind in KINDS:
                crash(service, kind, rng, after_s=1.0)
        service.await_ready()
        ends = reckon(service, ledger)
    finally:
        service.stop()
    assert ledger.broken == []
    assert ends["succeeded"] > 0
    assert sum(ends.values()) == len(ledger.promised)
