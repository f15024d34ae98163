"""The Prefer header, as RFC 7240 has it."""

import pytest

from app.api.preferences import Preferences


@pytest.mark.parametrize(
    ("headers", "patience_s", "applied"),
    [
        ([], None, ""),
        (["respond-async"], 0.0, "respond-async"),
        (["Respond-Async, wait=10"], 10.0, "respond-async, wait=10"),
        (["wait=3", "respond-async"], 3.0, "respond-async, wait=3"),
        (['wait="7"'], 7.0, "wait=7"),
        (["wait=1, wait=9"], 1.0, "wait=1"),
        (["wait = 4 ; foo=bar"], 4.0, "wait=4"),
        (["wait=-1"], None, ""),
        (["wait=soon, return=minimal,, handling=lenient"], None, ""),
        (["respond-async=0; x"], 0.0, "respond-async"),
    ],
)
def test_preferences(headers, patience_s, applied):
    preferences = Preferences.of(headers)

    assert preferences.patience_s == patience_s
    assert preferences.applied == applied
