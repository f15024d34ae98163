from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save

from policy_store.database import Database
from policy_store.library import PolicyLibrary
from policy_store.policy import NewPolicy


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'store' / 'library.db'}"


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    database = Database(url)
    yield database
    database.dispose()


@pytest.fixture
def library(database: Database) -> PolicyLibrary:
    library = PolicyLibrary(database)
    library.migrate()
    return library


@pytest.fixture
def new_policy() -> Callable[..., NewPolicy]:
    """Make a policy of which only what matters to a test is given; equal weights make equal checkpoints."""

    def make(weight: float = 1.0, **fields: Any) -> NewPolicy:
        defaults = {
            "name": "source",
            "n_uavs": 5,
            "n_targets": 10,
            "n_materials": 3,
            "task": {"uavs": [{"speed": 1.5}], "max_steps": 5},
            "architecture": "drqn-qmix-1",
            "algorithm": "qmix",
            "checkpoint": save({"fc.weight": np.full((4, 3), weight, np.float32)}),
            "vectors": {"task-description-1/5x10x3": [weight, 0.0]},
        }
        return NewPolicy(**{**defaults, **fields})

    return make
