"""The mission protocol, message by message, on a clock of the test's own."""

import math
from types import SimpleNamespace

import pytest

from app.api.plan_formats.mission import Command, Frame, MissionItem
from app.mavlink.transfer import ANSWER_WITHIN_S, TRIES, Transfer, item_fields

ITEMS = (
    MissionItem(Command.TAKEOFF, Frame.RELATIVE_ALTITUDE, (0, 0, 0, math.nan), (30.1, -20.2, 50.0)),
    MissionItem(Command.RETURN_TO_LAUNCH, Frame.MISSION, (0, 0, 0, 0)),
)


def message(kind, **fields):
    return SimpleNamespace(get_type=lambda: kind, **fields)


@pytest.fixture
def sent():
    return []


@pytest.fixture
def transfer(sent):
    return Transfer(ITEMS, lambda kind, fields: sent.append((kind, fields)), 0.0)


def test_items_are_given_as_they_are_asked_for(transfer, sent):
    assert sent == [("MISSION_COUNT", {"count": 2, "mission_type": 0})]
    for seq in (0, 1, 1, 0):
        transfer.take(message("MISSION_REQUEST_INT", seq=seq, mission_type=0), 0.1)
    assert [fields["seq"] for _, fields in sent[1:]] == [0, 1, 1, 0]
    assert all(kind == "MISSION_ITEM_INT" for kind, _ in sent[1:])
    transfer.take(message("MISSION_REQUEST", seq=1, mission_type=0), 0.2)
    assert sent[-1] == ("MISSION_ITEM_INT", item_fields(1, ITEMS[1]))
    transfer.take(message("MISSION_REQUEST_INT", seq=2, mission_type=0), 0.3)
    transfer.take(message("MISSION_ACK", type=0, mission_type=1), 0.3)  # of a fence
    assert (len(sent), transfer.outcome) == (6, None)
    transfer.take(message("MISSION_ACK", type=0, mission_type=0), 0.4)
    assert transfer.outcome == ""


def test_degrees_are_whole_numbers_and_an_open_heading_stays_open():
    fields = item_fields(0, ITEMS[0])
    assert (fields["x"], fields["y"], fields["z"]) == (-202000000, 301000000, 50.0)
    assert (fields["command"], fields["frame"], fields["current"], fields["autocontinue"]) == (22, 3, 1, 1)
    assert math.isnan(fields["param4"])
    assert item_fields(1, ITEMS[1])["current"] == 0


def test_what_is_not_answered_is_sent_again_and_then_given_up(transfer, sent):
    transfer.look(ANSWER_WITHIN_S - 0.01)
    assert len(sent) == 1
    now = 0.0
    while transfer.outcome is None:
        now += ANSWER_WITHIN_S
        transfer.look(now)
    assert [kind for kind, _ in sent] == ["MISSION_COUNT"] * TRIES
    assert transfer.outcome == f"the vehicle does not answer: MISSION_COUNT was sent {TRIES} times"


def test_each_answer_begins_the_count_anew(transfer, sent):
    now = 0.0
    for seq in (0, 1):
        for _ in range(TRIES - 1):
            now += ANSWER_WITHIN_S
            transfer.look(now)
        transfer.take(message("MISSION_REQUEST_INT", seq=seq, mission_type=0), now)
    assert transfer.outcome is None
    transfer.take(message("MISSION_REQUEST_LIST", mission_type=0), now)
    assert sent[-1][0] == "MISSION_COUNT"


def test_a_refusal_is_said(transfer):
    transfer.take(message("MISSION_ACK", type=4, mission_type=0), 0.1)
    assert transfer.outcome == "the vehicle refuses it (result 4)"
