"""Several flight files in one ZIP archive, the same bytes for the same files; and what an archive has."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""The earliest time that ZIP knows: an archive does not depend on when it was made."""


def zip_archive(files: Mapping[str, str]) -> bytes:
    """Pack texts by their names."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, text in files.items():
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), text.encode(), zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def texts_of(name: str, content: bytes) -> dict[str, str]:
    """Return the texts of an archive by their names, or the one text that a file is.

    Parameters
    ----------
    name, content
        Of the file.

    Raises
    ------
    ValueError
        If one is no text in UTF-8.
    """
    files = {name: content}
    if zipfile.is_zipfile(io.BytesIO(content)):
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            listed = [each for each in archive.infolist() if not each.is_dir()]
            files = {each.filename.rpartition("/")[2]: archive.read(each) for each in listed}
    try:
        return {each: text.decode("utf-8-sig") for each, text in files.items()}
    except UnicodeDecodeError as error:
        raise ValueError(f"{name} has what is no text in UTF-8: {error}") from None
