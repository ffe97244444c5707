"""The user's pages are true: their examples run, and they have every name and picture."""

from __future__ import annotations

import json
import pathlib
import re

import pytest

import snell

REPOSITORY = pathlib.Path(__file__).parents[2]
FOLDER = REPOSITORY / "docs/user/python"
# The how-tos that have Python in them.
HOW_TO = [
    path
    for path in sorted((REPOSITORY / "docs/user/how-to").glob("*.md"))
    if "```python" in path.read_text(encoding="utf-8")
]
PAGES = [*sorted(FOLDER.glob("*.md")), *HOW_TO, REPOSITORY / "README.md"]
NOTEBOOKS = sorted((FOLDER / "notebooks").glob("*.ipynb"))


def blocks(page: pathlib.Path) -> list[str]:
    """The examples of a page. Empty lines precede each example, so that errors show its line in the
    page.
    """
    text = page.read_text(encoding="utf-8")
    found = re.finditer(r"^```python\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    return ["\n" * (text[: match.start()].count("\n") + 1) + match[1] for match in found]


def examples() -> list[tuple[str, list[str]]]:
    """Groups of blocks that run together: a block, and the next ones that do not begin with an
    import.
    """
    found: list[tuple[str, list[str]]] = []
    for page in PAGES:
        for code in blocks(page):
            if code.lstrip().startswith("import") or not found:
                line = len(code) - len(code.lstrip("\n")) + 1
                found.append((f"{page.name}:{line}", []))
            found[-1][1].append(code)
    return found


@pytest.fixture
def folder(tmp_path, monkeypatch) -> pathlib.Path:
    """A folder to write to, with the scenes of the repository."""
    (tmp_path / "scenes").symlink_to(REPOSITORY / "scenes")
    monkeypatch.chdir(tmp_path)
    return tmp_path


# Packages that only some pages need, and what shows that a block needs them.
EXTRAS = {"distributed": "snell.distributed", "ray": "import ray"}


@pytest.mark.filterwarnings("default::Warning:distributed", "default::Warning:ray")
@pytest.mark.parametrize(("place", "codes"), examples(), ids=[place for place, _ in examples()])
def test_examples_run(place, codes, folder):
    for package, sign in EXTRAS.items():
        if any(sign in code for code in codes):
            pytest.importorskip(package, reason=f"{package} is not installed")
    names: dict[str, object] = {"__name__": "__main__"}
    for code in codes:
        exec(compile(code, place, "exec"), names)
    for picture in folder.glob("*.jpg"):
        made, kept = snell.Image.open(picture), snell.Image.open(FOLDER / "pictures" / picture.name)
        # The pictures look alike; only the noise may differ.
        assert snell.compare(kept, made).flip < 0.15, picture.name


def test_there_are_examples_of_all_pages():
    assert {place.split(":")[0] for place, _ in examples()} == {page.name for page in PAGES}


def test_every_picture_is_made_by_its_page():
    for page in PAGES[:-1]:
        text = page.read_text(encoding="utf-8")
        for picture in re.findall(r"\(pictures/(.*?)\)", text):
            assert (FOLDER / "pictures" / picture).stat().st_size < 80_000, picture
            assert f'save("{picture}")' in text, picture


@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_notebooks_run(path, folder):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4 and notebook["metadata"]["kernelspec"]["name"] == "python3"
    names: dict[str, object] = {}
    for number, cell in enumerate(notebook["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), names)


def test_the_pages_have_every_name():
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    names = [*snell.__all__, *(name for name in vars(snell.Scene) if not name.startswith("_"))]
    for kind in (snell.Hits, snell.Image, snell.Camera):
        names += [
            name
            for name in vars(kind)
            if not name.startswith("_") and name not in ("keys", "values", "items", "shape")
        ]
    missing = [name for name in names if name not in text and name not in ("__version__", "SHAPES")]
    assert not missing
    for shape, parameters in snell.SHAPES.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| `{shape}` |"))
        assert all(f"`{parameter}`" in row for parameter in parameters), row
