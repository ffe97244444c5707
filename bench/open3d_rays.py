"""Open3D's ray caster on the rays that `snell bench rays --dump-rays FOLDER` writes.

    python open3d_rays.py FOLDER... [--threads 1,4] [--repeat 5]

Prints a line of JSON for each folder, kind of rays and number of threads, with the fields of `snell
bench rays`. Open3D casts rays with Embree inside; its rays have no interval, so they are moved to
their beginning here, and the shadow rays end a little behind the light.
"""

import argparse
import json
import pathlib
import statistics
import time

import numpy as np
import open3d as o3d

KINDS = ["primary", "shadow", "diffuse", "shuffled"]


def moved_to_their_beginning(rays: np.ndarray) -> np.ndarray:
    """Origin and direction, from rows of origin, t_min, direction, t_max."""
    origin, t_min, direction = rays[:, :3], rays[:, 3:4], rays[:, 4:7]
    return np.concatenate([origin + t_min * direction, direction], axis=1).astype(np.float32)


def measure(folder: pathlib.Path, threads: list[int], repeat: int) -> None:
    scene = o3d.t.geometry.RaycastingScene()
    positions, triangles = np.load(folder / "positions.npy"), np.load(folder / "triangles.npy")
    scene.add_triangles(o3d.core.Tensor(positions), o3d.core.Tensor(triangles))
    for kind in KINDS:
        if not (folder / f"{kind}.npy").exists():
            continue
        rays = np.load(folder / f"{kind}.npy")
        expected = np.load(folder / f"{kind}-t.npy")
        tensor = o3d.core.Tensor(moved_to_their_beginning(rays))

        def trace(nthreads: int, kind=kind, tensor=tensor, rays=rays) -> np.ndarray:
            if kind == "shadow":
                blocked = scene.test_occlusions(tensor, 0.0, 1.0, nthreads).numpy()
                return np.where(blocked, 0.0, np.inf)
            return scene.cast_rays(tensor, nthreads)["t_hit"].numpy() + rays[:, 3]

        for nthreads in threads:
            # The first run builds, or warms up.
            found = trace(nthreads)
            seconds = []
            for _ in range(repeat):
                start = time.perf_counter()
                trace(nthreads)
                seconds.append(time.perf_counter() - start)
            agree = np.isclose(found, expected, rtol=1e-4, atol=0.0).mean()
            row = {
                "scene": folder.name,
                "triangles": len(triangles),
                "rays": kind,
                "ray_count": len(rays),
                "threads": nthreads,
                "peer": f"Open3D {o3d.__version__}",
                "mrays_per_second": round(len(rays) / statistics.median(seconds) * 1e-6, 4),
                "agree": round(float(agree), 6),
            }
            print(json.dumps(row), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=pathlib.Path)
    parser.add_argument(
        "--threads", default="1", type=lambda text: [int(n) for n in text.split(",")]
    )
    parser.add_argument("--repeat", default=5, type=int)
    options = parser.parse_args()
    for folder in options.folders:
        measure(folder, options.threads, options.repeat)


if __name__ == "__main__":
    main()
