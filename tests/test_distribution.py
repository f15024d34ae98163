"""What is installed: exact versions in constraints.txt, each inside the range that the metadata give it."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PINS = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines())
PINNED = {canonicalize_name(name): version for name, version in PINS.items()}


def requirements(metadata):
    """Every package that a pyproject.toml names, of this project's own extras none."""
    project = tomllib.loads((ROOT / metadata).read_text(encoding="utf-8"))["project"]
    lists = [project["dependencies"], *project.get("optional-dependencies", {}).values()]
    parsed = [Requirement(line) for lines in lists for line in lines]
    return [each for each in parsed if each.name != project["name"]]


SERVICE = requirements("pyproject.toml")
CLIENT = requirements("app/client/pyproject.toml")


@pytest.mark.parametrize("needed", [*SERVICE, *CLIENT], ids=str)
def test_a_dependency_has_a_range_and_its_pin_is_inside(needed):
    assert needed.specifier.contains(PINNED[canonicalize_name(needed.name)])
    assert {each.operator for each in needed.specifier} == {">=", "<"}


def test_a_package_has_one_range():
    assert len({each.name for each in SERVICE}) == len(SERVICE)


def test_hooks_run_what_the_checks_of_the_makefile_run():
    """Each is a command of the environment, with the version that is pinned; none is fetched."""
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    assert re.findall(r"repo: (\S+)", hooks) == ["local"]
    make = (ROOT / "Makefile").read_text(encoding="utf-8")
    checks = re.findall(r"^\t\$\(BIN\)/((?:ruff|mypy|lint-imports)\b.*)$", make, re.MULTILINE)
    entries = re.findall(r"entry: \.venv/bin/(.*)", hooks)
    run = {entry.replace(" --force-exclude", "") for entry in entries}
    assert len(checks) == 4
    assert {check.removesuffix(" .") for check in checks} <= run
