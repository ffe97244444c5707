"""The search for a file whose name in a stage is not that of a file here. The rules are those of
Snell's other readers.
"""

from __future__ import annotations

import os
import re
import unicodedata
from urllib.parse import unquote

__all__ = ["search"]

#: Maximum number of entries of a folder that are looked at.
_MOST_ENTRIES = 100_000


def search(folders: list[str], name: str, fence: str | None = None) -> str | None:
    """The file that `name` means: first in the folders that it leads to from the first of
    `folders`, without regard to the case of letters and to how their accents are written; then,
    without the folders in the name, in each of `folders`. Nothing outside of the folder `fence` is
    looked at.
    """
    spellings = _spellings(name)
    plain = len(spellings)
    spellings += [text for known in list(spellings) if (text := unquote(known)) != known]
    bare = dict.fromkeys(spellings[n - 1].rsplit("/", 1)[-1] for n in (plain, len(spellings)))
    tries = [(folders[0], spelling) for spelling in spellings]
    tries += [(folder, last) for folder in folders for last in bare]
    return next((path for one in tries if (path := _in_any_case(*one, fence))), None)


def _spellings(name: str) -> list[str]:
    """Other ways to write a name, the closest first: with slashes for backslashes and without a
    drive; without quotes and blanks around it, and the scheme `file:`; without the query or
    fragment of an address.
    """
    slashes = name.replace("\\", "/")
    plain = slashes.strip(" \t\r\n\"'").removeprefix("file://")
    plain = re.sub(r"^[A-Za-z]:", "", plain).rstrip("/")
    return list(dict.fromkeys([slashes, plain, re.split(r"\s*[?#]", plain, maxsplit=1)[0]]))


def _in_any_case(folder: str, name: str, fence: str | None) -> str | None:
    """The file of a name relative to `folder`, whatever the case of the letters is."""
    if not name or "\0" in name:
        return None
    path = "/" if name.startswith("/") else folder
    for part in name.split("/"):
        further = os.path.join(path, part)
        if part and not os.path.exists(further):
            if not _is_inside(path, fence) or not (actual := _entry(path, _folded(part))):
                return None
            further = os.path.join(path, actual)
        path = further
    return path if _is_inside(path, fence) and os.path.isfile(path) else None


def _is_inside(path: str, fence: str | None) -> bool:
    if fence is None:
        return True
    real, fence = os.path.realpath(path), os.path.realpath(fence)
    return real == fence or real.startswith(fence.rstrip(os.sep) + os.sep)


def _entry(folder: str, folded: str) -> str | None:
    """The entry of a folder whose name has this folded form; the first in alphabetical order, if
    there are several.
    """
    found = []
    try:
        with os.scandir(folder) as entries:
            for _, entry in zip(range(_MOST_ENTRIES), entries, strict=False):
                if _folded(entry.name) == folded:
                    found.append(entry.name)
    except OSError:
        return None
    return min(found, default=None)


def _folded(name: str) -> str:
    """A name in lower case, with each accented letter as one character."""
    return unicodedata.normalize("NFC", name).lower()
