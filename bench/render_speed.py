"""Samples per second and time to equal error of `snell render` beside Mitsuba 3 and Cycles, of the
same scenes in the same run.

    python bench/render_speed.py BUNNY.obj [--snell target/release/snell]
        [--peers llvm_ad_rgb scalar_rgb cycles] [--threads 4]

Needs NumPy and the peers: `pip install mitsuba` (its `llvm_ad_rgb` needs a libLLVM of a recent
version, see DRJIT_LIBLLVM_PATH), and `pip install bpy` for Cycles. Six scenes, which the script
writes as Mitsuba files that Snell reads too: the Cornell box, a mesh under a constant environment,
1,000 lamps, glass, rough materials, fog; box filter, the same depth everywhere. The renderers take
turns --repeat times; medians count. Reading and building are not in the times, compiling of kernels
is not either.

    rate      million samples of the camera per second
    variance  relative variance of one sample, by two pictures of --spp samples: half of their mean
              squared difference over the squared mean, times the samples. Well-stratified samplers
              have less the more samples they take
    ratio     Snell's rate over the peer's
    gain      Snell's rate over variance beside the peer's: how much sooner it has a picture of the
              same error
    mean      Snell's picture over the peer's, which tells whether both solve the same problem
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Protocol

import numpy as np

HEAD = """<scene version="3.0.0">
  <integrator type="{integrator}"><integer name="max_depth" value="{depth}"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="{fov}"/>
    <transform name="to_world">
      <lookat origin="{origin}" target="{target}" up="0, 1, 0"/>
    </transform>
    <sampler type="{sampler}"/>
    <film type="hdrfilm">
      <integer name="width" value="{side}"/><integer name="height" value="{side}"/>
      <rfilter type="box"/>
    </film>
  </sensor>
{content}
</scene>
"""


def diffuse(r: float, g: float, b: float) -> str:
    return (
        f'<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="{r}, {g}, '
        f'{b}"/></bsdf></bsdf>'
    )


def shape(kind: str, to_world: str, *parts: str) -> str:
    return (
        f'  <shape type="{kind}"><transform name="to_world">{to_world}</transform>'
        f"{''.join(parts)}</shape>\n"
    )


def lamp(r: float, g: float, b: float) -> str:
    return f'<emitter type="area"><rgb name="radiance" value="{r}, {g}, {b}"/></emitter>'


WHITE, RED, GREEN = (
    diffuse(0.885809, 0.698859, 0.666422),
    diffuse(0.570068, 0.0430135, 0.0443706),
    diffuse(0.105421, 0.37798, 0.076425),
)
WALLS = "".join(
    [
        shape("rectangle", '<rotate x="1" angle="-90"/><translate y="-1"/>', WHITE),
        shape("rectangle", '<rotate x="1" angle="90"/><translate y="1"/>', WHITE),
        shape("rectangle", '<translate z="-1"/>', WHITE),
        shape("rectangle", '<rotate y="1" angle="-90"/><translate x="1"/>', GREEN),
        shape("rectangle", '<rotate y="1" angle="90"/><translate x="-1"/>', RED),
        shape(
            "rectangle",
            '<scale x="0.23" y="0.19"/><rotate x="1" angle="90"/><translate y="0.99" z="0.01"/>',
            WHITE,
            lamp(18.387, 13.9873, 6.75357),
        ),
    ]
)
BOXES = "".join(
    [
        shape(
            "cube",
            '<scale value="0.3"/><rotate y="1" angle="-17"/>'
            '<translate x="0.335" y="-0.7" z="0.38"/>',
            WHITE,
        ),
        shape(
            "cube",
            '<scale x="0.3" y="0.61" z="0.3"/><rotate y="1" angle="18.25"/>'
            '<translate x="-0.33" y="-0.4" z="-0.28"/>',
            WHITE,
        ),
    ]
)
GLASS = (
    '<bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>'
    "</bsdf>"
)
BALLS = "".join(
    [
        shape("sphere", '<scale value="0.42"/><translate x="0.42" y="-0.58" z="0.3"/>', GLASS),
        shape("sphere", '<scale value="0.42"/><translate x="-0.42" y="-0.58" z="-0.3"/>', GLASS),
    ]
)
# Mitsuba's own default is Beckmann's distribution.
GGX = '<string name="distribution" value="ggx"/>'
COPPER = (
    f'<bsdf type="roughconductor">{GGX}<string name="material" value="Cu"/>'
    '<float name="alpha" value="0.2"/></bsdf>'
)
PLASTIC = (
    f'<bsdf type="roughplastic">{GGX}<rgb name="diffuse_reflectance" value="0.1, 0.3, 0.6"/>'
    '<float name="alpha" value="0.1"/></bsdf>'
)
PAINT = (
    '<bsdf type="principled"><rgb name="base_color" value="0.6, 0.1, 0.1"/>'
    '<float name="roughness" value="0.4"/>'
    '<float name="clearcoat" value="1"/><float name="clearcoat_gloss" value="0.9"/></bsdf>'
)
FROST = (
    f'<bsdf type="roughdielectric">{GGX}<float name="int_ior" value="1.5"/>'
    '<float name="alpha" value="0.2"/></bsdf>'
)
MATERIALS = "".join(
    shape("sphere", f'<scale value="0.4"/><translate x="{x}" y="{y}" z="0"/>', bsdf)
    for x, y, bsdf in [
        (-0.45, -0.55, COPPER),
        (0.45, -0.55, PLASTIC),
        (-0.45, 0.35, PAINT),
        (0.45, 0.35, FROST),
    ]
)
MIST = (
    '<bsdf type="null"/><medium name="interior" type="homogeneous"><rgb name="sigma_t" '
    'value="0.4, '
    '0.4, 0.4"/>'
    '<rgb name="albedo" value="0.9, 0.9, 0.9"/><phase type="hg"><float name="g" value="0.3"/>'
    "</phase></medium>"
)
FLOOR = shape("rectangle", '<scale value="30"/><rotate x="1" angle="-90"/>', diffuse(0.5, 0.5, 0.5))


def lamps() -> str:
    """A thousand small lamps over a floor with a hundred boxes."""
    at = random.Random(1)
    parts = [FLOOR]
    for _ in range(100):
        x, z, height = at.uniform(-10, 10), at.uniform(-10, 10), at.uniform(0.2, 1.2)
        parts.append(
            shape(
                "cube",
                f'<scale x="0.3" y="{height}" z="0.3"/><translate x="{x}" y="{height}" z="{z}"/>',
                diffuse(0.6, 0.6, 0.6),
            )
        )
    for _ in range(1000):
        x, y, z = at.uniform(-12, 12), at.uniform(2.6, 3.6), at.uniform(-12, 12)
        color = lamp(*(at.uniform(5, 40) for _ in range(3)))
        place = (
            f'<scale value="0.05"/><rotate x="1" angle="90"/><translate x="{x}" y="{y}" z="{z}"/>'
        )
        parts.append(shape("rectangle", place, diffuse(0.5, 0.5, 0.5), color))
    return "".join(parts)


def mesh(file: Path) -> str:
    """Upright on a floor, two units high, under a constant sky."""
    vertices = np.array(
        [line.split()[1:4] for line in file.read_text().splitlines() if line.startswith("v ")],
        dtype=float,
    )
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    x, y, z = -(low[0] + high[0]) / 2, -low[1], -(low[2] + high[2]) / 2
    placed = f'<translate x="{x}" y="{y}" z="{z}"/><scale value="{2 / (high[1] - low[1])}"/>'
    name = f'<string name="filename" value="{file.resolve()}"/>'
    sky = '  <emitter type="constant"><rgb name="radiance" value="1, 1, 1"/></emitter>\n'
    return sky + FLOOR + shape("obj", placed, name, diffuse(0.6, 0.5, 0.4))


def scenes(bunny: Path) -> dict[str, dict[str, object]]:
    box = {"fov": 39.3077, "origin": "0, 0, 3.9", "target": "0, 0, 0", "integrator": "path"}
    town = {"fov": 50, "origin": "0, 6, 14", "target": "0, 0.5, 0", "integrator": "path"}
    on_floor = {"fov": 40, "origin": "0, 2.2, 5", "target": "0, 0.9, 0", "integrator": "path"}
    # Not close to the walls: what lies between them and the edge of a medium is dark in Mitsuba 3.9
    # where it should not be.
    fog = shape("cube", '<scale value="0.8"/>', MIST)
    return {
        "cornell-box": {**box, "content": WALLS + BOXES},
        "mesh": {**on_floor, "content": mesh(bunny)},
        "lamps": {**town, "content": lamps()},
        "glass": {**box, "content": WALLS + BALLS},
        "materials": {**box, "content": WALLS + MATERIALS},
        "fog": {**box, "integrator": "volpath", "content": WALLS + BOXES + fog},
    }


class Renderer(Protocol):
    name: str

    def knows(self, file: Path) -> bool:
        """Whether it has all that the scene asks for."""

    def render(self, file: Path, spp: int, seed: int) -> tuple[np.ndarray, float]:
        """The picture, and the seconds that it took."""


class Snell:
    def __init__(self, command: str, threads: int, options: list[str]) -> None:
        self.command, self.threads, self.options, self.name = command, threads, options, "snell"

    def knows(self, file: Path) -> bool:
        return True

    def render(self, file: Path, spp: int, seed: int) -> tuple[np.ndarray, float]:
        with tempfile.TemporaryDirectory() as folder:
            out, stats = Path(folder) / "picture.pfm", Path(folder) / "stats.json"
            options = [
                "--threads",
                str(self.threads),
                "--seed",
                str(seed),
                "--spp",
                str(spp),
                "-q",
                "--stats",
                str(stats),
            ]
            subprocess.run(
                [self.command, "render", str(file), "-o", str(out), *options, *self.options],
                check=True,
                stderr=subprocess.DEVNULL,
            )
            return read_pfm(out), float(json.loads(stats.read_text())["render_seconds"])


class Mitsuba:
    def __init__(self, variant: str, threads: int) -> None:
        import drjit
        import mitsuba

        self.name, self.mi = variant, mitsuba
        mitsuba.set_variant(variant)
        mitsuba.set_log_level(mitsuba.LogLevel.Error)
        drjit.set_thread_count(threads)
        self.loaded: dict[Path, object] = {}

    def knows(self, file: Path) -> bool:
        return True

    def render(self, file: Path, spp: int, seed: int) -> tuple[np.ndarray, float]:
        mi = self.mi
        mi.set_variant(self.name)
        if file not in self.loaded:
            self.loaded[file] = mi.load_file(str(file))
            np.array(mi.render(self.loaded[file], spp=spp, seed=999))
        start = time.perf_counter()
        image = np.array(mi.render(self.loaded[file], spp=spp, seed=seed))
        return image[..., :3].astype(np.float64), time.perf_counter() - start


def read_pfm(file: Path) -> np.ndarray:
    with file.open("rb") as lines:
        assert lines.readline().strip() == b"PF"
        width, height = map(int, lines.readline().split())
        order = "<" if float(lines.readline()) < 0 else ">"
        pixels = np.frombuffer(lines.read(), dtype=f"{order}f4").reshape(height, width, 3)
    return pixels[::-1].astype(np.float64)


def opponent(name: str, threads: int) -> Renderer:
    if name != "cycles":
        return Mitsuba(name, threads)
    from cycles_scene import Cycles

    return Cycles(threads)


def measure(
    renderers: list[Renderer], file: Path, side: int, spp: int, repeat: int
) -> dict[str, dict[str, float]]:
    seconds: dict[str, list[float]] = {r.name: [] for r in renderers}
    pictures: dict[str, list[np.ndarray]] = {r.name: [] for r in renderers}
    for turn in range(max(2, repeat)):
        for renderer in renderers:
            picture, taken = renderer.render(file, spp, turn + 1)
            seconds[renderer.name].append(taken)
            pictures[renderer.name].append(picture)
    found = {}
    for name, (a, b, *_) in pictures.items():
        mean = float(np.mean(pictures[name]))
        variance = float(((a - b) ** 2).mean() / 2 / mean**2 * spp)
        found[name] = {
            "rate": side * side * spp / statistics.median(seconds[name]) / 1e6,
            "variance": variance,
            "mean": mean,
        }
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bunny", type=Path, help="a mesh, as OBJ")
    parser.add_argument("--snell", default="snell", help="the command")
    parser.add_argument("--options", default="", help="further options of `snell render`")
    parser.add_argument(
        "--peers",
        nargs="*",
        default=["llvm_ad_rgb", "scalar_rgb"],
        help="variants of Mitsuba, and cycles",
    )
    parser.add_argument(
        "--sampler",
        default="independent",
        help="of Mitsuba: independent, multijitter, stratified ...",
    )
    parser.add_argument("--scenes", nargs="*", help="only these")
    parser.add_argument("--threads", type=int, default=4)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--side", type=int, default=512)
    parser.add_argument("--depth", type=int, default=8, help="most rays of a path")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--keep", type=Path, help="write the scenes to this folder and keep them")
    parser.add_argument("--json", action="store_true", help="a line of JSON for each scene")
    options = parser.parse_args()
    renderers: list[Renderer] = [Snell(options.snell, options.threads, options.options.split())]
    renderers += [opponent(name, options.threads) for name in options.peers]
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for name, scene in scenes(options.bunny).items():
            if options.scenes and name not in options.scenes:
                continue
            file = folder / f"{name}.xml"
            file.write_text(
                HEAD.format(
                    depth=options.depth, sampler=options.sampler, side=options.side, **scene
                )
            )
            able = [renderer for renderer in renderers if renderer.knows(file)]
            found = measure(able, file, options.side, options.spp, options.repeat)
            ours = dict(found["snell"])
            for peer, theirs in found.items():
                theirs["ratio"] = ours["rate"] / theirs["rate"]
                theirs["gain"] = theirs["ratio"] * theirs["variance"] / ours["variance"]
                theirs["mean"] = ours["mean"] / theirs["mean"]
                row = {
                    "scene": name,
                    "renderer": peer,
                    "threads": options.threads,
                    "spp": options.spp,
                    **theirs,
                }
                if options.json:
                    print(json.dumps(row), flush=True)
                else:
                    numbers = "  ".join(
                        f"{key} {theirs[key]:7.3f}"
                        for key in ("rate", "variance", "ratio", "gain", "mean")
                    )
                    print(f"{name:12} {peer:14} {numbers}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
