"""Caustics beside Mitsuba 3 and LuxCore: the same scenes, pictures side by side, and brightness.

    python bench/caustics.py FOLDER --snell target/release/snell [--size 256] [--quick]

Three scenes with a small lamp: a glass ball over a floor, a mirror ring on a table, and a floor
under rippled water. Mitsuba traces them with `ptracer` (light paths to the camera), which cannot
see the water's floor: there it is left out. LuxCore traces paths with its cache of caustic photons.
Each has a lamp that is large enough for plain paths too, which are the reference for brightness.

Needs `pip install mitsuba pyluxcore numpy`; a program that is absent is left out.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

FLOOR = 0.6
RIPPLES = 160


def grid(count: int, height):
    """A square mesh over [-1, 1] squared, `height(x, y)` high."""
    axis = np.linspace(-1, 1, count + 1)
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x, y, height(x, y)], -1).reshape(-1, 3)
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1, 1)
    near = first + [0, 1, count + 2]
    far = first + [0, count + 2, count + 1]
    return points, np.concatenate([near, far])


def ripples(x, y):
    """A water surface."""
    waves = [(5.0, 2.0, 0.3), (-3.0, 6.0, 1.1), (8.0, -5.0, 2.0), (11.0, 9.0, 0.7)]
    return 0.5 + sum(0.05 / np.hypot(a, b) * np.sin(a * x + b * y + c) for a, b, c in waves)


def tube(count: int, radius: float, top: float):
    """A standing tube without ends."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)
    low = np.concatenate([ring, np.zeros((count, 1))], 1)
    high = np.concatenate([ring, np.full((count, 1), top)], 1)
    i = np.arange(count)
    j = (i + 1) % count
    faces = np.stack([np.stack([i, j, j + count], -1), np.stack([i, j + count, i + count], -1)])
    return np.concatenate([low, high]), faces.reshape(-1, 3)


def square(center, half: float):
    """A horizontal square that faces down."""
    x, y, z = center
    corners = [(-half, -half), (-half, half), (half, half), (half, -half)]
    return np.array([(x + a, y + b, z) for a, b in corners]), np.array([(0, 1, 2), (0, 2, 3)])


def floor(half: float):
    """A square that faces up, on the ground."""
    points, faces = square((0, 0, 0), half)
    return points, faces[:, ::-1]


def ball(steps: int, center, radius: float):
    """A sphere of triangles, so that all three programs have the same."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, steps + 1), np.arange(2 * steps) / steps)
    around = around * np.pi
    unit = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], -1
    )
    count = steps + 1
    faces = []
    for i in range(2 * steps):
        for k in range(steps):
            a, b = i * count + k, (i + 1) % (2 * steps) * count + k
            if k > 0:
                faces.append((a, b + 1, b))
            if k < steps - 1:
                faces.append((a, a + 1, b + 1))
    return unit.reshape(-1, 3) * radius + center, np.array(faces)


WATER, GLASS, MIRROR, MATTE = ("dielectric", 1.33), ("dielectric", 1.5), ("mirror", 0.9), None


class Case:
    """A scene: its lamp, camera, things, and the part of the picture that is compared."""

    def __init__(self, name, lamp, eye, target, fov, things, part, sees_floor=True):
        self.name, self.lamp, self.eye, self.target, self.fov = name, lamp, eye, target, fov
        self.things, self.part, self.sees_floor = things, part, sees_floor


CASES = [
    Case(
        "ball",
        ((0.9, 0.4, 3.0), 0.02),
        (0.0, -3.2, 2.4),
        (-0.2, 0.0, 0.2),
        35.0,
        [(floor(3.0), MATTE), (ball(96, (0.0, 0.0, 0.75), 0.4), GLASS)],
        (0.3, 0.62, 0.55, 0.8),
    ),
    Case(
        "ring",
        ((1.2, 0.9, 2.0), 0.02),
        (0.0, -2.2, 2.6),
        (0.0, 0.0, 0.0),
        35.0,
        [(floor(3.0), MATTE), (tube(512, 0.6, 0.35), MIRROR)],
        (0.35, 0.45, 0.65, 0.65),
    ),
    Case(
        "pool",
        ((0.3, 0.2, 3.0), 0.02),
        (0.0, -1.6, 2.6),
        (0.0, 0.0, 0.2),
        40.0,
        [(floor(3.0), MATTE), (grid(RIPPLES, ripples), WATER)],
        (0.35, 0.35, 0.65, 0.65),
        sees_floor=False,
    ),
]


def write_ply(path: Path, points, faces):
    """A mesh as text."""
    lines = [
        "ply\nformat ascii 1.0",
        f"element vertex {len(points)}",
        "property float x\nproperty float y\nproperty float z",
        f"element face {len(faces)}",
        "property list uchar int vertex_indices\nend_header",
    ]
    lines += [" ".join(f"{x:.9g}" for x in point) for point in points]
    lines += ["3 " + " ".join(map(str, face)) for face in faces]
    path.write_text("\n".join(lines) + "\n")


def radiance(half: float) -> float:
    """The radiance of a lamp of 30 W / (pi sr), whatever its size."""
    return 30.0 / (2 * half) ** 2


def meshes(case: Case, half: float, folder: Path):
    """Writes the meshes; gives the name and material of each, the lamp last."""
    all_things = [*case.things, (square(case.lamp[0], half), "lamp")]
    for number, ((points, faces), _) in enumerate(all_things):
        write_ply(folder / f"{number}.ply", points, faces)
    return [(f"{number}.ply", material) for number, (_, material) in enumerate(all_things)]


def mitsuba_file(case: Case, half: float, size: int, folder: Path) -> Path:
    """The scene in Mitsuba's format, which Snell reads too."""
    folder.mkdir(parents=True, exist_ok=True)
    shapes = []
    for name, material in meshes(case, half, folder):
        inside = f'<bsdf type="diffuse"><rgb name="reflectance" value="{FLOOR}"/></bsdf>'
        if material == "lamp":
            inside = '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
            inside += (
                f'<emitter type="area"><rgb name="radiance" value="{radiance(half)}"/></emitter>'
            )
        elif material is not None and material[0] == "dielectric":
            inside = f'<bsdf type="dielectric"><float name="int_ior" value="{material[1]}"/></bsdf>'
        elif material is not None:
            inside = (
                '<bsdf type="twosided"><bsdf type="conductor">'
                '<string name="material" value="none"/>'
                f'<rgb name="specular_reflectance" value="{material[1]}"/></bsdf></bsdf>'
            )
        shapes.append(
            f'<shape type="ply"><string name="filename" value="{name}"/>'
            f'<boolean name="face_normals" value="true"/>{inside}</shape>'
        )
    eye, target = (", ".join(map(str, p)) for p in (case.eye, case.target))
    path = folder / "scene.xml"
    path.write_text(
        f"""<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="16"/></integrator>
<sensor type="perspective">
  <float name="fov" value="{case.fov}"/>
  <transform name="to_world"><lookat origin="{eye}" target="{target}" up="0, 0, 1"/></transform>
  <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
  <film type="hdrfilm"><integer name="width" value="{size}"/><integer name="height" value="{size}"/>
    <rfilter type="box"/></film>
</sensor>
"""
        + "\n".join(shapes)
        + "\n</scene>\n"
    )
    return path


def by_snell(snell: str, scene: Path, options: list[str], out: Path):
    """Picture, seconds of processors, and statistics."""
    stats = out.with_suffix(".json")
    command = [snell, "render", str(scene), "-o", str(out), "--stats", str(stats), "--quiet"]
    start = time.perf_counter()
    subprocess.run([*command, *options], check=True)
    seconds = time.perf_counter() - start
    return read_pfm(out), seconds, json.loads(stats.read_text())


def read_pfm(path: Path):
    """The values of a PFM file, the first row at the top."""
    with path.open("rb") as file:
        kind, size, scale = (file.readline().split() for _ in range(3))
        width, height = map(int, size)
        order = "<f4" if float(scale[0]) < 0 else ">f4"
        values = np.frombuffer(file.read(), order).reshape(height, width, -1)
    assert kind[0] in (b"PF", b"Pf")
    return values[::-1].astype(np.float64)


def by_mitsuba(scene: Path, kind: str, samples: int):
    """Light paths to the camera (`ptracer`), or paths from it (`path`)."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb" if "--llvm" in sys.argv else "scalar_rgb")
    loaded = mi.load_file(str(scene))
    integrator = mi.load_dict({"type": kind, "max_depth": 16})
    start = time.perf_counter()
    picture = np.array(mi.render(loaded, integrator=integrator, spp=samples))
    return picture.astype(np.float64), time.perf_counter() - start


def by_luxcore(case: Case, half: float, size: int, folder: Path, seconds: float):
    """Paths with the cache of caustic photons."""
    import pyluxcore as lux

    lux.Init()
    props = lux.Properties()
    put = lambda name, value: props.Set(lux.Property(name, value))  # noqa: E731
    put("scene.camera.type", "perspective")
    put("scene.camera.lookat.orig", list(case.eye))
    put("scene.camera.lookat.target", list(case.target))
    put("scene.camera.up", [0.0, 0.0, 1.0])
    put("scene.camera.fieldofview", case.fov)
    put("scene.camera.autovolume.enable", False)
    for number, (name, material) in enumerate(meshes(case, half, folder)):
        at = f"scene.materials.m{number}"
        if material == "lamp":
            put(f"{at}.type", "matte")
            put(f"{at}.kd", [0.0, 0.0, 0.0])
            put(f"{at}.emission", [radiance(half)] * 3)
        elif material is None:
            put(f"{at}.type", "matte")
            put(f"{at}.kd", [FLOOR] * 3)
        elif material[0] == "dielectric":
            put(f"{at}.type", "glass")
            put(f"{at}.kr", [1.0] * 3)
            put(f"{at}.kt", [1.0] * 3)
            put(f"{at}.interiorior", material[1])
        else:
            put(f"{at}.type", "mirror")
            put(f"{at}.kr", [material[1]] * 3)
        put(f"scene.objects.o{number}.ply", str(folder / name))
        put(f"scene.objects.o{number}.material", f"m{number}")
    scene = lux.Scene()
    scene.Parse(props)
    config = lux.Properties()
    for name, value in {
        "renderengine.type": "PATHCPU",
        "sampler.type": "SOBOL",
        "film.width": size,
        "film.height": size,
        "film.filter.type": "NONE",
        "path.pathdepth.total": 16,
        "path.pathdepth.diffuse": 16,
        "path.pathdepth.glossy": 16,
        "path.pathdepth.specular": 16,
        "path.photongi.photon.maxcount": 2_000_000,
        "path.photongi.photon.maxdepth": 8,
        "path.photongi.caustic.enabled": True,
        "path.photongi.caustic.maxsize": 200_000,
        "path.photongi.caustic.updatespp": 8,
        "path.photongi.caustic.lookup.radius": 0.01,
        "film.outputs.0.type": "RGB",
        "film.outputs.0.filename": "unused.exr",
    }.items():
        config.Set(lux.Property(name, value))
    session = lux.RenderSession(lux.RenderConfig(config, scene))
    start = time.perf_counter()
    session.Start()
    ready = None
    # The photons come first.
    while ready is None or time.perf_counter() - ready < seconds:
        time.sleep(0.5)
        session.UpdateStats()
        passes = session.GetStats().Get("stats.renderengine.pass").GetInt()
        if ready is None and (passes > 0 or time.perf_counter() - start > 300):
            ready = time.perf_counter()
    values = np.zeros(size * size * 3, np.float32)
    session.GetFilm().GetOutputFloat(lux.FilmOutputType.RGB, values, 0)
    session.Stop()
    return values.reshape(size, size, 3)[::-1].astype(np.float64), time.perf_counter() - start


def part_of(picture, part):
    """The compared part of a picture."""
    height, width = picture.shape[:2]
    x0, y0, x1, y1 = part
    rows, columns = (
        slice(int(y0 * height), int(y1 * height)),
        slice(int(x0 * width), int(x1 * width)),
    )
    return picture[rows, columns].mean()


def save(path: Path, pictures):
    """Pictures side by side, as PPM in display values."""
    row = np.concatenate(pictures, axis=1)
    shown = np.where(
        row <= 0.0031308, 12.92 * row, 1.055 * np.maximum(row, 1e-9) ** (1 / 2.4) - 0.055
    )
    bytes_ = (np.clip(shown, 0, 1) * 255 + 0.5).astype(np.uint8)
    header = f"P6 {bytes_.shape[1]} {bytes_.shape[0]} 255\n".encode()
    path.write_bytes(header + bytes_.tobytes())


def main() -> int:
    """Prints a line for each picture."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--snell", default="snell")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--large", type=float, default=8.0, help="factor on the larger lamp's size")
    parser.add_argument("--llvm", action="store_true", help="Mitsuba's compiled variant")
    parser.add_argument("--case", action="append", help="only these")
    peers = ["mitsuba", "luxcore"]
    parser.add_argument("--peer", action="append", choices=peers, help="only these peers")
    given = parser.parse_args()
    chosen = given.peer or peers
    print("| scene | lamp | program | seconds | mean in the part | to Snell |")
    print("|---|---|---|---|---|---|")
    for case in (c for c in CASES if not given.case or c.name in given.case):
        for lamp, half in (("small", case.lamp[1]), ("large", case.lamp[1] * given.large)):
            folder = given.folder / f"{case.name}-{lamp}"
            scene = mitsuba_file(case, half, given.size, folder)
            spp = ["--spp", str(given.samples)]
            found = {}
            picture, seconds, _ = by_snell(
                given.snell, scene, [*spp, "--caustics", "on"], folder / "photons.pfm"
            )
            found["Snell, photons"] = picture, seconds
            picture, seconds, _ = by_snell(
                given.snell, scene, [*spp, "--caustics", "off"], folder / "paths.pfm"
            )
            found["Snell, paths"] = picture, seconds
            kinds = ["ptracer"] * case.sees_floor + ["path"] * (lamp == "large")
            for kind in kinds if "mitsuba" in chosen else []:
                try:
                    found[f"Mitsuba, {kind}"] = by_mitsuba(scene, kind, given.samples)
                except ImportError:
                    print("Mitsuba is not installed", file=sys.stderr)
            try:
                if "luxcore" in chosen:
                    limit = max(20.0, 2 * found["Snell, photons"][1])
                    found["LuxCore, photons"] = by_luxcore(case, half, given.size, folder, limit)
            except ImportError:
                print("LuxCore is not installed", file=sys.stderr)
            ours = part_of(found["Snell, photons"][0], case.part)
            for name, (picture, seconds) in found.items():
                mean = part_of(picture, case.part)
                row = [case.name, lamp, name, f"{seconds:.1f}", f"{mean:.4f}", f"{mean / ours:.4f}"]
                print("| " + " | ".join(row) + " |", flush=True)
            save(folder / "pictures.ppm", [picture for picture, _ in found.values()])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
