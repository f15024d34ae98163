"""What the dashboard makes of files, and what it reads again of those that it writes."""

import base64
from collections.abc import Sequence
from typing import Any

from page_modules import run_module

PRESENT = {"max_steps": 7, "crs": "local", "objective": {"charge_return": True}, "uavs": [], "targets": []}
"""The problem on screen when a file is opened."""

_READ = """
    const { fieldsOf } = await load("schema.js");
    const formats = await load("formats.js");
    const fields = fieldsOf(given.openapi);
    return given.files.map((file) => {
        try {
            return formats.read(Uint8Array.from(Buffer.from(file, "base64")), given.present, fields);
        } catch (error) {
            if (!(error instanceof formats.FormatError)) throw error;
            return { refused: error.message };
        }
    });
"""
_AGAIN = """
    const { fieldsOf } = await load("schema.js");
    const formats = await load("formats.js");
    const fields = fieldsOf(given.openapi);
    return given.problems.map((problem) => ["toJson", "toCsv", "toGeoJson"].map((write) => {
        const text = formats[write](problem, fields);
        return formats.read(new TextEncoder().encode(text), given.present, fields);
    }));
"""


def read_files(openapi: dict[str, Any], files: Sequence[bytes | str]) -> list[dict[str, Any]]:
    """Read files as the page does: each a problem and its notices, or why it is refused."""
    contents = [base64.b64encode(f if isinstance(f, bytes) else f.encode()).decode() for f in files]
    return run_module(_READ, {"openapi": openapi, "files": contents, "present": PRESENT})


def write_and_read(openapi: dict[str, Any], problems: Sequence[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """Of each problem, what is read of its JSON, its CSV and its GeoJSON."""
    return run_module(_AGAIN, {"openapi": openapi, "problems": problems, "present": PRESENT})
