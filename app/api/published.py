"""What the repository keeps of the service's description: ``python -m app.api.published`` writes it.

``openapi.json``, the types of the client, and the client that waits. A test compares.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from app.api.application import create_application
from app.api.client_code import MODULES, synchronous
from app.api.client_types import types_module
from app.settings import Settings

_APP = Path(__file__).parents[1]
_CLIENT = _APP / "client"


def description() -> dict[str, Any]:
    """Describe a service whose settings are all as they are by default."""
    # Constructed without a look at the environment.
    return create_application(Settings.model_construct()).openapi()


def published() -> dict[Path, str]:
    """Return all that is written, by its file."""
    described = description()
    texts = {_APP / "api/openapi.json": json.dumps(described, indent=1, ensure_ascii=False) + "\n"}
    texts[_CLIENT / "types.py"] = _formatted(types_module(described))
    for source, made in MODULES.items():
        written = (_CLIENT / source).read_text("utf-8")
        texts[_CLIENT / made] = _formatted(synchronous(written, source))
    return texts


def _formatted(code: str) -> str:
    """Format code as the rest of the repository is."""
    command = [sys.executable, "-m", "ruff", "format", "--config", str(_APP.parent / "pyproject.toml"), "-"]
    done = subprocess.run(command, input=code.encode(), capture_output=True, check=True)
    return done.stdout.decode()


def main() -> None:
    """Write the files."""
    for file, text in published().items():
        file.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
