"""Snell, trimesh and Open3D on the same meshes and rays: do they find the same?

    pip install . open3d trimesh embreex rtree scipy
    python bench/python_agreement.py [MESH...] [--rays 500000] [--exact 2000] [--json]

Without meshes: twenty made here, closed and open, smooth and sharp, tiny and at large coordinates.
For each mesh, `--rays` random rays through its box go to Snell (float32) and Open3D: nearest hits,
occlusions, counts and (of 100,000) lists of hits; and points to both, for distances, nearest points
and, of closed meshes, insides and signed distances. `--exact` of the rays go, in float64, to Snell
and trimesh's own exact path, with the same questions. Counts: rays that one side hits and the other
does not, other numbers of crossings, and distances that differ by more than 1e-4 (trimesh: 1e-6) of
the size of the mesh. A hundred of the rays that are counted differently are judged in float64
(`--no-truth` leaves that out): a side is wrong if its number is not one that rounding allows, or,
for a closed mesh, is odd where it must be even.

The aimed probe: a closed sphere of 100 by 200 squares, and rays from six inner points to all of its
vertices and middles of edges. Every one must be hit, and cross exactly once.
"""

from __future__ import annotations

import argparse
import json
import pathlib

import numpy as np

import snell

try:
    import open3d as o3d
except ImportError:
    o3d = None
try:
    import trimesh
except ImportError:
    trimesh = None


def sphere(rows: int, columns: int, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A closed sphere around the y axis."""
    theta = np.linspace(0, np.pi, rows + 1)[1:-1]
    phi = np.arange(columns) * (2 * np.pi / columns)
    ring = np.stack(
        [
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), np.ones(columns)),
            np.outer(np.sin(theta), np.cos(phi)),
        ],
        axis=-1,
    )
    vertices = np.concatenate([[[0, 1, 0]], ring.reshape(-1, 3), [[0, -1, 0]]]) * radius
    at = lambda i, j: 1 + i * columns + j % columns  # noqa: E731
    j = np.arange(columns)
    faces = [
        np.stack([np.zeros_like(j), at(0, j), at(0, j + 1)], -1),
        np.stack([np.full_like(j, len(vertices) - 1), at(rows - 2, j + 1), at(rows - 2, j)], -1),
    ]
    for i in range(rows - 2):
        faces += [
            np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], -1),
            np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], -1),
        ]
    return vertices, np.concatenate(faces)


def grid(n: int, height) -> tuple[np.ndarray, np.ndarray]:
    """A height field over the unit square."""
    x, z = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    vertices = np.stack([x, height(x, z), z], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij"))
    quads = np.stack([i * n + j, i * n + j + 1, (i + 1) * n + j + 1, (i + 1) * n + j], axis=-1)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def torus(n: int, m: int, r: float) -> tuple[np.ndarray, np.ndarray]:
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    vertices = np.stack(
        [(1 + r * np.cos(v)) * np.cos(u), r * np.sin(v), (1 + r * np.cos(v)) * np.sin(u)], axis=-1
    ).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    at = lambda i, j: i % n * m + j % m  # noqa: E731
    quads = np.stack([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)], axis=-1)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def soup(n: int, size: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    vertices = (rng.uniform(-1, 1, (n, 1, 3)) + size * rng.normal(size=(n, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(3 * n).reshape(-1, 3)


def cubes(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Cubes in a lattice: rays along edges and through corners are common."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = np.array(
        [
            [0, 1, 3],
            [0, 3, 2],
            [4, 6, 7],
            [4, 7, 5],
            [0, 4, 5],
            [0, 5, 1],
            [2, 3, 7],
            [2, 7, 6],
            [0, 2, 6],
            [0, 6, 4],
            [1, 5, 7],
            [1, 7, 3],
        ]
    )
    places = 2 * np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(
        -1, 1, 3
    )
    return (corners + places).reshape(-1, 3), (
        faces + 8 * np.arange(len(places))[:, None, None]
    ).reshape(-1, 3)


def meshes() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(1)
    noise = rng.uniform(-1, 1, (64, 64))
    squeeze = lambda mesh, scale: (mesh[0] * scale, mesh[1])  # noqa: E731
    return {
        "sphere 8x12": sphere(8, 12),
        "sphere 100x200": sphere(100, 200),
        "sphere 400x800": sphere(400, 800),
        "sphere, flat": squeeze(sphere(50, 100), [1, 0.01, 1]),
        "sphere, tiny": squeeze(sphere(50, 100), 1e-4),
        "sphere, huge": squeeze(sphere(50, 100), 1e5),
        "torus 60x30": torus(60, 30, 0.4),
        "torus 400x200": torus(400, 200, 0.4),
        "torus, thin": torus(300, 12, 0.02),
        "plane": grid(2, lambda x, z: 0 * x),
        "plane of 4096": grid(46, lambda x, z: 0 * x),
        "waves": grid(128, lambda x, z: 0.1 * np.sin(20 * x) * np.cos(15 * z)),
        "terrain": grid(64, lambda x, z: 0.2 * noise),
        "steps": grid(64, lambda x, z: 0.1 * np.floor(8 * x)),
        "cube": cubes(1),
        "cubes 4x4x4": cubes(4),
        "cubes 12x12x12": cubes(12),
        "soup of 1000": soup(1000, 0.2, rng),
        "soup of 50000": soup(50_000, 0.02, rng),
        "needles": squeeze(soup(5000, 0.3, rng), [1, 0.001, 1]),
    }


def random_rays(vertices: np.ndarray, n: int, rng: np.random.Generator) -> np.ndarray:
    """Rays from around the box of a mesh to points in it; a tenth of them goes exactly to vertices,
    a tenth along axes.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = np.maximum(high - low, 1e-3 * (high - low).max())
    origins = (low + high) / 2 + size * rng.uniform(-2, 2, (n, 3))
    targets = low + size * rng.uniform(0, 1, (n, 3))
    directions = targets - origins
    tenth = n // 10
    directions[:tenth] = vertices[rng.integers(len(vertices), size=tenth)] - origins[:tenth]
    directions[tenth : 2 * tenth] = np.eye(3)[rng.integers(3, size=tenth)] * rng.choice(
        [-1, 1], (tenth, 1)
    )
    return np.concatenate([origins, directions], axis=1)


# Coordinates relative to the origin of a ray are rounded: by this share of the largest.
ROUNDING = {np.dtype(np.float32): 4e-7, np.dtype(np.float64): 1e-14}


def crossings(ray: np.ndarray, triangles: np.ndarray, rounding: float) -> tuple[int, int]:
    """How many triangles a ray crosses for certain, and how many more it may cross, because it
    passes so near to an edge that rounding may decide.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    o, d = ray[:3], ray[3:]
    margin = rounding * max(np.abs(triangles).max(), np.abs(o).max())
    with np.errstate(divide="ignore", invalid="ignore"):
        t0, t1 = (low - margin - o) / d, (high + margin - o) / d
    inside = (o >= low - margin) & (o <= high + margin)
    first = np.where(d == 0, np.where(inside, -np.inf, np.inf), np.minimum(t0, t1)).max(axis=1)
    last = np.where(d == 0, np.where(inside, np.inf, -np.inf), np.maximum(t0, t1)).min(axis=1)
    a, b, c = np.moveaxis(triangles[(first <= last) & (last >= 0)] - o, 1, 0)
    u, v, w = (np.cross(x, y) @ d for x, y in ((c, b), (a, c), (b, a)))
    total = u + v + w
    normal = np.cross(b - a, c - a)
    longest = np.max([np.linalg.norm(x, axis=1) for x in (b - a, c - b, a - c)], axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.min([u / total, v / total, w / total], axis=0)
        # How much a barycentric coordinate changes if a corner moves by the margin, seen along the
        # ray.
        doubt = 2 * margin * longest * np.linalg.norm(d) / np.abs(total)
        t = (normal * a).sum(axis=1) / (normal @ d)
        near_plane = np.abs((normal * a).sum(axis=1)) <= 2 * margin * np.linalg.norm(normal, axis=1)
    is_out = (least < -doubt) | ((t < 0) & ~near_plane)
    certain = (least > doubt) & (t > 0) & ~near_plane
    return int(certain.sum()), int((~is_out & ~certain).sum())


def truth(
    rays, triangles, ours, theirs, is_closed: bool, dtype: type, most: int = 100
) -> dict[str, int]:
    """Of rays with other numbers of crossings: who counts more or fewer than rounding explains, or
    through a closed mesh an odd number too many.
    """
    found = {"judged": 0, "near_edges": 0, "snell_wrong": 0, "other_wrong": 0}
    rng = np.random.default_rng(5)
    rounding = ROUNDING[np.dtype(dtype)]
    for ray, mine, other in list(zip(rays, ours.astype(int), theirs.astype(int), strict=True))[
        :most
    ]:
        certain, more = crossings(ray, triangles, rounding)
        allowed = range(certain, certain + more + 1)
        if is_closed:
            # Whether the ray begins inside, by another one from there that passes no edge.
            for _ in range(20):
                count, doubt = crossings(
                    np.concatenate([ray[:3], rng.normal(size=3)]), triangles, rounding
                )
                if doubt == 0:
                    allowed = [n for n in allowed if n % 2 == count % 2]
                    break
        found["judged"] += 1
        found["near_edges"] += more > 0
        found["snell_wrong"] += mine not in allowed
        found["other_wrong"] += other not in allowed
    return found


def compare_with_open3d(vertices, faces, rays, judge: bool, is_closed: bool) -> dict:
    vertices, rays = vertices.astype(np.float32), rays.astype(np.float32)
    ours = snell.Scene()
    ours.add_mesh(vertices, faces)
    theirs = o3d.t.geometry.RaycastingScene()
    theirs.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(faces.astype(np.uint32)))
    tensor = o3d.core.Tensor(rays)
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    a, b = ours.cast_rays(rays).t_hit, theirs.cast_rays(tensor)["t_hit"].numpy()
    hit = np.isfinite(a), np.isfinite(b)
    both = hit[0] & hit[1]
    apart = np.abs(a[both] - b[both]) * np.linalg.norm(rays[both, 3:], axis=1) > 1e-4 * size
    blocked = ours.test_occlusions(rays), theirs.test_occlusions(tensor).numpy()
    counts = ours.count_intersections(rays), theirs.count_intersections(tensor).numpy()
    listed = ours.list_intersections(rays)
    other = counts[0] != counts[1]
    row = {
        "only_snell_hits": int((hit[0] & ~hit[1]).sum()),
        "only_open3d_hits": int((hit[1] & ~hit[0]).sum()),
        "distances_apart": int(apart.sum()),
        "occlusions_differ": int((blocked[0] != blocked[1]).sum()),
        "counts_differ": int(other.sum()),
        "snell_differs_from_itself": int(
            (blocked[0] != hit[0]).sum() + (np.diff(listed.ray_splits) != counts[0]).sum()
        ),
    }
    if judge and other.any():
        triangles = vertices.astype(np.float64)[faces]
        row |= truth(
            rays[other].astype(np.float64),
            triangles,
            counts[0][other],
            counts[1][other],
            is_closed,
            np.float32,
        )
    row |= compare_lists(ours, theirs, rays[:100_000], size)
    points = np.ascontiguousarray(
        (rays[:2000, :3] + rays[:2000, :3].mean(axis=0)) * np.float32(0.5)
    )
    tensor = o3d.core.Tensor(points)
    near_us, near_them = ours.distance(points), theirs.compute_distance(tensor).numpy()
    row["distances_of_points_apart"] = int((np.abs(near_us - near_them) > 1e-4 * size).sum())
    closest = (
        ours.closest_points(points).points,
        theirs.compute_closest_points(tensor)["points"].numpy(),
    )
    # Two points may be equally near: each must be as near as the other.
    far = [np.linalg.norm(points - c, axis=1) for c in closest]
    row["closest_points_apart"] = int((np.abs(far[0] - far[1]) > 1e-4 * size).sum())
    if is_closed:
        inside = ours.occupancy(points), theirs.compute_occupancy(tensor).numpy() > 0
        row["occupancies_differ"] = int((inside[0] != inside[1]).sum())
        signed = ours.signed_distance(points), theirs.compute_signed_distance(tensor).numpy()
        row["signed_distances_apart"] = int((np.abs(signed[0] - signed[1]) > 1e-4 * size).sum())
    return row


def compare_lists(ours, theirs, rays, size) -> dict[str, int]:
    """All hits of each ray, where both sides have as many."""
    mine, other = ours.list_intersections(rays), theirs.list_intersections(o3d.core.Tensor(rays))
    splits, t = other["ray_splits"].numpy(), other["t_hit"].numpy()
    counts = np.diff(mine.ray_splits), np.diff(splits)
    same = np.flatnonzero(counts[0] == counts[1])
    lengths = np.linalg.norm(rays[:, 3:], axis=1)
    apart = 0
    for i in same[counts[0][same] > 0]:
        a, b = (
            mine.t_hit[mine.ray_splits[i] : mine.ray_splits[i + 1]],
            np.sort(t[splits[i] : splits[i + 1]]),
        )
        apart += bool((np.abs(a - b) * lengths[i] > 1e-4 * size).any())
    return {"lists_apart": apart}


def compare_with_trimesh(vertices, faces, rays, judge: bool, is_closed: bool) -> dict:
    mesh = trimesh.Trimesh(vertices, faces, process=False, validate=False)
    exact = trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    ours = snell.Scene()
    ours.add_mesh(vertices, faces)
    origins, directions = rays[:, :3], rays[:, 3:]
    first = ours.cast_rays((origins, directions))
    theirs = exact.intersects_first(origins, directions)
    hit = np.isfinite(first.t_hit), theirs >= 0
    other = hit[0] & hit[1] & (first.primitive_ids.astype(np.int64) != theirs)
    # Another triangle is no difference if it is as far.
    places, index, _ = exact.intersects_location(origins, directions, multiple_hits=False)
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    distance = np.full(len(rays), np.inf)
    np.minimum.at(distance, index, np.linalg.norm(places - origins[index], axis=1))
    mine = first.t_hit * np.linalg.norm(directions, axis=1)
    with np.errstate(invalid="ignore"):
        apart = hit[0] & hit[1] & ~(np.abs(mine - distance) <= 1e-6 * size)
    row = {
        "only_snell_hits": int((hit[0] & ~hit[1]).sum()),
        "only_trimesh_hits": int((hit[1] & ~hit[0]).sum()),
        "other_triangle": int(other.sum()),
        "distances_apart": int(apart.sum()),
    }
    blocked = ours.test_occlusions((origins, directions)), exact.intersects_any(origins, directions)
    row["occlusions_differ"] = int((blocked[0] != blocked[1]).sum())
    places, index, _ = exact.intersects_location(origins, directions, multiple_hits=True)
    index = np.asarray(index, dtype=np.int64)
    along = (np.reshape(places, (-1, 3)) - origins[index]) * directions[index]
    theirs_t = along.sum(axis=1) / (directions[index] ** 2).sum(axis=1)
    counts = (
        ours.count_intersections((origins, directions)),
        np.bincount(index, minlength=len(rays)),
    )
    other = counts[0] != counts[1]
    row["counts_differ"] = int(other.sum())
    listed = ours.list_intersections((origins, directions))
    order = np.lexsort((theirs_t, index))
    same_mine, same_theirs = ~other[listed.ray_ids], ~other[index[order]]
    lengths = np.linalg.norm(directions, axis=1)[listed.ray_ids[same_mine]]
    row["lists_apart"] = int(
        (
            np.abs(listed.t_hit[same_mine] - theirs_t[order][same_theirs]) * lengths > 1e-6 * size
        ).sum()
    )
    if judge and other.any():
        row |= truth(
            rays[other], vertices[faces], counts[0][other], counts[1][other], is_closed, np.float64
        )
    points = (origins[:300] + origins[:300].mean(axis=0)) * 0.5
    _, far, _ = trimesh.proximity.closest_point(mesh, points)
    near = ours.distance(points)
    apart = np.abs(near - far) > 1e-6 * size
    row["distances_of_points_apart"] = int(apart.sum())
    if apart.any():
        # Nobody can be nearer than the nearest; who is farther is wrong.
        row["of_these_trimesh_is_farther"] = int((far[apart] > near[apart]).sum())
    if is_closed:
        inside = exact.contains_points(points)
        row["occupancies_differ"] = int((ours.occupancy(points) != inside).sum())
    return row


def probe() -> list[dict]:
    """The aimed rays."""
    rows = []
    inner = np.array(
        [
            [0, 0, 0],
            [0.5, 0.2, -0.3],
            [-0.9, 0.4, 0.1],
            [0.1, -1.1, 0.6],
            [1.2, 0.3, 0.8],
            [-0.2, 0.7, -1.2],
        ]
    )
    for place in ([0, 0, 0], [148376, 1234, -223423]):
        vertices, faces = sphere(100, 200, 2.0)
        vertices = vertices + place
        # Each edge from both of its faces.
        edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        for dtype in (np.float64, np.float32):
            used = vertices.astype(dtype)
            targets = np.concatenate([used, (used[edges[:, 0]] + used[edges[:, 1]]) / 2])
            origins = (inner + place).astype(dtype)
            rays = (
                np.concatenate(
                    [
                        np.broadcast_to(origins[:, None], (6, len(targets), 3)),
                        targets - origins[:, None],
                    ],
                    axis=-1,
                )
                .astype(dtype)
                .reshape(-1, 6)
            )
            scene = snell.Scene()
            scene.add_mesh(used, faces)
            row = {"at": place, "dtype": np.dtype(dtype).name, "rays": len(rays)}
            row["snell_misses"] = int(np.isinf(scene.cast_rays(rays).t_hit).sum())
            row["snell_miscounts"] = int((scene.count_intersections(rays) != 1).sum())
            if o3d is not None and dtype == np.float32:
                other = o3d.t.geometry.RaycastingScene()
                other.add_triangles(o3d.core.Tensor(used), o3d.core.Tensor(faces.astype(np.uint32)))
                row["open3d_misses"] = int(
                    np.isinf(other.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()).sum()
                )
                row["open3d_miscounts"] = int(
                    (other.count_intersections(o3d.core.Tensor(rays)).numpy() != 1).sum()
                )
            rows.append(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("meshes", nargs="*", type=pathlib.Path)
    parser.add_argument("--rays", type=int, default=500_000)
    parser.add_argument("--exact", type=int, default=2000)
    parser.add_argument("--no-truth", action="store_true")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    all_meshes = meshes()
    for path in options.meshes:
        loaded = trimesh.load(path, force="mesh")
        all_meshes[path.stem] = np.asarray(loaded.vertices), np.asarray(loaded.faces)
    show = (
        (lambda row: print(json.dumps(row), flush=True))
        if options.json
        else (lambda row: print(*(f"{k}={v}" for k, v in row.items()), flush=True))
    )
    for number, (name, (vertices, faces)) in enumerate(all_meshes.items()):
        rays = random_rays(vertices, options.rays, np.random.default_rng(number))
        about = {"mesh": name, "triangles": len(faces), "rays": len(rays)}
        is_closed = name.startswith(("sphere", "torus", "cube"))
        if o3d is not None:
            show(
                about
                | {"peer": "open3d"}
                | compare_with_open3d(vertices, faces, rays, not options.no_truth, is_closed)
            )
        # Its own exact path takes hours on large meshes.
        if trimesh is not None and len(faces) <= 50_000:
            few = rays[np.linspace(0, len(rays) - 1, options.exact).astype(int)]
            show(
                about
                | {"peer": "trimesh", "rays": len(few)}
                | compare_with_trimesh(vertices, faces, few, not options.no_truth, is_closed)
            )
    for row in probe():
        show({"probe": "aimed rays"} | row)


if __name__ == "__main__":
    main()
