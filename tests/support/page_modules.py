"""The dashboard's modules that need no page, run by the node that Playwright brings."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import playwright

import app

MODULES = Path(app.__file__).parent / "dashboard" / "js"
_NODE = Path(playwright.__file__).parent / "driver" / "node"
_PATIENCE_S = 120


def run_module(code: str, given: Any = None) -> Any:
    """Run a function body in node and return what it returns.

    Parameters
    ----------
    code
        Of an asynchronous function; ``load("formats.js")`` imports a module of the page, ``given`` is the
        argument.
    given
        Anything that JSON can hold.
    """
    program = (
        'import { readFileSync } from "node:fs";\n'
        f'const load = (name) => import("{MODULES.as_uri()}/" + name);\n'
        'const given = JSON.parse(readFileSync(0, "utf8"));\n'
        f"const run = async () => {{ {code} }};\n"
        "process.stdout.write(JSON.stringify((await run()) ?? null));\n"
    )
    ended = subprocess.run(
        [_NODE, "--no-warnings", "--input-type=module", "-e", program],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        timeout=_PATIENCE_S,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)
