"""What a work function sees of its job."""

import pytest

from app.jobs.model import Progress
from app.jobs.worker import CANCEL, DEADLINE, SHARE, WorkContext, new_control


def test_a_context_shows_its_control_block():
    control = new_control()
    heard = []
    context = WorkContext(heard.append, control)
    assert not context.cancelled()
    assert context.time_left() is None
    assert context.share() == 1
    control[CANCEL] = 1.0
    control[DEADLINE] = 0.0
    assert context.cancelled()
    control[SHARE] = 3.0
    assert context.time_left() < 0
    assert context.share() == 3
    context.report(Progress(0.5))
    assert heard == [Progress(0.5)]


def test_work_without_a_job_can_have_a_time_limit():
    assert 59 < WorkContext.in_process(print, 60.0).time_left() <= 60
    assert WorkContext.in_process(print).time_left() is None
    assert WorkContext.in_process(print, 0.0).time_left() == pytest.approx(0.0, abs=1.0)
