"""Pages of the repository: their links lead somewhere, the README is short, tables agree with the code."""

import re
import tomllib
from pathlib import Path

import pytest

import app
from app.api.problem_types import PROBLEM_TYPES
from app.domain.allocation import UnmetCode
from app.domain.warnings import CODES
from app.solvers.registry import ALGORITHMS

ROOT = Path(__file__).parents[1]
FOLDERS = (".deploy", "app", "policy_store", "tests")
WRITTEN_ELSEWHERE = {"vendor", "results"}
"""Folders whose pages are somebody else's, or a command's."""

PAGES = sorted(
    page.relative_to(ROOT)
    for page in [*ROOT.glob("*.md"), *(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md"))]
    if not WRITTEN_ELSEWHERE & set(page.parts)
)
LONGEST_README = 150

_FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"`[^`]*`")
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
_FILE = re.compile(r"`((?:app|policy_store|tests|\.deploy|\.ci)/[\w./-]+)`")
_MODULE = re.compile(r"`(\w+\.(?:py|js))`")


def prose(page):
    """The text of a page without its blocks."""
    return _FENCED.sub("", page.read_text(encoding="utf-8"))


def anchors(page):
    """The names that a page's headings have in links to them, as GitHub makes them."""
    plain = (re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading) for heading in _HEADING.findall(prose(page)))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in plain}


def rows(page, heading):
    """The cells of the first table below a heading, without its two lines of titles."""
    below = prose(ROOT / page).split(f" {heading}\n", 1)[1]
    table = re.search(r"(?:^\|.*\n)+", below, re.MULTILINE)[0]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in table.splitlines()[2:]]


def names(page, heading):
    """The first column of such a table, without its marks of code."""
    return [cells[0].strip("| `") for cells in rows(page, heading)]


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_links_lead_to_files_and_headings_that_are_there(page):
    for target in _LINK.findall(_CODE.sub("", prose(ROOT / page))):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (ROOT / page).parent / path if path else ROOT / page
        assert file.exists(), target
        if anchor:
            assert anchor in anchors(file), target


@pytest.fixture(scope="module")
def modules():
    """The names of all modules, wherever they are."""
    files = (file for folder in FOLDERS for file in (ROOT / folder).rglob("*"))
    return {file.name for file in files if file.suffix in (".py", ".js")}


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_files_that_are_named_are_there(page, modules):
    for name in _FILE.findall(prose(ROOT / page)):
        assert (ROOT / name).exists(), name
    assert set(_MODULE.findall(prose(ROOT / page))) <= modules


def test_every_page_is_in_the_navigation_of_the_site():
    navigation = (ROOT / ".docs/mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1]
    entries = re.findall(r"^ +- (\S+\.md)$", navigation, re.MULTILINE)
    assert sorted(entries) == sorted(map(str, PAGES))


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= LONGEST_README


def test_the_version_to_cite_is_this_one_and_the_newest_in_the_changes():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [app.__version__]
    released = re.findall(r"^date-released: (.+)$", citation, re.MULTILINE)
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.search(r"^## (\d.*), (.+)$", changes, re.MULTILINE)
    assert newest[1] == app.__version__
    assert [newest[2]] == released


def test_the_version_of_the_package_is_this_one():
    """It stands in one place, which the package's metadata follow."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" not in declared["project"]
    assert declared["project"]["dynamic"] == ["version"]
    assert declared["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "app.__version__"}


def test_every_type_of_error_is_in_the_guide():
    known = [(code, str(each.status)) for code, each in PROBLEM_TYPES.items()]
    assert [(cells[0].strip("| `"), cells[1]) for cells in rows("app/api/README.md", "Errors")] == known


def test_codes_and_algorithms_are_in_their_tables():
    assert names("app/domain/README.md", "Warnings") == list(CODES)
    assert names("app/domain/README.md", "Codes of unmet needs") == list(UnmetCode)
    assert set(names("app/solvers/README.md", "Algorithms")) == set(ALGORITHMS)
