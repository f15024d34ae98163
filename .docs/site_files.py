"""What the site is made of: the pages of its navigation, and every file that a page links to.

MkDocs wants all pages in one folder. These stay beside the code that they explain, and are read there.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from posixpath import dirname, join, normpath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel

ROOT = Path(__file__).parents[1]

_CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files; one that does not exist is left to MkDocs, which warns of the entry or the link."""
    in_nav = set(_entries(config.nav))
    waiting, seen = list(in_nav), set(in_nav)
    while waiting:
        path = waiting.pop()
        if not (ROOT / path).is_file():
            continue
        inclusion = InclusionLevel.INCLUDED if path in in_nav else InclusionLevel.NOT_IN_NAV
        files.append(File.generated(config, path, abs_src_path=str(ROOT / path), inclusion=inclusion))
        if path.endswith(".md"):
            linked = set(_links(path)) - seen
            waiting += linked
            seen |= linked
    return files


def _entries(nav: Any) -> Iterator[str]:
    """Return the paths in a navigation, whatever sections they are in."""
    if isinstance(nav, str):
        yield nav
    for each in nav.values() if isinstance(nav, dict) else nav if isinstance(nav, list) else ():
        yield from _entries(each)


def _links(page: str) -> Iterator[str]:
    """Return the paths to which a page links inside the repository, from the repository's root."""
    for target in _LINK.findall(_CODE.sub("", (ROOT / page).read_text(encoding="utf-8"))):
        path = normpath(join(dirname(page), target))
        if not re.match(r"[a-z]+:", target) and not path.startswith(".."):
            yield path
