"""The command line: keys are made, listed and revoked, and nothing is served to strangers by accident."""

import pytest
from typer.testing import CliRunner

from app.api.access.keys import KeyStore, Role, recognise
from app.cli import application
from policy_store.database import Database


@pytest.fixture
def invoke(tmp_path):
    return lambda *arguments: CliRunner().invoke(application, [*arguments, "--data-dir", str(tmp_path)])


@pytest.fixture
def known(tmp_path):
    """Reads the keys by id."""

    def read():
        database = Database(f"sqlite:///{tmp_path / 'allocator.sqlite3'}")
        try:
            return {key.id: key for key in KeyStore(database).all()}
        finally:
            database.dispose()

    return read


def test_a_key_is_made_shown_once_listed_and_revoked(invoke, known):
    made = invoke("keys", "create", "--role", "library", "--name", "trainer\u00e9")
    token = made.stdout.strip()
    key = recognise(token, known())
    assert key is not None
    assert (key.role, key.name) == (Role.LIBRARY, "trainer\u00e9")

    listed = invoke("keys", "list").stdout
    assert listed.split("\t")[:2] == [key.id, "library"]
    assert "in use" in listed
    assert token.partition(".")[2] not in listed + made.stderr

    assert invoke("keys", "revoke", key.id).exit_code == 0
    assert recognise(token, known()) is None
    assert "revoked" in invoke("keys", "list").stdout
    again = invoke("keys", "revoke", key.id)
    assert again.exit_code == 1
    assert key.id in again.stderr


def test_a_role_that_is_none_is_refused(invoke):
    refused = invoke("keys", "create", "--role", "admin", "--name", "x")

    assert refused.exit_code == 2
    assert invoke("keys", "list").stdout == ""


@pytest.mark.parametrize("revoked", [False, True])
def test_others_are_not_served_without_a_usable_key(invoke, revoked):
    if revoked:
        token = invoke("keys", "create", "--role", "allocate", "--name", "x").stdout
        invoke("keys", "revoke", token.partition(".")[0])
    refused = invoke("serve", "--host", "0.0.0.0", "--port", "0")

    assert refused.exit_code == 2
    assert "0.0.0.0" in refused.stderr
    assert "--no-keys" in refused.stderr
