"""The page shows files that the command wrote, as it wrote them."""

import re
from pathlib import Path

import app.reproduction
from app.reproduction.report import SUMS, sums_of

FOLDER = Path(app.reproduction.__file__).parent
PAGE = (FOLDER / "README.md").read_text(encoding="utf-8")
RESULTS = FOLDER / "results"


def test_the_figures_and_tables_are_as_they_were_written():
    assert (RESULTS / SUMS).read_text(encoding="utf-8") == sums_of(RESULTS)


def test_everything_that_the_page_shows_is_there():
    linked = re.findall(r"\]\(([^)#:]+)\)", PAGE)
    assert len([name for name in linked if name.startswith("results/figures/")]) >= 9
    for name in linked:
        assert (FOLDER / name).exists(), name


def test_the_page_names_the_command_of_its_figures():
    command = re.search(r"Made by `([^`]+)`", (RESULTS / "tables" / "claims.md").read_text(encoding="utf-8"))
    assert command is not None
    assert command[1] in " ".join(PAGE.split())
