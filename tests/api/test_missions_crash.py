"""`kill -9` in the course of random days: a small round of `bench_missions.py`."""

from live_service import SMALL, LiveService, kill
from mission_trial import Reckoning, Trial


def test_a_day_outlives_a_crash(tmp_path):
    service, reckoning = LiveService(tmp_path, workers=1, **SMALL), Reckoning()
    try:
        service.start().await_ready()
        for seed, kills in ((1, 1), (2, 1)):
            Trial(service, seed, reckoning).run(events=20, kills=kills)
        for worker in service.workers():
            kill(worker)
        Trial(service, 3, reckoning).run(events=3, kills=0)
    finally:
        service.stop()
    assert reckoning.broken == []
    assert reckoning.kills == 2
    assert reckoning.plans > 30
