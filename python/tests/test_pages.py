"""The user's pages are true: their examples run, and they have every name."""

from __future__ import annotations

import pathlib
import re

import pytest

import snell

REPOSITORY = pathlib.Path(__file__).parents[2]
PAGE = REPOSITORY / "docs/user/python.md"


def examples() -> list[tuple[str, str]]:
    found = []
    for page in (PAGE, REPOSITORY / "README.md"):
        text = page.read_text(encoding="utf-8")
        for match in re.finditer(r"^```python\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE):
            line = text[: match.start()].count("\n") + 2
            # So that errors show the line of the page.
            found.append((f"{page.name}:{line}", "\n" * (line - 1) + match[1]))
    return found


@pytest.mark.parametrize(("place", "code"), examples(), ids=[place for place, _ in examples()])
def test_examples_run(place, code, monkeypatch):
    monkeypatch.chdir(REPOSITORY)
    exec(compile(code, place, "exec"), {})


def test_there_are_examples_of_both_pages():
    assert {place.split(":")[0] for place, _ in examples()} == {"python.md", "README.md"}


def test_the_page_has_every_name():
    page = PAGE.read_text(encoding="utf-8")
    names = [*snell.__all__, *(name for name in vars(snell.Scene) if not name.startswith("_"))]
    names += [name for name in vars(snell.Hits) if not name.startswith("_") and name not in ("keys", "values", "items", "shape")]
    missing = [name for name in names if name not in page and name not in ("__version__", "SHAPES")]
    assert not missing
    for shape, parameters in snell.SHAPES.items():
        row = next(line for line in page.splitlines() if line.startswith(f"| `{shape}` |"))
        assert all(f"`{parameter}`" in row for parameter in parameters), row
