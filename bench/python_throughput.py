"""Rays per second from Python: Snell beside Open3D, embreex, trimesh and Mitsuba, on the same
meshes and rays in one run.

    pip install . open3d embreex trimesh rtree mitsuba
    python bench/python_throughput.py bunny.obj [--triangles 1000000,10000000]
        [--rays 10000,1000000,10000000] [--threads 1,4] [--repeat 5]

For each mesh (the given one, and terrains of so many triangles), kind of rays and number of rays in
a call: millions of rays a second of the call as a user makes it, arrays in and arrays out, the
nearest hit with its distance and triangle. Sides alternate, and the median of the repeats counts; a
batch of few rays is cast several times for one measurement. `ratio` is Snell (float32) over the
best of the others, `float64` Snell's own double precision over its single, `over_trimesh` over
trimesh with embreex. `primary` rays are those of a pinhole camera, row by row; `random` ones go
from around the box to points in it; `diffuse` ones leave the hits of primary rays in random
directions. trimesh is measured up to 100,000 rays, and its rate there compared further up. Sides
that are not installed are left out; Mitsuba needs LLVM.

Memory is what the process grows by when the structure is built, by triangle, with all that the side
keeps. On a machine that does other work, `--clock processor` counts the processor time of all
threads instead of the time that passes: then only rows with one thread mean something.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import json
import os
import pathlib
import sys
import time

import numpy as np

import snell

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from python_agreement import grid


def module(name: str):
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def resident() -> int:
    """Bytes of the process that are in memory."""
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


class Snell:
    name = "snell"

    def __init__(self, vertices, faces, dtype=np.float32):
        self.name, self.dtype = (
            ("snell", dtype) if dtype == np.float32 else ("snell float64", dtype)
        )
        self.scene = snell.Scene()
        self.scene.add_mesh(vertices.astype(dtype), faces)
        self.scene.commit(dtype)

    def prepare(self, rays):
        return rays.astype(self.dtype)

    def cast(self, rays, threads):
        hits = self.scene.cast_rays(rays, threads=threads)
        return hits.t_hit, hits.primitive_ids


class Open3D:
    name = "open3d"

    def __init__(self, vertices, faces):
        self.o3d = module("open3d")
        self.scene = self.o3d.t.geometry.RaycastingScene()
        self.scene.add_triangles(
            self.o3d.core.Tensor(vertices.astype(np.float32)),
            self.o3d.core.Tensor(faces.astype(np.uint32)),
        )
        self.scene.cast_rays(self.o3d.core.Tensor(np.zeros((1, 6), np.float32)))

    def prepare(self, rays):
        return self.o3d.core.Tensor(rays.astype(np.float32))

    def cast(self, rays, threads):
        answer = self.scene.cast_rays(rays, nthreads=threads)
        return answer["t_hit"].numpy(), answer["primitive_ids"].numpy()


class Embreex:
    """embreex itself: one thread."""

    name = "embreex"
    most_threads = 1

    def __init__(self, vertices, faces):
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh

        self.scene = rtcore_scene.EmbreeScene()
        self.mesh = TriangleMesh(self.scene, vertices.astype(np.float32), faces.astype(np.int32))
        self.scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def prepare(self, rays):
        rays = rays.astype(np.float32)
        return np.ascontiguousarray(rays[:, :3]), np.ascontiguousarray(rays[:, 3:])

    def cast(self, rays, threads):
        answer = self.scene.run(*rays, output=True)
        return answer["tfar"], answer["primID"]


class Trimesh:
    """trimesh with embreex."""

    name = "trimesh"
    most_threads = 1
    most_rays = 100_000

    def __init__(self, vertices, faces):
        mesh = module("trimesh").Trimesh(vertices, faces, process=False, validate=False)
        self.ray = module("trimesh.ray.ray_pyembree").RayMeshIntersector(mesh)

    def prepare(self, rays):
        return rays[:, :3].copy(), rays[:, 3:].copy()

    def cast(self, rays, threads):
        return self.ray.intersects_id(*rays, multiple_hits=False)


class Mitsuba:
    name = "mitsuba"

    def __init__(self, vertices, faces):
        self.mi = mi = module("mitsuba")
        mi.set_variant("llvm_ad_rgb")
        import drjit as dr

        self.dr = dr
        mesh = mi.Mesh("mesh", len(vertices), len(faces))
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = vertices.astype(np.float32).ravel()
        parameters["faces"] = faces.astype(np.uint32).ravel()
        parameters.update()
        self.scene = mi.load_dict({"type": "scene", "mesh": mesh})

    def prepare(self, rays):
        return np.ascontiguousarray(rays.astype(np.float32).T)

    def cast(self, rays, threads):
        mi, dr = self.mi, self.dr
        if dr.thread_count() != threads:
            dr.set_thread_count(threads)
        ray = mi.Ray3f(mi.Point3f(rays[:3]), mi.Vector3f(rays[3:]))
        found = self.scene.ray_intersect_preliminary(ray)
        return np.array(found.t), np.array(found.prim_index)


def camera_rays(low, high, n: int) -> np.ndarray:
    width = max(int((n * 4 / 3) ** 0.5), 1)
    height = -(-n // width)
    center, size = (low + high) / 2, np.linalg.norm(high - low)
    rays = snell.create_rays_pinhole(
        fov_deg=40,
        center=center,
        eye=center + size * np.array([0.5, 0.5, 1.0]),
        up=[0, 1, 0],
        width_px=width,
        height_px=height,
    )
    return rays.reshape(-1, 6)[:n]


def kinds(vertices, faces, n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    primary = camera_rays(low, high, n)
    origins = (low + high) / 2 + (high - low) * rng.uniform(-1.5, 1.5, (n, 3))
    random = np.concatenate(
        [origins, low + (high - low) * rng.random((n, 3)) - origins], axis=1
    ).astype(np.float32)
    scene = snell.Scene()
    scene.add_mesh(vertices.astype(np.float32), faces)
    hits = scene.cast_rays(primary)
    seen = np.isfinite(hits.t_hit)
    normals = hits.primitive_normals[seen]
    normals = np.where((normals * primary[seen, 3:]).sum(-1, keepdims=True) > 0, -normals, normals)
    away = rng.normal(size=normals.shape)
    directions = normals + away / np.linalg.norm(away, axis=1, keepdims=True)
    size = np.linalg.norm(high - low)
    diffuse = np.concatenate(
        [hits.points[seen] + 1e-4 * size * normals, directions], axis=1
    ).astype(np.float32)
    diffuse = diffuse[rng.integers(len(diffuse), size=n)] if 0 < len(diffuse) < n else diffuse
    return {"primary": primary, "random": random, "diffuse": diffuse}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", nargs="?", type=pathlib.Path)
    numbers = lambda text: [int(n) for n in text.split(",") if n]  # noqa: E731
    parser.add_argument("--triangles", type=numbers, default=[1_000_000, 10_000_000])
    parser.add_argument("--rays", type=numbers, default=[10_000, 1_000_000, 10_000_000])
    parser.add_argument("--threads", type=numbers, default=[1, os.cpu_count() or 1])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--clock", choices=["wall", "processor"], default="wall")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    clock = time.perf_counter if options.clock == "wall" else time.process_time
    meshes = {}
    if options.mesh is not None:
        loaded = snell.load(options.mesh)
        meshes[options.mesh.stem] = loaded.mesh(next(iter(loaded.ids)))
    noise = np.random.default_rng(0).random((4096, 4096), dtype=np.float32)
    for count in options.triangles:
        n = int((count / 2) ** 0.5) + 1

        def height(x: np.ndarray, z: np.ndarray) -> np.ndarray:
            rough = 0.002 * noise[: x.shape[0], : x.shape[1]]
            return 0.15 * np.sin(9 * x) * np.cos(7 * z) + rough

        meshes[f"terrain of {count}"] = grid(n, height)
    peers = {"open3d": Open3D, "embreex": Embreex, "trimesh": Trimesh, "mitsuba": Mitsuba}
    show = (
        (lambda row: print(json.dumps(row), flush=True))
        if options.json
        else (lambda row: print(*(f"{k}={v}" for k, v in row.items()), flush=True))
    )
    for name, (vertices, faces) in meshes.items():
        makers = {"snell": Snell, "snell float64": lambda v, f: Snell(v, f, np.float64)}
        makers |= {key: kind for key, kind in peers.items() if module(key) is not None}
        sides = []
        for key, make in makers.items():
            gc.collect()
            before, start = resident(), time.perf_counter()
            try:
                sides.append(make(vertices, faces))
            except Exception as error:
                show({"mesh": name, "side": key, "left_out": str(error).splitlines()[0]})
                continue
            seconds = time.perf_counter() - start
            gc.collect()
            bytes_each = (resident() - before) / len(faces)
            show(
                {
                    "mesh": name,
                    "triangles": len(faces),
                    "side": key,
                    "build_seconds": round(seconds, 3),
                    "bytes_per_triangle": round(bytes_each, 1),
                }
            )
        rates_of_trimesh: dict[tuple[str, int], float] = {}
        for count in options.rays:
            for kind, rays in kinds(vertices, faces, count).items():
                for threads in options.threads:
                    able = [
                        s
                        for s in sides
                        if threads <= getattr(s, "most_threads", 10**6)
                        and len(rays) <= getattr(s, "most_rays", 10**12)
                    ]
                    rates = measure(able, rays, threads, options.repeat, clock)
                    # What has one thread is measured with one.
                    key = (kind, threads)
                    rates_of_trimesh[key] = rates.get(
                        "trimesh", rates_of_trimesh.get(key, rates_of_trimesh.get((kind, 1), 0.0))
                    )
                    others = [rate for name, rate in rates.items() if not name.startswith("snell")]
                    row = {"mesh": name, "kind": kind, "rays": len(rays), "threads": threads} | {
                        k: round(v, 2) for k, v in rates.items()
                    }
                    if others:
                        row["ratio"] = round(rates["snell"] / max(others), 2)
                    row["float64"] = round(rates["snell float64"] / rates["snell"], 2)
                    if rates_of_trimesh[key]:
                        row["over_trimesh"] = round(rates["snell"] / rates_of_trimesh[key], 1)
                    show(row)


def measure(sides, rays, threads: int, repeat: int, clock) -> dict[str, float]:
    """Millions of rays a second of each side: the median of the repeats, which alternate."""
    prepared = {s.name: s.prepare(rays) for s in sides}
    calls = max(1, 200_000 // len(rays))
    seconds: dict[str, list[float]] = {s.name: [] for s in sides}
    for side in sides:
        side.cast(prepared[side.name], threads)
    for turn in range(repeat):
        for side in sides if turn % 2 == 0 else sides[::-1]:
            start = clock()
            for _ in range(calls):
                side.cast(prepared[side.name], threads)
            seconds[side.name].append((clock() - start) / calls)
    return {name: len(rays) / float(np.median(times)) / 1e6 for name, times in seconds.items()}


if __name__ == "__main__":
    main()
