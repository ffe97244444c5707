"""Heightfields: the same hits as the mesh of their triangles, at a fraction of time and memory."""

from __future__ import annotations

import pathlib
import pickle
import warnings
from typing import Any, NamedTuple

import numpy as np
import pytest

import snell

NORTH_UP = np.array([[10, 0, 448000], [0, -10, 5412000.0]])


class Affine(NamedTuple):
    """What the class of ``affine`` and rasterio is like."""

    a: float
    b: float
    c: float
    d: float
    e: float
    f: float
    g: float = 0.0
    h: float = 0.0
    i: float = 1.0


def raster(seed: int, rows: int, columns: int, holes: float = 0.1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:rows, :columns]
    z = 30 * np.sin(row / 9) * np.cos(column / 7) + rng.uniform(-4, 4, (rows, columns))
    z[rng.uniform(size=z.shape) < holes] = np.nan
    return z


def triangles(z: np.ndarray, transform: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, faces and their numbers, written as in the documentation."""
    rows, columns = z.shape
    row, column = np.mgrid[:rows, :columns]
    (a, b, c), (d, e, f) = transform.tolist()
    x = a * (column + 0.5) + b * (row + 0.5) + c
    y = d * (column + 0.5) + e * (row + 0.5) + f
    at = (row * columns + column)[:-1, :-1].ravel()
    nodes = np.stack([at, at + 1, at + columns, at + columns + 1], axis=-1)
    mirrored = a * e - b * d < 0
    first, second = ([0, 2, 3], [0, 3, 1]) if mirrored else ([0, 3, 2], [0, 1, 3])
    faces = np.stack([nodes[:, first], nodes[:, second]], axis=1).reshape(-1, 3)
    known = np.isfinite(z).ravel()
    numbers = np.flatnonzero(np.repeat(known[nodes].all(axis=1), 2))
    vertices = np.stack([x, y, np.nan_to_num(z)], axis=-1).reshape(-1, 3)
    return vertices, faces[numbers], numbers


def both(
    z: np.ndarray, transform: np.ndarray, **options: Any
) -> tuple[snell.Scene, snell.Scene, np.ndarray]:
    ours, theirs = snell.Scene(), snell.Scene()
    ours.add_heightfield(z, transform, **options)
    vertices, faces, numbers = triangles(z, transform)
    theirs.add_mesh(vertices, faces)
    return ours, theirs, np.append(numbers, 0).astype(np.uint32)


def rays_at(scene: snell.Scene, seed: int, count: int = 4000) -> np.ndarray:
    """Rays of all directions, down, and along the ground."""
    rng = np.random.default_rng(seed)
    low, high = scene.bounds
    size = np.maximum(high - low, 1)
    origins = low + rng.uniform(-0.5, 1.5, (count, 3)) * size
    directions = low + rng.uniform(0, 1, (count, 3)) * size - origins
    origins[::3, 2] = high[2] + 100
    directions[::3] = [0, 0, -1]
    directions[1::3, 2] *= 0.01
    return np.concatenate([origins, directions], axis=1)


def turned(angle: float, cell: float, x: float, y: float) -> np.ndarray:
    c, s = cell * np.cos(angle), cell * np.sin(angle)
    return np.array([[c, s, x], [s, -c, y]])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rays_hit_what_they_hit_of_the_mesh(seed: int, dtype: type) -> None:
    far = seed % 2 == 1 and dtype is np.float64
    transform = turned(seed, [1, 25, 0.25][seed % 3], *((448262.3, 5411932.7) if far else (3, 4)))
    if seed % 4 == 3:
        transform[:, 1] *= -1
    z = raster(seed, 17 + 5 * seed, 60 - 6 * seed, 0 if seed == 5 else 0.1)
    ours, theirs, numbers = both(z, transform)
    used = theirs.mesh(0).vertices[np.unique(theirs.mesh(0).faces)]
    np.testing.assert_array_equal(ours.bounds, [used.min(axis=0), used.max(axis=0)])
    rays = rays_at(ours, seed).astype(dtype)
    a, b = ours.cast_rays(rays), theirs.cast_rays(rays)
    hit = np.isfinite(b.t_hit)
    assert 0.1 < hit.mean() < 0.95
    np.testing.assert_array_equal(a.t_hit, b.t_hit)
    np.testing.assert_array_equal(a.primitive_ids[hit], numbers[b.primitive_ids[hit]])
    np.testing.assert_array_equal(a.primitive_uvs, b.primitive_uvs)
    np.testing.assert_array_equal(a.points, b.points)
    np.testing.assert_array_equal(a.primitive_normals, b.primitive_normals)
    assert (a.primitive_normals[hit, 2] > 0).all()
    np.testing.assert_array_equal(ours.test_occlusions(rays), hit)
    np.testing.assert_array_equal(
        ours.count_intersections(rays, mask=1), theirs.count_intersections(rays)
    )
    a, b = ours.list_intersections(rays), theirs.list_intersections(rays)
    np.testing.assert_array_equal(a.t_hit, b.t_hit)
    np.testing.assert_array_equal(a.primitive_ids, numbers[b.primitive_ids])
    points = rays[:300, :3]
    a, b = ours.closest_points(points), theirs.closest_points(points)
    np.testing.assert_array_equal(a.distances, b.distances)
    np.testing.assert_array_equal(a.points, b.points)
    np.testing.assert_array_equal(a.primitive_ids, numbers[b.primitive_ids])
    assert not ours.occupancy(points).any(), "a sheet has no inside"
    assert (ours.signed_distance(points) >= 0).all()


@pytest.mark.parametrize(
    "given",
    [
        NORTH_UP,
        NORTH_UP.tolist(),
        np.vstack([NORTH_UP, [0, 0, 1]]),
        Affine(*NORTH_UP.ravel().tolist()),
        [[10, 0, 0, 448000], [0, -10, 0, 5412000], [0, 0, 1, 0], [0, 0, 0, 1]],
        [[10, 0, 0, 448000], [0, -10, 0, 5412000], [0, 0, 1, 0]],
    ],
)
def test_heights_are_at_the_centres_of_pixels(given: Any) -> None:
    z = np.arange(12.0).reshape(3, 4)
    scene = snell.Scene()
    scene.add_heightfield(z, given)
    for row in range(3):
        for column in range(4):
            x, y = 448005 + 10 * column, 5411995 - 10 * row
            assert scene.distance([x, y, z[row, column]]) < 1e-9
    np.testing.assert_allclose(scene.bounds, [[448005, 5411975, 0], [448035, 5411995, 11]])


def test_a_whole_affine_of_rasterio_is_read() -> None:
    affine = pytest.importorskip("affine")
    scene = snell.Scene()
    scene.add_heightfield(np.zeros((3, 4)), affine.Affine.from_gdal(448000, 10, 0, 5412000, 0, -10))
    np.testing.assert_allclose(scene.bounds, [[448005, 5411975, 0], [448035, 5411995, 0]])


def test_numbers_of_triangles_count_holes() -> None:
    z = np.zeros((3, 4))
    z[0, 0] = np.nan
    scene = snell.Scene()
    field = scene.add_heightfield(z)
    rays = [
        [c + 0.5 + u, r + 0.5 + v, 5, 0, 0, -1]
        for r in range(2)
        for c in range(3)
        for u, v in ((0.2, 0.6), (0.6, 0.2))
    ]
    found = scene.cast_rays(rays)
    assert found.primitive_ids.tolist()[2:] == list(range(2, 12))
    assert np.isinf(found.t_hit[:2]).all()
    np.testing.assert_allclose(found.uvs[2], [1.7 / 4, 1.1 / 3])
    vertices, faces = scene.mesh(field)
    assert len(vertices) == 11 and len(faces) == 10
    assert scene.statistics()["triangles"] == 10


@pytest.mark.parametrize(
    "dtype", ["f2", "f4", "f8", "i1", "u1", "i2", "u2", "i4", "u4", "i8", ">f4", ">i2"]
)
def test_rasters_of_any_numbers(dtype: str) -> None:
    z = np.arange(20).reshape(4, 5).astype(dtype)
    scene = snell.Scene()
    scene.add_heightfield(z)
    at = np.array([[c + 0.5, r + 0.5, 0] for r in range(4) for c in range(5)])
    np.testing.assert_allclose(scene.distance(at + [0, 0, 1] * z.reshape(-1, 1).astype(float)), 0)
    scene.add_heightfield(z[::-1, ::2])
    scene.add_heightfield(np.asfortranarray(z))


def test_masked_elements_are_no_data() -> None:
    z = np.ma.masked_equal(np.array([[1, 2, 3], [4, -9999, 6], [7, 8, 9], [1, 2, 3]], "i2"), -9999)
    scene = snell.Scene()
    field = scene.add_heightfield(z)
    assert scene.bounds[0, 2] == 1
    assert len(scene.mesh(field).faces) == 4
    scene.add_heightfield(np.ma.masked_array(np.ones((2, 2))))


def test_objects_are_placed_masked_moved_and_pickled(tmp_path: pathlib.Path) -> None:
    z = raster(3, 20, 30)
    ours, theirs, _ = both(z, NORTH_UP, mask=2, name="ground")
    theirs.update_mask(0, 2)
    rays = rays_at(ours, 1)
    assert not ours.test_occlusions(rays, mask=1).any()

    def check() -> None:
        np.testing.assert_array_equal(ours.cast_rays(rays).t_hit, theirs.cast_rays(rays).t_hit)

    check()
    ours = pickle.loads(pickle.dumps(ours))
    assert ours.names == {0: "ground"}
    check()
    move = np.eye(4)
    move[:3, 3] = [30, -20, 5]
    for scene in (ours, theirs):
        scene.update_transform(0, move)
    check()
    again = raster(4, 20, 30)
    ours.update_heights(0, again)
    theirs.remove(0)
    vertices, faces, _ = triangles(again, NORTH_UP)
    theirs.add_mesh(vertices, faces, move)
    check()
    a, b = snell.Scene(), snell.Scene()
    a.add_instance(ours, move)
    b.add_instance(theirs, move)
    np.testing.assert_array_equal(a.cast_rays(rays).t_hit, b.cast_rays(rays).t_hit)
    for ending in ("snell", "obj", "ply", "glb"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", snell.SceneWarning)  # Masks are left out.
            ours.save(tmp_path / f"ground.{ending}")
        back = snell.load(tmp_path / f"ground.{ending}")
        np.testing.assert_allclose(back.bounds, ours.bounds, atol=1e-5)
    assert "1 heightfields" in repr(ours)


def test_smooth_normals_are_those_of_the_slopes() -> None:
    row, column = np.mgrid[:20, :30]
    z = 0.5 * (column + 0.5) - 0.25 * (row + 0.5)
    scene = snell.Scene()
    scene.add_heightfield(z + 0.001 * np.random.default_rng(1).normal(size=z.shape), smooth=True)
    hits = scene.cast_rays(([[7.3, 8.1, 50], [0.7, 0.8, 50]], [0, 0, -1]))
    expected = np.array([-0.5, 0.25, 1]) / np.linalg.norm([-0.5, 0.25, 1])
    np.testing.assert_allclose(hits.normals, [expected] * 2, atol=0.01)
    assert (hits.normals != hits.primitive_normals).any()


def test_pictures_have_the_layers_of_the_mesh() -> None:
    z = raster(2, 25, 40)
    pictures = []
    numbers = np.array([])
    for kind in ("heightfield", "mesh"):
        scene = snell.Scene()
        scene.add_shape("sphere", radius=1)
        if kind == "heightfield":
            scene.add_heightfield(z, NORTH_UP)
        else:
            vertices, faces, numbers = triangles(z, NORTH_UP)
            scene.add_mesh(vertices, faces)
        scene.remove(0)
        camera = snell.Camera(eye=(448200, 5411700, 300), target=(448200, 5411880, 0), up=(0, 0, 1))
        pictures.append(
            snell.render(
                scene,
                camera=camera,
                size=(48, 32),
                spp=1,
                integrator="flat",
                filter="box",
                aovs=["depth", "geometry-id", "primitive-id"],
            )
        )
    ours, theirs = pictures
    assert (ours.aovs["geometry-id"] >= 0).any()
    np.testing.assert_array_equal(ours.aovs["depth"], theirs.aovs["depth"])
    ids = theirs.aovs["primitive-id"].astype(int)
    expected = np.where(ids >= 0, numbers[ids], -1)
    np.testing.assert_array_equal(ours.aovs["primitive-id"], expected)


def test_a_large_raster_is_built_fast_and_small() -> None:
    z = raster(1, 600, 500, 0).astype(np.float32)
    ours, theirs, _ = both(z, NORTH_UP)
    ours.commit()
    theirs.commit()
    small, large = (scene.statistics()["memory_bytes"] for scene in (ours, theirs))
    assert small < large / 20
    assert ours.statistics()["triangles"] == theirs.statistics()["triangles"] == 2 * 599 * 499


@pytest.mark.parametrize(
    ("z", "transform", "message"),
    [
        (np.zeros((1, 5)), None, "z: there are 1 rows and 5 columns, expected at least 2 of each"),
        (np.zeros(5), None, r"z: shape is \(5,\), expected \(rows, columns\)"),
        (np.zeros((1, 5, 5)), None, r"z: shape is \(1, 5, 5\), .*; give z\[0\], the only band"),
        (np.zeros((3, 5, 5)), None, r"give one band, such as z\[0\]"),
        (np.array([[0, 1], [np.inf, 1]]), None, r"z\[1, 0\] is inf, expected a finite number, or"),
        (np.zeros((2, 2), bool), None, "z: dtype is bool, expected real numbers"),
        (np.zeros((2, 2), complex), None, "z: dtype is complex128, expected real numbers"),
        (np.zeros((2, 2)), (1, 0, 0, 0, 1, 0), "six numbers are in GDAL's order or in affine's"),
        (np.zeros((2, 2)), np.zeros((2, 2)), r"transform: shape is \(2, 2\), expected an Affine"),
        (np.zeros((2, 2)), [[1, 0, 0], [2, 0, 0]], "transform is singular"),
        (np.zeros((2, 2)), [[1, 0, 0], [0, np.nan, 0]], r"transform\[1, 1\] is NaN"),
        (np.zeros((2, 2)), np.ones((3, 3)), r"transform\[2\] is \[1.0, 1.0, 1.0\], expected"),
    ],
)
def test_what_is_wrong_is_told(z: Any, transform: Any, message: str) -> None:
    scene = snell.Scene()
    with pytest.raises((ValueError, TypeError), match=message):
        scene.add_heightfield(z, transform)
    assert len(scene) == 0


def test_wrong_changes_are_told() -> None:
    scene = snell.Scene()
    field = scene.add_heightfield(np.zeros((3, 4)))
    ball = scene.add_shape("sphere", radius=1)
    with pytest.raises(ValueError, match=r"z: shape is \(4, 3\), expected \(3, 4\) as before"):
        scene.update_heights(field, np.zeros((4, 3)))
    with pytest.raises(TypeError, match="id 1 is not a heightfield"):
        scene.update_heights(ball, np.zeros((3, 4)))
    with pytest.raises(TypeError, match=r"update_heights\(id, z\) changes it"):
        scene.update_vertices(field, np.zeros((12, 3)))
    all_gone = scene.add_heightfield(np.full((3, 4), np.nan))
    assert len(scene.mesh(all_gone).faces) == 0
    assert scene.cast_rays([2, 2, 10, 0, 0, -1]).t_hit == 10


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("turn", [0, 1])
def test_a_closed_border_is_hit_at_its_own_nodes(rng, dtype, turn) -> None:
    far = [0, 0] if dtype == np.float32 else [448262, 5411932]
    rows, columns = 9, 12
    z = rng.integers(0, 8, (rows, columns)).astype(float)
    z[3, 4] = z[6, 11] = np.nan
    affine = np.array(
        [[[2, 0, far[0]], [0, -4, far[1]]], [[0, 4, far[0]], [2, 0, far[1]]]][turn], float
    )
    row, column = np.mgrid[:rows, :columns]
    nodes = np.stack([column + 0.5, row + 0.5, np.ones_like(row)], axis=-1) @ affine.T
    is_there = ~np.isnan(z)
    above = np.dstack([nodes, np.full_like(z, 50)])[is_there].astype(dtype)
    down = np.broadcast_to(np.array([0, 0, -1], dtype), above.shape)
    # Edges of the border between their nodes, in the middle.
    first, last = above[: columns - 1], above[1:columns]
    between = ((first + last) / 2).astype(dtype)
    found = {}
    for edges in ("open", "closed"):
        scene = snell.Scene()
        scene.add_heightfield(z, affine, edges=edges)
        for made in (scene, pickle.loads(pickle.dumps(scene))):
            hits = made.cast_rays((above, down))
            found[edges] = hits.is_hit
            t = hits.t_hit[hits.is_hit]
            assert (t == 50 - z[is_there][hits.is_hit]).all()
            assert (made.test_occlusions((above, down)) == hits.is_hit).all()
            counts = made.count_intersections((above, down))
            assert (counts[~hits.is_hit] == 0).all() and counts.max() <= 2
        single = np.array([scene.test_occlusions((o, d)) for o, d in zip(above, down, strict=True)])
        assert (single == found[edges]).all()
        assert scene.test_occlusions((between, down[: columns - 1])).all() or edges == "open"
    assert found["closed"].all() and not found["open"].all()
    # Elsewhere nothing changes.
    opened, closed = snell.Scene(), snell.Scene()
    opened.add_heightfield(z, affine)
    closed.add_heightfield(z, affine, edges="closed")
    center = above.mean(axis=0)
    origins = center + rng.normal(size=(3000, 3)) * [9, 9, 5]
    rays = np.concatenate([origins, rng.normal(size=(3000, 3))], axis=1).astype(dtype)
    ours, theirs = closed.cast_rays(rays), opened.cast_rays(rays)
    assert (ours.t_hit == theirs.t_hit).all() and ours.is_hit.any()
    assert (closed.count_intersections(rays) == opened.count_intersections(rays)).all()
    closed.update_heights(0, z + 1)
    assert closed.test_occlusions((above, down)).all()
    with pytest.raises(ValueError, match='edges is "shut"'):
        closed.add_heightfield(z, edges="shut")
