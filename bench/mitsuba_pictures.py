"""Pictures of Snell beside those of Mitsuba 3, of the same files: do they agree, and whose noise is
less?

    python bench/mitsuba_pictures.py OUTPUT-FOLDER [SCENE.xml ...]
        [--snell target/release/snell] [--variant scalar_rgb]

Needs NumPy and Mitsuba (`pip install mitsuba`; its `llvm_ad_rgb` needs a libLLVM of a recent
version, see DRJIT_LIBLLVM_PATH). Without scenes: a ball of each lobe, hair, and a fog. Errors are
relative mean squared errors as in `snell compare`, without the worst thousandth of the pixels. The
columns:

    agree       error of a Snell picture of many samples against Mitsuba's
    noise       what the noise of the two alone would make of that
    brightness  mean of the one over the other
    errors      of pictures of --spp samples, each against its own renderer's picture of many
                samples
    seconds     processor time of all threads for those, without reading and building
    equal time  error of Snell's picture in the time of Mitsuba's
    gain        Mitsuba's error over that
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import time
from pathlib import Path

import mitsuba as mi
import numpy as np

EPSILON = 1e-2  # as in `snell compare`

BALL = """<scene version="3.0.0">
  <default name="spp" value="64"/>
  <integrator type="{integrator}"><integer name="max_depth" value="{depth}"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="35"/>
    <transform name="to_world">
      <lookat origin="0, 2.4, 6" target="0, 0.9, 0" up="0, 1, 0"/>
    </transform>
    <sampler type="{sampler}"><integer name="sample_count" value="$spp"/></sampler>
    <film type="hdrfilm">
      <integer name="width" value="{side}"/><integer name="height" value="{side}"/>
      <rfilter type="box"/>
    </film>
  </sensor>
  <emitter type="constant"><rgb name="radiance" value="0.3, 0.35, 0.42"/></emitter>
  <shape type="rectangle">
    <transform name="to_world">
      <scale value="0.9"/><rotate x="1" angle="90"/><translate x="-1.5" y="4.5" z="1.5"/>
    </transform>
    <emitter type="area"><rgb name="radiance" value="18, 16, 13"/></emitter>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><scale value="20"/><rotate x="1" angle="-90"/></transform>
    <bsdf type="twosided">
      <bsdf type="diffuse"><rgb name="reflectance" value="0.45, 0.42, 0.4"/></bsdf>
    </bsdf>
  </shape>
{content}
</scene>
"""

SPHERE = """  <shape type="sphere"><point name="center" x="0" y="1" z="0"/>
    <float name="radius" value="1"/>
{bsdf}
  </shape>"""

BSDFS = {
    "diffuse": '<bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.3, 0.2"/></bsdf>',
    "mirror": '<bsdf type="conductor"><string name="material" value="none"/></bsdf>',
    "gold": (
        '<bsdf type="conductor"><rgb name="eta" value="0.143, 0.375, 1.442"/>'
        '<rgb name="k" value="3.983, 2.386, 1.603"/></bsdf>'
    ),
    "rough gold": '<bsdf type="roughconductor">'
    '<string name="distribution" value="ggx"/><float name="alpha" value="0.2"/>'
    '<rgb name="eta" value="0.143, 0.375, 1.442"/><rgb name="k" value="3.983, 2.386, 1.603"/>'
    "</bsdf>",
    "glass": (
        '<bsdf type="dielectric"><float name="int_ior" value="1.5"/>'
        '<float name="ext_ior" value="1"/></bsdf>'
    ),
    "rough glass": '<bsdf type="roughdielectric">'
    '<string name="distribution" value="ggx"/><float name="alpha" value="0.2"/>'
    '<float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>',
    "plastic": '<bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.1, 0.25, 0.5"/>'
    '<float name="int_ior" value="1.5"/>'
    '<float name="ext_ior" value="1"/></bsdf>',
    "rough plastic": '<bsdf type="roughplastic">'
    '<string name="distribution" value="ggx"/><float name="alpha" value="0.2"/>'
    '<rgb name="diffuse_reflectance" value="0.1, 0.25, 0.5"/><float name="int_ior" value="1.5"/>'
    '<float name="ext_ior" value="1"/></bsdf>',
}

FOG = """  <shape type="cube">
    <transform name="to_world"><scale x="1.6" y="1" z="1.2"/><translate y="1.05"/></transform>
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous">
      <rgb name="sigma_t" value="0.5, 0.6, 0.75"/><float name="scale" value="2"/>
      <rgb name="albedo" value="0.9, 0.85, 0.8"/>
      <phase type="hg"><float name="g" value="0.4"/></phase>
    </medium>
  </shape>
"""

HAIR = """  <shape type="bsplinecurve"><string name="filename" value="{strands}"/>
    <bsdf type="hair">
      <float name="eumelanin" value="1.3"/><float name="pheomelanin" value="0.2"/>
    </bsdf>
  </shape>"""


def strands(count: int = 2000, points: int = 10, radius: float = 0.012) -> str:
    """Strands of a ball of hair, of a point in each line. Both ends are pointed: blunt ones are
    round in Snell and open in Mitsuba.
    """
    random = np.random.default_rng(1)
    lines = []
    for _ in range(count):
        outward, bend = random.normal(size=3), random.normal(size=3) * 0.2
        outward /= np.linalg.norm(outward)
        for i in range(points):
            along = i / (points - 1)
            x, y, z = outward * (0.25 + 0.75 * along) + bend * along**2
            lines.append(
                f"{x:.6f} {y + 1:.6f} {z:.6f} {radius if 3 <= i < points - 3 else 1e-7:.7f}"
            )
        lines.append("")
    return "\n".join(lines)


def standard_scenes(folder: Path, side: int, sampler: str) -> list[Path]:
    """Writes the scenes that come with this script."""
    files = []
    shared = {"side": side, "sampler": sampler}
    for name, bsdf in BSDFS.items():
        file = folder / f"{name.replace(' ', '-')}.xml"
        file.write_text(
            BALL.format(integrator="path", depth=9, content=SPHERE.format(bsdf=bsdf), **shared)
        )
        files.append(file)
    (folder / "strands.txt").write_text(strands())
    file = folder / "hair.xml"
    file.write_text(
        BALL.format(
            integrator="path", depth=17, content=HAIR.format(strands="strands.txt"), **shared
        )
    )
    files.append(file)
    file = folder / "fog.xml"
    file.write_text(BALL.format(integrator="volpath", depth=17, content=FOG, **shared))
    return [*files, file]


class Snell:
    def __init__(self, command: str, folder: Path, threads: int, side: int | None) -> None:
        self.command, self.folder, self.threads, self.side = command, folder, threads, side

    def _run(self, scene: Path, spp: int, seed: int, out: Path) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        size = ["--size", self.side] if self.side else []
        options = [
            "--threads",
            str(self.threads),
            "--seed",
            str(seed),
            "--filter",
            "box",
            "-q",
            *size,
        ]
        command = [self.command, "render", str(scene), "--spp", str(spp), "-o", str(out), *options]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def __call__(self, scene: Path, spp: int, seed: int, kind: str) -> tuple[np.ndarray, float]:
        out = self.folder / f"{scene.stem}-snell-{kind}.exr"
        start = self._run(scene, 1, seed, out)
        seconds = self._run(scene, spp, seed, out) - start * (spp > 1)
        return pixels(mi.Bitmap(str(out))), max(seconds, 1e-3)


class Mitsuba:
    def __init__(self, folder: Path, size: tuple[int, int] | None) -> None:
        self.folder, self.size = folder, size

    def __call__(self, scene: Path, spp: int, seed: int, kind: str) -> tuple[np.ndarray, float]:
        loaded = mi.load_file(
            str(scene), **({} if "spp" not in scene.read_text() else {"spp": spp})
        )
        np.array(mi.render(loaded, spp=spp, seed=seed + 1))  # compiles
        start = time.process_time()
        image = mi.render(loaded, spp=spp, seed=seed)
        np.array(image)
        seconds = time.process_time() - start
        bitmap = mi.Bitmap(image)
        bitmap.write(str(self.folder / f"{scene.stem}-mitsuba-{kind}.exr"))
        return pixels(bitmap), seconds


def pixels(bitmap: mi.Bitmap) -> np.ndarray:
    return np.array(
        bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False), dtype=np.float64
    )


def error(test: np.ndarray, reference: np.ndarray) -> float:
    squares = ((test - reference) ** 2 / (reference**2 + EPSILON)).mean(axis=2).ravel()
    squares.sort()
    return float(squares[: len(squares) - len(squares) // 1000].mean())


def compare(scene: Path, snell: Snell, mitsuba: Mitsuba, spp: int, many: int) -> dict[str, object]:
    (ours, _), (theirs, _) = (
        snell(scene, many, 1000, "reference"),
        mitsuba(scene, many, 1000, "reference"),
    )
    (our_few, our_time), (their_few, their_time) = (
        snell(scene, spp, 1, "few"),
        mitsuba(scene, spp, 1, "few"),
    )
    our_error, their_error = error(our_few, ours), error(their_few, theirs)
    equal, _ = snell(scene, max(1, round(spp * their_time / our_time)), 2, "equal-time")
    equal_error = error(equal, ours)
    return {
        "scene": scene.stem,
        "spp": spp,
        "agree": error(ours, theirs),
        "noise": (our_error + their_error) * spp / many,
        "brightness": float(ours.mean() / theirs.mean()),
        "snell_error": our_error,
        "mitsuba_error": their_error,
        "snell_seconds": our_time,
        "mitsuba_seconds": their_time,
        "equal_time_error": equal_error,
        "gain": their_error / equal_error,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the pictures go")
    parser.add_argument("scenes", type=Path, nargs="*")
    parser.add_argument("--snell", default="snell", help="the command")
    parser.add_argument("--variant", default="scalar_rgb", help="of Mitsuba")
    parser.add_argument(
        "--sampler", default="multijitter", help="of Mitsuba, in the scenes of this script"
    )
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument(
        "--many",
        type=int,
        default=1024,
        help="samples of the pictures that errors are measured against",
    )
    parser.add_argument(
        "--side", type=int, default=128, help="width and height of the scenes of this script"
    )
    parser.add_argument(
        "--threads",
        type=int,
        default=2,
        help="of both; Mitsuba reads no EXR file with one only: it waits for ever",
    )
    parser.add_argument("--json", action="store_true", help="a line of JSON for each scene")
    options = parser.parse_args()
    mi.set_variant(options.variant)
    mi.set_log_level(mi.LogLevel.Error)
    import drjit as dr

    if options.threads < 2:
        parser.error(
            "with one thread only, Mitsuba waits for ever when it reads an EXR file: use "
            "--threads "
            "2 or more"
        )
    dr.set_thread_count(options.threads)
    options.folder.mkdir(parents=True, exist_ok=True)
    scenes = options.scenes or standard_scenes(options.folder, options.side, options.sampler)
    if not options.json:
        print(
            f"Mitsuba {mi.__version__}, {options.variant}, {options.threads} thread(s), "
            f"{options.spp} samples"
        )
        print(
            f"{'scene':16} {'agree':>8} {'noise':>8} {'brightn.':>8} {'errors':>8} {'Mitsuba':>8} "
            f"{'seconds':>8} {'Mitsuba':>8} "
            f"{'eq.time':>8} {'gain':>6}"
        )
    snell, mitsuba = (
        Snell(options.snell, options.folder, options.threads, None),
        Mitsuba(options.folder, None),
    )
    for scene in scenes:
        row = compare(scene, snell, mitsuba, options.spp, options.many)
        if options.json:
            print(json.dumps(row), flush=True)
            continue
        numbers = [row[k] for k in ("agree", "noise", "brightness", "snell_error", "mitsuba_error")]
        times = [row[k] for k in ("snell_seconds", "mitsuba_seconds")]
        print(
            f"{row['scene']:16} "
            + " ".join(f"{x:8.5f}" for x in numbers)
            + " "
            + " ".join(f"{x:8.2f}" for x in times)
            + f" {row['equal_time_error']:8.5f} {row['gain']:6.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
