"""Long use of the Python package: does memory grow, and does bad input ever end the interpreter?

    python bench/python_soak.py [--calls 10000] [--bad 100000] [--seed 0]

`--calls` queries, edits and small renders of each kind: the memory of the process after a tenth of
them and at the end. `--bad` calls of everything public with arguments of the wrong kind, shape,
size and value: only exceptions may come of it, and the scene must answer as before.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import pathlib
import time
import warnings

import numpy as np

import snell


def resident() -> float:
    """Megabytes of the process that are in memory."""
    return (
        int(pathlib.Path("/proc/self/statm").read_text().split()[1])
        * os.sysconf("SC_PAGE_SIZE")
        / 1e6
    )


def grow(calls: int) -> dict[str, float]:
    """Megabytes by which the process grows over the last nine tenths of the calls."""
    rng = np.random.default_rng(0)
    vertices = rng.random((300, 3)).astype(np.float32)
    faces = rng.integers(300, size=(500, 3))
    scene = snell.Scene()
    mesh = scene.add_mesh(vertices, faces)
    scene.add_light(snell.Light("directional", direction=(0, -1, 0), irradiance=1))
    rays, points = rng.random((1000, 6)).astype(np.float32), rng.random((100, 3))
    material = snell.Material("diffuse", reflectance=0.5)

    def edit():
        ball = scene.add_shape("sphere", radius=0.1, material=material)
        scene.update_vertices(mesh, vertices + 0.01)
        scene.remove(ball)

    work = {
        "cast_rays": lambda: scene.cast_rays(rays).normals,
        "cast_rays float64": lambda: scene.cast_rays(rays.astype(np.float64)).t_hit,
        "list_intersections": lambda: scene.list_intersections(rays).t_hit,
        "signed_distance": lambda: scene.signed_distance(points),
        "new scene": lambda: snell.Scene().add_mesh(vertices, faces),
        "errors": lambda: _fails(scene),
        "render": lambda: np.asarray(snell.render(scene, spp=1, size=(8, 8))),
    }
    found = {}
    for name, call in work.items():
        count = calls if name != "render" else max(calls // 10, 1)
        for i in range(count):
            if i == count // 10:
                gc.collect()
                before = resident()
            call()
        gc.collect()
        found[name] = round(resident() - before, 2)
    # Ids are never used again, so a scene that is edited holds a little more each time: measured
    # apart.
    for _ in range(calls // 10):
        edit()
    return found


def _fails(scene: snell.Scene) -> None:
    with contextlib.suppress(ValueError):
        scene.cast_rays(np.zeros((3, 5)))


def attack(count: int, seed: int) -> tuple[int, int]:
    """Bad calls: how many succeeded after all, and how many raised."""
    rng = np.random.default_rng(seed)
    special = [0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 1e-45, 3e38, 1e300, 7.0, 2.0**40]
    texture = snell.Texture(np.ones((2, 2)))
    material, light = (
        snell.Material("diffuse", reflectance=1),
        snell.Light("point", position=(0, 0, 0), intensity=1),
    )
    camera, picture = snell.Camera(eye=(0, 0, 1)), snell.Image(np.ones((2, 2)))

    def array():
        shape = tuple(rng.integers(0, 5, size=rng.integers(0, 4)))
        if rng.random() < 0.5:
            shape = (*shape, int(rng.choice([2, 3, 4, 6])))
        kind = rng.choice(
            [
                np.float16,
                np.float32,
                np.float64,
                np.int8,
                np.int32,
                np.uint64,
                np.complex64,
                np.bool_,
                object,
            ]
        )
        with np.errstate(all="ignore"):
            return rng.choice(special, size=shape).astype(kind)

    def anything():
        simple = [
            None,
            True,
            "",
            "x",
            "path",
            "#12zz34",
            b"",
            (),
            [],
            {},
            {"factor": 1},
            -1,
            0,
            1,
            7,
            2**70,
            1.5,
            float("nan"),
            1j,
            object(),
            int,
            array,
        ]
        things = [scene, texture, texture.channel("r"), material, light, camera, picture, snell]
        pick = rng.integers(4)
        return (
            array()
            if pick == 0
            else simple[rng.integers(len(simple))]
            if pick < 3
            else things[rng.integers(len(things))]
        )

    def target():
        classes = [
            snell.Material,
            snell.Light,
            snell.Camera,
            snell.Texture,
            snell.Image,
            snell.Hits,
            snell.Scene,
        ]
        things = [scene, scene, scene, texture, material, light, camera, picture]
        pick = rng.integers(8)
        if pick == 0:
            return rng.choice(
                ["load", "render", "compare", "create_rays_pinhole"]
            ), lambda name: getattr(snell, name)
        if pick == 1:
            return str(rng.integers(len(classes))), lambda name: classes[int(name)]
        thing = things[rng.integers(len(things))]
        # Names of files would be written to.
        names = [
            name
            for name in dir(type(thing))
            if not name.startswith("__") and name not in ("save", "open")
        ]
        return str(rng.choice(names)), lambda name: getattr(thing, name)

    kinds = [*snell.MATERIALS, *snell.LIGHTS, *snell.PROJECTIONS, *snell.SHAPES]
    keys = sorted(
        {
            key
            for table in (snell.MATERIALS, snell.LIGHTS, snell.PROJECTIONS, snell.SHAPES)
            for names in table.values()
            for key in names
        }
    )
    keys += [
        "material",
        "mask",
        "transform",
        "t_min",
        "t_max",
        "threads",
        "normals",
        "uvs",
        "colors",
        "emission",
        "eye",
        "target",
        "fov",
        "encoding",
        "wrap",
    ]
    succeeded = failed = 0
    small = {"spp": 1, "size": (4, 4), "progress": False}
    for i in range(count):
        if i % 1000 == 0:
            scene = snell.Scene()
            scene.add_mesh(np.eye(3, dtype=np.float32), [[0, 1, 2]])
        name, find = target()
        arguments = [anything() for _ in range(rng.integers(0, 4))]
        options = {str(rng.choice(keys)): anything() for _ in range(rng.integers(0, 3))}
        if rng.random() < 0.3:
            arguments = [str(rng.choice(kinds)), *arguments[:1]]
        if name == "render":
            options |= small
            arguments = arguments[:1]
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                thing = find(name)
                if callable(thing):
                    thing(*arguments, **options)
                elif isinstance(thing, property) or rng.random() < 0.2:
                    setattr(scene, name, anything())
            succeeded += 1
        except Exception:
            failed += 1
        if i % 500 == 0:
            probe = snell.Scene()
            probe.add_mesh(np.eye(3, dtype=np.float32), [[0, 1, 2]])
            assert probe.count_intersections([[0, 0, 0, 1, 1, 1]]).tolist() == [1]
    return succeeded, failed


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--calls", type=int, default=10_000)
    parser.add_argument("--bad", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    start = time.perf_counter()
    for name, megabytes in grow(options.calls).items():
        print(f"{name}: {megabytes:+} MB over {options.calls} calls", flush=True)
    print(f"{time.perf_counter() - start:.0f} s")
    start = time.perf_counter()
    succeeded, failed = attack(options.bad, options.seed)
    print(
        f"{options.bad} bad calls: {failed} exceptions, {succeeded} were fine after all; the "
        f"interpreter lives ({time.perf_counter() - start:.0f} s)"
    )


if __name__ == "__main__":
    main()
