r"""Distance and collision of two meshes in many poses, by Snell and by python-fcl, one pose a call.

    python bench/pairs.py [TRIANGLES...] [--poses N]

Both get the same meshes and poses, turn by turn; a row has the medians of a call in microseconds,
and the median of the ratios of the turns. Needs: pip install numpy python-fcl
"""

import argparse
import statistics
import time

import fcl
import numpy as np

import snell


def ball(triangles: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed ball of radius 1 with dents and bumps."""
    around = max(4, round((triangles / 1.0) ** 0.5))
    down = max(3, around // 2)
    u = np.linspace(0, 2 * np.pi, around, endpoint=False)
    v = np.linspace(0, np.pi, down + 1)[1:-1]
    u, v = np.meshgrid(u, v, indexing="ij")
    rng = np.random.default_rng(seed)
    radius = 1 + sum(
        0.03 * np.sin(k * v + rng.uniform(0, 6)) * np.cos(k * u + rng.uniform(0, 6))
        for k in (3, 7, 17)
    )
    points = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1)
    rim = (radius[..., None] * points).reshape(-1, 3)
    vertices = np.concatenate([rim, [[0, 0, 1], [0, 0, -1]]])
    n = down - 1
    i, j = np.meshgrid(np.arange(around), np.arange(n - 1), indexing="ij")
    k = (i + 1) % around
    a, b, c, d = i * n + j, i * n + j + 1, k * n + j + 1, k * n + j
    i, top, bottom = np.arange(around), len(rim), len(rim) + 1
    k = (i + 1) % around
    faces = [
        np.stack([a, b, c], -1).reshape(-1, 3),
        np.stack([a, c, d], -1).reshape(-1, 3),
        np.stack([np.full(around, top), i * n, k * n], -1),
        np.stack([np.full(around, bottom), k * n + n - 1, i * n + n - 1], -1),
    ]
    return vertices, np.concatenate(faces)


def poses(count: int, gap: float, seed: int) -> np.ndarray:
    """Turned anyhow, at a distance of about 2 + gap from the origin."""
    rng = np.random.default_rng(seed)
    turns, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    turns *= np.sign(np.linalg.det(turns))[:, None, None]
    away = rng.normal(size=(count, 3))
    away *= (2.1 + gap) / np.linalg.norm(away, axis=1, keepdims=True)
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = turns, away
    return matrices


def model(vertices: np.ndarray, faces: np.ndarray) -> fcl.CollisionObject:
    made = fcl.BVHModel()
    made.beginModel(len(vertices), len(faces))
    made.addSubModel(vertices, faces)
    made.endModel()
    return fcl.CollisionObject(made, fcl.Transform())


def microseconds(calls: list) -> tuple[list, list]:
    times, answers = [], []
    for call in calls:
        start = time.perf_counter()
        answers.append(call())
        times.append(1e6 * (time.perf_counter() - start))
    return times, answers


def row(name: str, ours: list, theirs: list, turns: int = 3) -> None:
    """Both ways, turn by turn."""
    ratios, all_times = [], ([], [])
    for _ in range(turns):
        found = [microseconds(calls) for calls in (ours, theirs)]
        ratios.append(sum(found[1][0]) / sum(found[0][0]))
        for times, (taken, _) in zip(all_times, found, strict=True):
            times += taken
    a, b = (np.array(answers, dtype=float) for _, answers in found)
    different = np.abs(np.maximum(a, 0) - np.maximum(b, 0)).max()
    medians = [statistics.median(times) for times in all_times]
    print(
        f"| {name} | {medians[0]:.1f} | {medians[1]:.1f} | {statistics.median(ratios):.2f} "
        f"| {different:.2g} |",
        flush=True,
    )


def measure(triangles: int, count: int) -> None:
    (va, fa), (vb, fb) = ball(triangles, 0), ball(triangles, 1)
    a, b = snell.Scene(), snell.Scene()
    a.add_mesh(va, fa)
    b.add_mesh(vb, fb)
    start = time.perf_counter()
    snell.closest_pair(a, b)
    built = time.perf_counter() - start
    start = time.perf_counter()
    x, y = model(va, fa), model(vb, fb)
    print(
        f"| {len(fa)} triangles, build in s | {built:.3g} | {time.perf_counter() - start:.3g} |||"
    )
    for name, gap in [("far", 4.0), ("near", 0.02), ("meeting", -0.15), ("deep", -1.0)]:
        matrices = poses(count, gap, 2)
        placed = [fcl.Transform(m[:3, :3], m[:3, 3]) for m in matrices]

        def distance(m):
            return snell.closest_pair(a, b, transform_a=m, threads=1).distance

        def fcl_distance(transform):
            x.setTransform(transform)
            return fcl.distance(x, y, fcl.DistanceRequest(), fcl.DistanceResult())

        def collides(m):
            return snell.collides(a, b, transform_a=m, threads=1)

        def fcl_collides(transform):
            x.setTransform(transform)
            return fcl.collide(x, y, fcl.CollisionRequest(), fcl.CollisionResult()) > 0

        # FCL's distance of meshes that meet is that of any pair.
        if gap >= 0:
            row(
                f"{name}, distance",
                [lambda m=m: distance(m) for m in matrices],
                [lambda t=t: fcl_distance(t) for t in placed],
            )
        row(
            f"{name}, collides",
            [lambda m=m: collides(m) for m in matrices],
            [lambda t=t: fcl_collides(t) for t in placed],
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("triangles", type=int, nargs="*", default=[5_000, 50_000, 300_000])
    parser.add_argument("--poses", type=int, default=50)
    given = parser.parse_args()
    print("| case | Snell, us | python-fcl, us | ratio | largest difference |")
    print("|---|---|---|---|---|")
    for triangles in given.triangles:
        measure(triangles, given.poses)


if __name__ == "__main__":
    main()
