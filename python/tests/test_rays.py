"""Rays in, hits out."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from conftest import sphere_mesh

import snell

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)
FACES = np.array([[0, 1, 2]], dtype=np.int32)


@pytest.fixture
def triangle() -> snell.Scene:
    scene = snell.Scene()
    scene.add_mesh(TRIANGLE, FACES)
    return scene


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(), (1,), (5,), (4, 3), (2, 3, 4), (0,), (3, 0)])
def test_results_keep_the_leading_shape_and_the_dtype(triangle, dtype, shape):
    rays = np.broadcast_to(np.array([0.25, 0.5, -2, 0, 0, 1], dtype=dtype), (*shape, 6))
    hits = triangle.cast_rays(rays)
    assert hits.shape == shape
    expected = {
        "t_hit": (shape, dtype),
        "geometry_ids": (shape, np.uint32),
        "instance_ids": (shape, np.uint32),
        "instance_paths": ((*shape, 0), np.uint32),
        "primitive_ids": (shape, np.uint32),
        "primitive_uvs": ((*shape, 2), dtype),
        "primitive_normals": ((*shape, 3), dtype),
        "points": ((*shape, 3), dtype),
        "normals": ((*shape, 3), dtype),
        "uvs": ((*shape, 2), dtype),
    }
    assert list(hits) == list(expected) == hits.keys() and len(hits) == 10
    for name, array in hits.items():
        assert (array.shape, array.dtype) == expected[name], name
        assert array is hits[name] is getattr(hits, name)
    assert (hits.t_hit == 2).all() and (hits.primitive_uvs == [0.25, 0.5]).all()
    assert (hits.points == [0.25, 0.5, 0]).all() and (hits.primitive_normals == [0, 0, 1]).all()
    assert triangle.test_occlusions(rays).shape == shape
    assert triangle.count_intersections(rays).shape == shape


def test_a_miss_is_infinitely_far_and_has_no_ids(triangle):
    hits = triangle.cast_rays([5, 5, -2, 0, 0, 1])
    assert hits.t_hit == np.inf
    for name in ("geometry_ids", "instance_ids", "primitive_ids"):
        assert hits[name] == snell.INVALID_ID
    assert (
        np.isnan(hits.points).all()
        and (hits.normals == 0).all()
        and (hits.primitive_uvs == 0).all()
    )


def test_a_pair_of_origins_and_directions_broadcasts(rng):
    scene = snell.Scene()
    scene.add_mesh(*sphere_mesh(12, 24))
    origins, directions = rng.normal(size=(5, 1, 3)) * 3, rng.normal(size=(7, 3))
    pair = scene.cast_rays((origins, directions))
    rows = np.concatenate(np.broadcast_arrays(origins, directions), axis=-1)
    assert pair.shape == (5, 7)
    for name, array in scene.cast_rays(rows).items():
        np.testing.assert_array_equal(pair[name], array)
    one = scene.cast_rays(([0, 0, 0], directions))
    np.testing.assert_array_equal(one.t_hit, scene.cast_rays((np.zeros((7, 3)), directions)).t_hit)


def test_the_dtype_of_the_rays_decides_and_plain_sequences_do_not_count_beside_arrays(triangle):
    direction = np.array([0, 0, 1], dtype=np.float32)
    assert triangle.cast_rays(([0, 0, -1], direction)).t_hit.dtype == np.float32
    assert triangle.cast_rays((np.zeros(3), direction)).t_hit.dtype == np.float64
    assert triangle.cast_rays(np.zeros((2, 6), dtype=np.float16)).t_hit.dtype == np.float32
    assert triangle.cast_rays(np.zeros((2, 6), dtype=np.int16)).t_hit.dtype == np.float64


@pytest.mark.parametrize(
    "arrange",
    [
        lambda rays: rays[::-1][::-1],
        lambda rays: np.asfortranarray(rays),
        lambda rays: np.repeat(rays, 2, axis=1)[:, ::2],
        lambda rays: rays.astype(rays.dtype.newbyteorder()),
        lambda rays: (
            np.frombuffer(b"x" + rays.tobytes(), dtype=np.uint8)[1:]
            .view(rays.dtype)
            .reshape(rays.shape)
        ),
        lambda rays: rays.tolist(),
    ],
)
def test_any_memory_layout_gives_the_same_hits(rng, sphere, arrange):
    scene = snell.Scene()
    scene.add_mesh(*sphere)
    rays = rng.normal(size=(500, 6))
    expected = scene.cast_rays(rays)
    found = scene.cast_rays(arrange(rays))
    np.testing.assert_array_equal(found.t_hit, expected.t_hit)
    np.testing.assert_array_equal(found.primitive_ids, expected.primitive_ids)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_number_of_threads_and_rays_gives_the_same_bits(rng, sphere, dtype):
    scene = snell.Scene()
    scene.add_mesh(*sphere)
    rays = rng.normal(size=(10_000, 6)).astype(dtype)
    all_at_once = scene.cast_rays(rays)
    for threads in (1, 2, 7):
        found = scene.cast_rays(rays.reshape(100, 100, 6), threads=threads)
        for name, array in all_at_once.items():
            np.testing.assert_array_equal(found[name].reshape(array.shape), array)
    for i in range(0, 10_000, 997):
        assert scene.cast_rays(rays[i]).t_hit == all_at_once.t_hit[i]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_limits_are_exclusive_and_per_ray(triangle, dtype):
    rays = np.broadcast_to(np.array([0.25, 0.5, -2, 0, 0, 1], dtype=dtype), (4, 6))
    t_min = np.array([0, 2, 1.5, 3])
    assert triangle.test_occlusions(rays, t_min=t_min).tolist() == [True, False, True, False]
    assert triangle.test_occlusions(rays, t_max=[2, 2.5, 1, np.inf]).tolist() == [
        False,
        True,
        False,
        True,
    ]
    assert triangle.test_occlusions(rays, t_min=np.array([2])).tolist() == [False] * 4
    assert triangle.test_occlusions(rays, t_max=np.float32(3), mask=np.array([1])).all()
    assert triangle.cast_rays(rays, t_min=2).t_hit.tolist() == [np.inf] * 4


def test_masks_choose_objects_per_ray():
    scene = snell.Scene()
    near = scene.add_mesh(TRIANGLE, FACES, mask=1)
    far = scene.add_mesh(TRIANGLE + [0, 0, 1], FACES, mask=2)
    rays = np.broadcast_to([0.25, 0.5, -2, 0, 0, 1], (4, 6))
    found = scene.cast_rays(rays, mask=[1, 2, 3, 0]).geometry_ids
    assert found.tolist() == [near, far, near, snell.INVALID_ID]
    assert scene.count_intersections(rays, mask=3).tolist() == [2] * 4
    scene.update_mask(near, 4)
    assert scene.cast_rays(rays[0], mask=1).geometry_ids == snell.INVALID_ID


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lists_are_sorted_rows_and_counts_are_their_lengths(rng, sphere, dtype):
    scene = snell.Scene()
    scene.add_mesh(*sphere)
    scene.add_mesh(sphere[0] * 0.5, sphere[1])
    scene.add_shape("sphere", radius=0.25)
    rays = np.concatenate(
        [rng.normal(size=(3000, 3)) * 2, rng.normal(size=(3000, 3))], axis=1
    ).astype(dtype)
    rays = rays.reshape(30, 100, 6)
    found, counts = scene.list_intersections(rays), scene.count_intersections(rays)
    assert (
        found.ray_splits.shape == (3001,)
        and found.ray_splits[-1] == found.t_hit.size == counts.sum()
    )
    np.testing.assert_array_equal(np.diff(found.ray_splits), counts.ravel())
    np.testing.assert_array_equal(found.ray_ids, np.repeat(np.arange(3000), counts.ravel()))
    same_ray = found.ray_ids[1:] == found.ray_ids[:-1]
    assert (np.diff(found.t_hit)[same_ray] >= 0).all()
    first = found.ray_splits[:-1][counts.ravel() > 0]
    hits = scene.cast_rays(rays)
    is_hit = np.isfinite(hits.t_hit)
    np.testing.assert_array_equal(found.t_hit[first], hits.t_hit[is_hit])
    np.testing.assert_array_equal(found.points[first], hits.points[is_hit])
    along = rays.reshape(-1, 6)[found.ray_ids]
    np.testing.assert_allclose(
        found.points, along[:, :3] + along[:, 3:] * found.t_hit[:, None], atol=2e-5
    )


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("center", [(0, 0, 0), (148376, 1234, -223423)])
def test_a_closed_mesh_never_leaks_and_each_crossing_counts_once(dtype, center):
    vertices, faces = sphere_mesh(50, 100, radius=2)
    vertices = (vertices + center).astype(dtype).astype(np.float64)
    scene = snell.Scene()
    scene.add_mesh(vertices.astype(dtype), faces)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    targets = np.concatenate([vertices, vertices[edges].mean(axis=1)])
    for inner in ([0, 0, 0], [0.5, 0.25, -0.75]):
        origin = (np.array(inner) + center).astype(dtype)
        rays = (origin, (targets - origin).astype(dtype))
        assert (scene.count_intersections(rays) == 1).all()
        assert np.isfinite(scene.cast_rays(rays).t_hit).all()


def test_float64_is_real_far_from_the_origin():
    """A millimetre at a place in UTM metres, where float32 has steps of half a metre."""
    place = np.array([448262.123, 5411932.678, 120.0])
    wall = np.array([[0, 0, 0], [10, 0, 0], [10, 0, 8], [0, 0, 8]]) + place
    faces = [[0, 1, 2], [0, 2, 3]]
    scene = snell.Scene()
    front = scene.add_mesh(wall, faces)
    scene.add_mesh(wall + [0, 0.001, 0], faces)
    ray = np.concatenate([place + [5, -3, 4], [0, 1, 0]])
    assert scene.cast_rays(ray).geometry_ids == front
    assert abs(scene.cast_rays(ray).t_hit - 3) < 1e-8
    np.testing.assert_allclose(np.diff(scene.list_intersections(ray).t_hit), 0.001, atol=2e-9)
    np.testing.assert_allclose(scene.distance(ray[:3]), 3, atol=1e-8)
    np.testing.assert_allclose(scene.closest_points(ray[:3]).points, place + [5, 0, 4], atol=1e-8)
    np.testing.assert_allclose(scene.cast_rays(ray).points, place + [5, 0, 4], atol=1e-8)


def test_rays_that_are_not_finite_miss_and_are_counted_when_asked(triangle):
    rays = np.tile([0.25, 0.5, -2.0, 0, 0, 1], (6, 1))
    rays[1, 0], rays[2, 4], rays[3, 3:] = np.nan, np.inf, 0
    hits = triangle.cast_rays(rays)
    assert np.isinf(hits.t_hit).tolist() == [False, True, True, True, False, False]
    with pytest.warns(RuntimeWarning, match="^3 of 6 rays can hit nothing"):
        triangle.cast_rays(rays, warn_invalid=True)
    with pytest.warns(RuntimeWarning, match="^4 of 6 rays"):
        triangle.test_occlusions(rays, t_min=[0, 0, 0, 0, 0, np.nan], warn_invalid=True)


def test_pinhole_rays_meet_what_projects_to_their_pixels():
    scene = snell.Scene()
    scene.add_mesh(*sphere_mesh(24, 48))
    intrinsics = np.array([[50, 0, 32], [0, 50, 24], [0, 0, 1]])
    extrinsics = np.eye(4)
    extrinsics[2, 3] = 5
    rays = snell.create_rays_pinhole(intrinsics, extrinsics, 64, 48, dtype=np.float64)
    hits = scene.cast_rays(rays)
    is_hit = np.isfinite(hits.t_hit)
    assert 200 < is_hit.sum() < 500
    seen = hits.points[is_hit] + [0, 0, 5]
    pixels = seen @ intrinsics.T
    row, column = np.nonzero(is_hit)
    np.testing.assert_allclose(
        pixels[:, :2] / pixels[:, 2:], np.stack([column, row], 1) + 0.5, atol=1e-9
    )
    np.testing.assert_allclose(hits.t_hit[is_hit], seen[:, 2], atol=1e-12)
    looking = snell.create_rays_pinhole(
        fov_deg=np.degrees(2 * np.arctan(32 / 50)),
        center=[0, 0, 0],
        eye=[0, 0, -5],
        up=[0, 1, 0],
        width_px=64,
        height_px=48,
        dtype=np.float64,
    )
    np.testing.assert_allclose(looking, rays, atol=1e-12)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_contiguous_rays_are_not_copied(dtype):
    scene = snell.Scene()
    scene.add_mesh(*sphere_mesh(6, 8))
    rays = np.random.default_rng(0).normal(size=(50_000, 6)).astype(dtype)
    scene.cast_rays(rays)

    def peak(rays) -> float:
        tracemalloc.start()
        hits = scene.cast_rays(rays)
        peak = tracemalloc.get_traced_memory()[1] / len(hits.t_hit)
        tracemalloc.stop()
        return peak

    # For each hit, a distance, two coordinates and three ids are kept, and nothing else is stored.
    kept = 3 * np.dtype(dtype).itemsize + 3 * 4
    assert peak(rays) < kept + 1
    assert peak((np.ascontiguousarray(rays[:, :3]), np.ascontiguousarray(rays[:, 3:]))) < kept + 1
    assert peak(np.asfortranarray(rays)) > kept + 6 * np.dtype(dtype).itemsize - 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rays_in_any_order_and_shape_hit_the_same(dtype):
    scene = snell.Scene()
    scene.add_mesh(*sphere_mesh(20, 30))
    rays = snell.create_rays_pinhole(
        fov_deg=40,
        center=[0, 0, 0],
        eye=[0.3, 1, 4],
        up=[0, 1, 0],
        width_px=80,
        height_px=60,
        dtype=dtype,
    )
    picture = scene.cast_rays(rays)
    order = np.random.default_rng(1).permutation(80 * 60)
    mixed = scene.cast_rays(rays.reshape(-1, 6)[order])
    one_by_one = [float(scene.cast_rays(ray).t_hit) for ray in rays.reshape(-1, 6)[::97]]
    for name in ("t_hit", "primitive_ids", "primitive_uvs", "normals"):
        flat = picture[name].reshape(80 * 60, -1)
        np.testing.assert_array_equal(flat[order], mixed[name].reshape(80 * 60, -1))
    np.testing.assert_array_equal(picture.t_hit.ravel()[::97], one_by_one)


def test_answers_belong_to_the_caller():
    scene = snell.Scene()
    scene.add_mesh(*sphere_mesh(6, 8))
    rays = np.random.default_rng(0).normal(size=(100, 6))
    expected, hits = scene.cast_rays(rays), scene.cast_rays(rays)
    for name in ("t_hit", "primitive_ids", "primitive_uvs", "geometry_ids"):
        hits[name][...] = 12345
    for name in ("normals", "points", "primitive_normals"):
        np.testing.assert_array_equal(hits[name], expected[name])


def test_no_rays_have_no_hits(triangle):
    for rays in ([], ([], []), np.empty((0, 6)), ([], [0, 0, 1])):
        assert triangle.cast_rays(rays).t_hit.shape == (0,)
    assert triangle.distance([]).shape == (0,)
