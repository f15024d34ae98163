"""What is logged on a terminal: nothing that it would obey."""

import io
import logging

import pytest

from app.logs import configure_logs


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal():
    root = logging.getLogger()
    before = root.handlers[:], root.level
    stream = Terminal()
    configure_logs("info", stream)
    yield stream
    root.handlers[:], level = before
    root.setLevel(level)


@pytest.mark.parametrize("sent", ["/\x1b]0;owned\x07", "/\x9b31m", "/a\nb\rc", "/\u202e\u2028"])
def test_control_characters_of_a_client_are_written_out(terminal, sent):
    logging.getLogger("app").info("request %s", sent, extra={"path": sent})
    # The renderer's own colours begin with ESC [.
    written = terminal.getvalue()
    assert sent not in written
    assert ascii(sent[1])[1:-1] in written or sent[1].isprintable()


def test_names_in_every_script_are_logged_as_they_are(terminal):
    logging.getLogger("app").info("request", extra={"path": "/\u0dc1\u0dca\u200d\u0dbb\u0dd3\u98df"})
    assert "\u0dc1\u0dca\u200d\u0dbb\u0dd3\u98df" in terminal.getvalue()
