"""Work functions are found by name in the workers, which get this process's search path."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def shared_url(postgresql):
    """A PostgreSQL database for several services."""
    return postgresql.new_database()
