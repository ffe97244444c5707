"""Renders every scene and mesh file of some folders, and reports which are drawn, which agree with
a reference, and which are refused and why.

    python bench/suites.py OUTPUT-FOLDER FOLDER... [--snell target/release/snell] [--jobs 2]
        [--spp 32] [--only WORD] [--again [WORD]]

A folder is a suite: a checkout of sample files of a format, of the tests of another program.
Nothing is fetched. Needs Pillow and NumPy, `pip install mitsuba` where there are references in
OpenEXR, and `pip install usd-core` for USD.

Found are files that `snell` reads by their suffix, but for those that are parts: whose name is in
another scene of the folder (pbrt's Include, Mitsuba's fragments, layers of USD, meshes), pbrt files
without WorldBegin, XML that is no scene of Mitsuba. USD files in binary are not searched for names.

A file is compared with a picture that has its name

    Mitsuba   refs/NAME_ref_rgb.exr, where the file is called NAME_INTEGRATOR.xml
    all       NAME.exr beside it
    pbrt      NAME.png beside it, or in a folder `renders` that mirrors `scenes`

at the reference's size, by two pictures a and b of different seeds, so that noise is known. With
the reference r, the two are a match if

    mean      of (a+b)/2 over that of r is within 2 % of 1
    error     the mean of (a-r)(b-r)/(r*r + 0.01), the relative mean squared error without our own
              noise, is at most 0.01

each with three standard errors more, which the differences between a and b give. Pictures of 8 bits
are compared as far as they show: up to 1.

Other pictures are for looking at, and are shown beside ours in the contact sheets in the output
folder: `screenshot.*`, `thumbnail.*` and pictures of the file's name in folders called screenshot,
thumbnails, SampleImages or baseline. A glTF file that has materials but no meshes is shown on
balls.

In `suites.json` there is a row a file. A file whose row is there and whose content and neighbours
are the same is not rendered again; --again is for another `snell`, for all files or those whose row
has WORD in it. Where the Khronos glTF validator's report lies beside a file (FILE.report.json) and
has errors, the file is damaged, and may be refused.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from gltf_materials import extensions, has_materials_alone, on_balls
from PIL import Image
from sheet import Sheet

PICTURES = (".png", ".jpg", ".jpeg", ".webp")
# Folders with pictures of a file, beside it or up to two folders above.
SHOWN = (
    "screenshot",
    "screenshots",
    "thumbnails",
    "SampleImages",
    "Figures/SampleImages",
    "baseline",
)
TILE, COLUMNS, ROWS = (256, 192), 6, 7
# The limits of a match: see above.
MEAN, ERROR, EPSILON, STANDARD_ERRORS = 0.02, 0.01, 0.01, 3
# More of a text is not searched for names of parts.
SEARCHED = 32 << 20
# Mitsuba's folders to search.
PATH = re.compile(r'<path\s+value="([^"]+)"')
# What may stand before the root of an XML file.
PROLOG = re.compile(rb"\xef\xbb\xbf|<\?.*?\?>|<!--.*?-->", re.DOTALL)
# References of more pixels on a side are not compared: they would take too long.
LARGEST = 1024


@dataclass
class Row:
    """What became of a file."""

    suite: str
    file: str
    hash: str
    # drawn, refused, crashed, time, memory
    state: str
    # The error, or why it crashed.
    reason: str = ""
    warnings: list[str] = field(default_factory=list)
    seconds: float = 0
    megabytes: int = 0
    # Of the comparison: reference, mean, mean_limit, error, error_limit, match.
    compared: dict | None = None
    # A picture to be looked at, beside ours.
    shown: str | None = None
    picture: str | None = None
    damaged: bool = False

    @property
    def unmatched(self) -> bool:
        return self.compared is not None and not self.compared["match"]


def scene_suffixes(snell: str) -> set[str]:
    """The suffixes of scenes and meshes in `snell formats`."""
    text = subprocess.run([snell, "formats"], capture_output=True, text=True, check=True).stdout
    scenes = text.split("Pictures")[0]
    return {word for line in scenes.splitlines() for word in line.split() if word[0] == "."}


def find(folder: Path, suffixes: set[str]) -> tuple[list[Path], dict[Path, Path]]:
    """The files that a user would open, and the parts with the file that names them."""
    files = sorted(
        f for f in folder.rglob("*") if f.suffix.lower() in suffixes and f.is_file() and is_scene(f)
    )
    known = {f.resolve(): f for f in files}
    endings = "|".join(re.escape(s) for s in sorted(suffixes))
    # In quotes or between @, maybe with spaces; or alone.
    named = re.compile(rf"""["'@]([^"'@<>\n]+(?:{endings}))["'@]|([^\s"'@<>]+(?:{endings}))""")
    parts: dict[Path, Path] = {}
    for file in files:
        if file.suffix.lower() in (".ply", ".stl", ".off", ".obj", ".glb", ".gltf", ".ray"):
            continue
        with file.open("rb") as opened:
            text = opened.read(SEARCHED)
        if text.startswith((b"PXR-USDC", b"PK")):
            continue
        said = text.decode("utf-8", "replace")
        # Mitsuba looks from the file that includes, and in its paths.
        places = [file.parent, file.parent.parent, *(file.parent / p for p in PATH.findall(said))]
        for quoted, alone in named.findall(said):
            for place in places:
                part = known.get((place / (quoted or alone)).resolve())
                if part and part != file:
                    parts[part] = file
    # Of files that name each other one would be opened: the first.
    for part in sorted(parts):
        if parts.get(parts[part]) == part:
            del parts[min(part, parts[part])]
    return [f for f in files if f not in parts], parts


def is_scene(file: Path) -> bool:
    if file.suffix == ".pbrt":
        return b"WorldBegin" in file.read_bytes()
    if file.suffix == ".xml":
        return PROLOG.sub(b"", file.read_bytes()).lstrip().startswith(b"<scene")
    return True


def by_name(folders: list[Path]) -> dict[str, Path]:
    """The folders by their names, with as much of the path as tells them apart."""
    found = list(dict.fromkeys(folder.resolve() for folder in folders))
    named: dict[str, Path] = {}
    for folder in found:
        others = [other.parts for other in found if other != folder]
        depths = range(1, len(folder.parts) + 1)
        ends = (folder.parts[-depth:] for depth in depths)
        end = next(e for e in ends if all(o[-len(e) :] != e for o in others))
        named["_".join(end)] = folder
    return named


def content(file: Path, reference: Path | None, spp: int) -> str:
    """A hash of a file, of the picture that it is compared with, of the samples, and of the names
    and sizes of what lies in its folder.
    """
    digest = hashlib.sha256(file.read_bytes())
    if reference is not None:
        digest.update(reference.read_bytes())
    digest.update(f"{spp} samples\n".encode())
    for name, size in beside(file.parent):
        digest.update(f"{name} {size}\n".encode())
    return digest.hexdigest()[:16]


@cache
def beside(folder: Path) -> list[tuple[str, int]]:
    return sorted((f.name, f.stat().st_size) for f in folder.iterdir() if f.is_file())


def reference_of(file: Path, suite: Path) -> Path | None:
    """The picture to compare with."""
    name = file.stem
    candidates = [file.with_suffix(".exr")]
    if file.suffix == ".xml":
        candidates.append(file.parent / "refs" / f"{name.rsplit('_', 1)[0]}_ref_rgb.exr")
    if file.suffix == ".pbrt":
        candidates.append(file.with_suffix(".png"))
        inside = file.relative_to(suite).parts
        if "scenes" in inside:
            mirrored = ["renders" if part == "scenes" else part for part in inside]
            mirror = suite.joinpath(*mirrored)
            candidates += [mirror.with_suffix(".exr"), mirror.with_suffix(".png")]
    return next((c for c in candidates if c.is_file()), None)


def shown_of(file: Path) -> Path | None:
    """The picture to show beside ours."""
    above = [file.parent, file.parent.parent, file.parent.parent.parent]
    for folder in above:
        for name in SHOWN:
            pictures = pictures_in(folder / name)
            for stem in (file.stem, f"{file.stem}_thumbnail", "screenshot", "usdview"):
                if stem in pictures:
                    return pictures[stem]
            if name == "baseline" and len(pictures) == 1:
                return next(iter(pictures.values()))
    for folder in above[:2]:
        for stem, picture in pictures_in(folder).items():
            if "screenshot" in stem.lower() or stem.lower() == "thumbnail":
                return picture
    return None


@cache
def pictures_in(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        return {}
    return {f.stem: f for f in sorted(folder.iterdir()) if f.suffix.lower() in PICTURES}


def is_damaged(file: Path) -> bool:
    report = file.with_name(f"{file.name}.report.json")
    if not report.is_file():
        return False
    return json.loads(report.read_bytes())["issues"]["numErrors"] > 0


def linear(path: Path) -> tuple[np.ndarray, bool]:
    """A picture in linear light, and whether it ends at 1."""
    if path.suffix in PICTURES:
        shown = np.asarray(Image.open(path).convert("RGB")) / 255
        return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4), True
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    rgb = mi.Bitmap.PixelFormat.RGB
    picture = mi.Bitmap(str(path)).convert(rgb, mi.Struct.Type.Float32, False)
    return np.asarray(picture, dtype=np.float64), False


def display(picture: np.ndarray) -> Image.Image:
    shown = np.clip(np.nan_to_num(picture), 0, 1)
    shown = np.where(shown <= 0.0031308, shown * 12.92, 1.055 * shown ** (1 / 2.4) - 0.055)
    return Image.fromarray((shown * 255 + 0.5).astype(np.uint8))


def compare(a: np.ndarray, b: np.ndarray, r: np.ndarray, ends_at_one: bool) -> dict:
    """The rule of a match: see above."""
    if ends_at_one:
        a, b, r = (np.clip(picture, 0, 1) for picture in (a, b, r))
    weight = 1 / (r * r + EPSILON)
    # What noise makes of a picture, squared and relative.
    noise = (a - b) ** 2 / 2 * weight
    brightness = max(r.mean(), 1e-9)
    mean = (a + b).mean() / 2 / brightness
    mean_spread = np.sqrt(((a - b) ** 2).sum()) / 2 / a.size / brightness
    error = ((a - r) * (b - r) * weight).mean()
    spread = np.sqrt((noise**2).sum()) / a.size
    limits = MEAN + STANDARD_ERRORS * mean_spread, ERROR + STANDARD_ERRORS * spread
    return {
        "mean": round(float(mean), 4),
        "mean_limit": round(float(limits[0]), 4),
        "error": round(float(error), 5),
        "error_limit": round(float(limits[1]), 5),
        "noise": round(float(noise.mean()), 5),
        "match": bool(abs(mean - 1) <= limits[0] and error <= limits[1]),
    }


@dataclass
class Run:
    """What a run of `snell render` said."""

    state: str
    reason: str
    warnings: list[str]
    seconds: float
    megabytes: int


class Renderer:
    """`snell render` with limits of time and of memory."""

    def __init__(self, options: argparse.Namespace, scratch: Path) -> None:
        self.options, self.scratch = options, scratch

    def run(self, scene: Path, picture: Path, size: tuple[int, int] | None, *more: str) -> Run:
        stats = self.scratch / f"{threading.get_ident()}.json"
        stats.unlink(missing_ok=True)
        command = [self.options.snell, "render", str(scene), "-o", str(picture)]
        command += ["--spp", str(self.options.spp), "--progress", "none", "--stats", str(stats)]
        command += ["--size", "{}x{}".format(*size)] if size else []
        command += ["--threads", str(self.options.threads)] if self.options.threads else []
        if os.name == "posix":
            kilobytes = self.options.memory << 20
            command = ["sh", "-c", f'ulimit -v {kilobytes}; exec "$@"', "sh", *command]
        began = time.monotonic()
        process = subprocess.Popen(
            [*command, *more],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        try:
            said = process.communicate(timeout=self.options.time)[1].decode("utf-8", "replace")
        except subprocess.TimeoutExpired:
            stop(process)
            said = process.communicate()[1].decode("utf-8", "replace")
            return Run(
                "time", f"over {self.options.time} s", warnings_in(said), self.options.time, 0
            )
        seconds = round(time.monotonic() - began, 2)
        warnings = warnings_in(said)
        if process.returncode == 0:
            peak = json.loads(stats.read_bytes()).get("peak_memory_bytes") or 0
            return Run("drawn", "", warnings, seconds, peak >> 20)
        errors = [line for line in said.splitlines() if line.startswith("error: ")]
        reason = errors[0].removeprefix("error: ") if errors else " ".join(said.split())[-400:]
        if process.returncode < 0 or "panicked" in said or not errors:
            return Run("crashed", f"code {process.returncode}: {reason}", warnings, seconds, 0)
        if "memory" in reason:
            return Run("memory", reason, warnings, seconds, 0)
        return Run("refused", reason, warnings, seconds, 0)

    def row(self, file: Path, name: str, suite: Path, hash: str, picture: Path) -> Row:
        """Renders a file to `picture`, compares it if there is a reference, and reports."""
        row = Row(name, str(file.relative_to(suite)), hash, "")
        row.damaged = is_damaged(file)
        reference, shown = reference_of(file, suite), shown_of(file)
        if reference:
            self.against(file, reference, row, picture)
        else:
            bare = not row.damaged and has_materials_alone(file)
            scene = on_balls(file, Path(tempfile.mkdtemp(dir=self.scratch))) if bare else file
            keep(row, self.run(scene, picture, size_like(shown)))
        if row.state == "drawn":
            row.picture = picture.name
        row.shown = str(reference or shown) if reference or shown else None
        return row

    def against(self, file: Path, reference: Path, row: Row, picture: Path) -> None:
        try:
            r, ends_at_one = linear(reference)
        except (OSError, RuntimeError) as problem:
            keep(row, self.run(file, picture, None))
            row.warnings.append(f"the reference {reference} cannot be read: {problem}")
            return
        size = r.shape[1], r.shape[0]
        if max(size) > LARGEST:
            keep(row, self.run(file, picture, size_like(reference)))
            return
        pictures = []
        for seed in (0, 1):
            drawn = picture.with_suffix(f".{seed}.exr")
            keep(row, self.run(file, drawn, size, "--seed", str(seed)))
            if row.state != "drawn":
                return
            pictures.append(linear(drawn)[0])
            drawn.unlink()
        display((pictures[0] + pictures[1]) / 2).save(picture)
        row.compared = {"reference": str(reference), **compare(*pictures, r, ends_at_one)}


def stop(process: subprocess.Popen) -> None:
    """Ends a program and those that it started."""
    if os.name == "posix":
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def warnings_in(said: str) -> list[str]:
    return [
        line.removeprefix("warning: ") for line in said.splitlines() if line.startswith("warning")
    ]


def keep(row: Row, run: Run) -> None:
    row.state, row.reason, row.warnings = run.state, run.reason, run.warnings
    row.seconds = round(row.seconds + run.seconds, 2)
    row.megabytes = max(row.megabytes, run.megabytes)


def size_like(picture: Path | None) -> tuple[int, int]:
    """A size that fits into a tile, in the proportions of a picture."""
    if picture is None or picture.suffix not in PICTURES:
        return TILE
    try:
        width, height = Image.open(picture).size
    except OSError:
        return TILE
    scale = min(TILE[0] / width, TILE[1] / height)
    return max(1, round(width * scale)), max(1, round(height * scale))


def grouped(text: str, row: Row) -> str:
    """A message without names, numbers and advice, so that those of a kind are equal."""
    text = re.sub(rf"/\S[^:]*/{re.escape(row.file)}(:\d+)*: ", "", text)
    text = re.sub(r"^\S*/\S+?(:\d+)*: ", "", text)
    text = re.sub(r"^/\S*: |^[^:]*: (?=/)", "", text)
    text = text.split("; ")[0]
    # A short name is a keyword of the format.
    text = re.sub(r"`[^`]{20,}`|\"[^\"]{20,}\"|'[^']{20,}'|\S*/\S+|\S+\.\w{3,4}\b", "…", text)
    return re.sub(r"-?\d+(\.\d+)?", "N", text)[:110]


def report(rows: list[Row], slow: float) -> None:
    """Prints the table, and the reasons."""
    columns = {
        "files": lambda r: True,
        "drawn": lambda r: r.state == "drawn",
        "matched": lambda r: r.compared is not None and r.compared["match"],
        "unmatched": lambda r: r.unmatched,
        "refused": lambda r: r.state == "refused" and not r.damaged,
        "damaged": lambda r: r.state == "refused" and r.damaged,
        "crashed": lambda r: r.state == "crashed",
        "memory": lambda r: r.state == "memory",
        "time": lambda r: r.state == "time",
        "slow": lambda r: r.state == "drawn" and r.seconds > slow,
        "warned": lambda r: r.state == "drawn" and bool(r.warnings),
    }
    suites = list(dict.fromkeys(r.suite for r in rows))
    wide = max([len(s) for s in suites] + [5])
    print("suite".ljust(wide), *(name.rjust(9) for name in columns))
    for suite in [*suites, "all"]:
        mine = [r for r in rows if suite in (r.suite, "all")]
        counts = [sum(map(test, mine)) for test in columns.values()]
        print(suite.ljust(wide), *(str(n or "").rjust(9) for n in counts))
    for row in rows:
        if row.unmatched:
            c = row.compared
            print(
                f"unmatched: {row.suite}/{row.file}: mean {c['mean']} (±{c['mean_limit']}), "
                f"error {c['error']} (at most {c['error_limit']})"
            )
    for what, test in columns.items():
        if what in ("refused", "crashed", "memory", "time"):
            reasons([(r.reason, r) for r in rows if test(r)], what)
    reasons([(w, r) for r in rows if r.state == "drawn" for w in r.warnings], "warned")


def reasons(said: list[tuple[str, Row]], what: str) -> None:
    """The kinds of messages, how often, and a file of each."""
    counts = Counter(grouped(message, row) for message, row in said)
    first = {grouped(message, row): row for message, row in reversed(said)}
    for kind, count in counts.most_common():
        print(f"{what} {count:5} {kind} ({first[kind].suite}/{first[kind].file})")


def sheets(rows: list[Row], folder: Path, suites: dict[str, Path]) -> None:
    """Contact sheets of each suite: ours, and what there is to see beside. Files of equal pictures
    are shown once.
    """
    for suite, place in suites.items():
        sheet = Sheet(TILE, COLUMNS)
        mine = [r for r in rows if r.suite == suite and (r.picture or not r.damaged)]
        looks = {r.file: look(r, folder / "pictures") for r in mine}
        times = Counter(looks.values())
        first = {looks[r.file]: r for r in reversed(mine)}
        for row in reversed(first.values()):
            notes = f" x{n}" if (n := times[looks[row.file]]) > 1 else ""
            notes += f" [{len(row.warnings)}!]" if row.warnings else ""
            used = extensions(place / row.file) if row.file.endswith((".gltf", ".glb")) else ""
            if row.picture:
                sheet.add(f"{short(row.file)}{notes} {used}", folder / "pictures" / row.picture)
            else:
                sheet.add(f"{short(row.file)}: {row.state}", None)
            if row.shown:
                matched = "= " if row.compared and row.compared["match"] else "! "
                beside = open_picture(Path(row.shown))
                sheet.add((matched if row.compared else "") + Path(row.shown).name, beside)
        sheet.save(folder / f"{suite}.png", ROWS)


def look(row: Row, pictures: Path) -> tuple[str, str | None]:
    """What is equal for files that look the same and have the same picture beside them."""
    if row.picture is None:
        return row.file, None
    return hashlib.sha256((pictures / row.picture).read_bytes()).hexdigest(), row.shown


def short(file: str) -> str:
    """The end of a path, as far as a caption has room."""
    return file if len(file) <= 36 else "…" + file[-35:]


def open_picture(path: Path) -> Image.Image | None:
    try:
        if path.suffix == ".exr":
            return display(linear(path)[0])
        return Image.open(path).convert("RGBA")
    except (OSError, RuntimeError):
        return None


class Book:
    """The rows of all runs, in `suites.json`."""

    def __init__(self, path: Path, parts: dict[str, str]) -> None:
        self.path, self.parts, self.saved = path, parts, time.monotonic()
        self.rows: dict[tuple[str, str], Row] = {}
        if path.is_file():
            for fields in json.loads(path.read_bytes())["rows"]:
                self.rows[fields["suite"], fields["file"]] = Row(**fields)

    def add(self, row: Row) -> None:
        self.rows[row.suite, row.file] = row
        if time.monotonic() - self.saved > 10:
            self.save()

    def save(self) -> None:
        written = {"rows": [asdict(r) for r in self.rows.values()], "parts": self.parts}
        temporary = self.path.with_suffix(".new")
        temporary.write_text(json.dumps(written, indent=1, ensure_ascii=False))
        temporary.replace(self.path)
        self.saved = time.monotonic()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where sheets, pictures and suites.json go")
    parser.add_argument("suites", type=Path, nargs="+", help="folders with scenes")
    parser.add_argument("--snell", default="snell", help="the command")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--time", type=float, default=60, help="seconds that a render may take")
    parser.add_argument("--slow", type=float, default=10, help="seconds that are called slow")
    parser.add_argument("--memory", type=int, default=8, help="GB of address space of a render")
    parser.add_argument("--jobs", type=int, default=1, help="renders at once")
    parser.add_argument("--threads", type=int, help="threads of a render")
    parser.add_argument("--only", default="", help="only files that have this in their path")
    parser.add_argument("--again", nargs="?", const="", help="also if it has been rendered")
    options = parser.parse_args()
    pictures = options.folder / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    suffixes = scene_suffixes(options.snell)
    suites = by_name(options.suites)
    found: list[tuple[str, Path]] = []
    parts: dict[str, str] = {}
    for name, suite in suites.items():
        files, inside = find(suite, suffixes)
        found += [(name, f) for f in files if options.only in str(f)]
        parts |= {str(part): str(file) for part, file in inside.items()}
    book = Book(options.folder / "suites.json", parts)
    scratch = tempfile.TemporaryDirectory(prefix="suites-")
    renderer = Renderer(options, Path(scratch.name))

    def visit(name: str, file: Path) -> Row:
        suite = suites[name]
        hash = content(file, reference_of(file, suite), options.spp)
        row = book.rows.get((name, str(file.relative_to(suite))))
        kept = row is not None and row.hash == hash
        if kept and (options.again is None or options.again not in json.dumps(asdict(row))):
            return row
        picture = pictures / f"{hashlib.sha256(str(file).encode()).hexdigest()[:16]}.png"
        return renderer.row(file, name, suite, hash, picture)

    rows = []
    try:
        with ThreadPoolExecutor(options.jobs) as pool:
            for row in pool.map(lambda at: visit(*at), found):
                rows.append(row)
                book.add(row)
                if sys.stderr.isatty():
                    print(f"\r{len(rows)} of {len(found)}", end="", file=sys.stderr)
    finally:
        book.save()
        scratch.cleanup()
    sheets(rows, options.folder, suites)
    report(rows, options.slow)


if __name__ == "__main__":
    main()
