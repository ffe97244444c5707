"""Nearest points, distances, inside and outside."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import sphere_mesh

import snell

UTM = np.array([448262.0, 5411932.0, 120.0])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(), (4,), (2, 3), (0,)])
def test_answers_keep_the_leading_shape_and_the_dtype(sphere, dtype, shape):
    scene = snell.Scene()
    scene.add_mesh(*sphere)
    points = np.full((*shape, 3), 2, dtype=dtype)
    near = scene.closest_points(points)
    assert near.shape == shape == near.distances.shape and near.points.shape == (*shape, 3)
    assert near.distances.dtype == near.points.dtype == near.primitive_normals.dtype == dtype
    for name in ("distance", "signed_distance"):
        answer = getattr(scene, name)(points)
        assert (answer.shape, answer.dtype) == (shape, dtype)
    assert (scene.occupancy(points).dtype, scene.winding_number(points).dtype) == (bool, np.float64)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("mesh_dtype", [np.float32, np.float64])
def test_nearest_points_lie_on_their_triangles_and_no_other_is_nearer(
    sphere, rng, dtype, mesh_dtype
):
    vertices, faces = sphere[0].astype(mesh_dtype), sphere[1]
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    points = (rng.normal(size=(300, 3)) * 1.5).astype(dtype)
    near = scene.closest_points(points)
    eps = 1e-6 if dtype == np.float32 else 1e-12
    np.testing.assert_allclose(
        np.linalg.norm(near.points - points, axis=1), near.distances, atol=4 * eps
    )
    u, v = near.primitive_uvs.T.astype(np.float64)
    corners = vertices.astype(np.float64)[faces[near.primitive_ids]]
    b = np.stack([1 - u - v, u, v], axis=1)
    assert (b > -1e-6).all()
    np.testing.assert_allclose((corners * b[:, :, None]).sum(1), near.points, atol=1e-6)
    samples = vertices.astype(np.float64)[faces].mean(1)
    least = np.linalg.norm(samples[None] - points[:, None].astype(np.float64), axis=2).min(1)
    assert (near.distances <= least + 1e-6).all()
    np.testing.assert_array_equal(scene.distance(points), near.distances)


def test_signs_are_those_of_occupancy_and_limits_cut_off(sphere, rng):
    scene = snell.Scene()
    scene.add_mesh(*sphere)
    for dtype in (np.float32, np.float64):
        points = (rng.normal(size=(1000, 3)) * 1.2).astype(dtype)
        radius = np.linalg.norm(points, axis=1)
        clear = abs(radius - 1) > 0.01
        inside = scene.occupancy(points)
        np.testing.assert_array_equal(inside[clear], radius[clear] < 1)
        signed = scene.signed_distance(points)
        np.testing.assert_array_equal(np.abs(signed), scene.distance(points))
        np.testing.assert_array_equal(signed < 0, inside & (signed != 0))
        cut = scene.signed_distance(points, max_distance=0.125)
        np.testing.assert_array_equal(cut, np.clip(signed, -0.125, 0.125).astype(dtype))
        assert np.isinf(scene.distance(points, max_distance=0.125)[np.abs(signed) > 0.126]).all()
        limits = np.where(np.arange(1000) % 2, 0.125, 10)
        far = np.isinf(scene.closest_points(points, max_distance=limits).distances)
        np.testing.assert_array_equal(far, np.abs(signed) > limits)


def test_occupancy_is_sensible_for_open_meshes(sphere):
    vertices, faces = sphere
    lid = vertices[faces].mean(1)[:, 1] > 0.9
    scene = snell.Scene()
    scene.add_mesh(vertices, faces[~lid])
    assert scene.occupancy([[0, 0, 0], [0, -0.9, 0], [0, 1.5, 0], [3, 0, 0]]).tolist() == [
        True,
        True,
        False,
        False,
    ]


def test_an_empty_scene_and_bad_points_have_defined_answers(sphere):
    scene = snell.Scene()
    assert scene.distance([0, 0, 0]) == scene.signed_distance([0, 0, 0]) == np.inf
    assert (
        not scene.occupancy([0, 0, 0])
        and scene.closest_points([0, 0, 0]).geometry_ids == snell.INVALID_ID
    )
    scene.add_mesh(*sphere)
    for dtype in (np.float32, np.float64):
        bad = np.array([[np.nan, 0, 0], [0, np.inf, 0]], dtype=dtype)
        assert np.isinf(scene.signed_distance(bad)).all() and not scene.occupancy(bad).any()
        assert np.isnan(scene.closest_points(bad).points).all()
        assert np.isinf(scene.distance(np.zeros((1, 3), dtype=dtype), max_distance=-1)).all()


def test_double_precision_is_not_rounded_far_from_the_origin(sphere, rng):
    """The same answers at the origin and at a place in UTM metres, to nanometres."""
    vertices, faces = np.round(sphere[0] * 2**20) / 2**20, sphere[1]
    here, there = snell.Scene(), snell.Scene()
    here.add_mesh(vertices, faces)
    there.add_mesh(vertices + UTM, faces)
    placed, matrix = snell.Scene(), np.eye(4)
    matrix[:3, 3] = UTM
    placed.add_mesh(vertices.astype(np.float32), faces, matrix)
    points = np.round(rng.normal(size=(500, 3)) * 2**20) / 2**20
    expected = here.closest_points(points)
    for scene in (there, placed):
        near = scene.closest_points(points + UTM)
        np.testing.assert_allclose(near.distances, expected.distances, atol=1e-8)
        np.testing.assert_allclose(near.points - UTM, expected.points, atol=1e-8)
        np.testing.assert_allclose(near.primitive_normals, expected.primitive_normals, atol=2e-2)
        np.testing.assert_array_equal(scene.occupancy(points + UTM), here.occupancy(points))
        np.testing.assert_allclose(
            scene.signed_distance(points + UTM), here.signed_distance(points), atol=1e-8
        )


def test_masks_choose_what_counts():
    scene = snell.Scene()
    scene.add_shape("sphere", mask=1, radius=1)
    scene.add_shape("sphere", mask=2, radius=2)
    masks = (1, 2, 3, 4)
    assert [float(scene.distance([0, 0, 5], mask=m)) for m in masks] == [4, 3, 3, np.inf]
    between = [0, 0, 1.5]
    assert [bool(scene.occupancy(between, mask=m)) for m in masks] == [False, True, True, False]
    signed = [float(scene.signed_distance(between, mask=m)) for m in masks]
    assert signed == [0.5, -0.5, -0.5, np.inf]
    assert [float(scene.winding_number([0, 0, 0], mask=m)) for m in masks] == [1, 1, 2, 0]
    with pytest.raises(ValueError, match="votes"):
        scene.occupancy(between, method="votes")


def cube(low, high):
    """A closed cube whose faces look outwards."""
    corners = [[x, y, z] for x in (low, high) for y in (low, high) for z in (low, high)]
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return np.array(corners, dtype=float), np.array(faces)


def sheet(z):
    corners = np.array([[-50, -50, z], [50, -50, z], [50, 50, z], [-50, 50, z]])
    return corners, [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("turn", [1, -1])
def test_a_closed_body_is_inside_whatever_it_stands_on_and_however_it_is_turned(dtype, turn):
    vertices, faces = cube(0, 1)
    points = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0], [0.5, 0.5, -0.15], [0.5, 0.5, 2]], dtype)
    for ground in ("plane", "sheets", "one mesh"):
        scene = snell.Scene()
        if ground == "one mesh":
            (a, f), (b, g) = sheet(-0.2), sheet(-0.1)
            many = [faces[:, ::turn], np.add(f, 8), np.add(g, 12)]
            scene.add_mesh(np.concatenate([vertices, a, b]), np.concatenate(many))
        else:
            scene.add_mesh(vertices, faces[:, ::turn])
        if ground == "plane":
            scene.add_shape("plane")
        if ground == "sheets":
            scene.add_mesh(*sheet(-0.2))
            scene.add_mesh(*sheet(-0.1))
        inside = scene.occupancy(points)
        assert inside.tolist() == [True, True, False, False], ground
        assert (scene.signed_distance(points) <= 0).tolist() == [True, True, False, False], ground
        assert scene.signed_distance(points[0]) == -0.5
    assert scene.winding_number([0.5, 0.5, 0.5]) < turn


def test_cavities_unions_and_parity():
    (outer, f), (inner, g) = cube(0, 3), cube(1, 2)
    points = [[1.5, 1.5, 1.5], [0.5, 0.5, 0.5], [4, 1, 1]]

    def occupied(faces, **options):
        scene = snell.Scene()
        scene.add_mesh(np.concatenate([outer, inner]), np.concatenate(faces))
        return scene.occupancy(points, **options).tolist()

    assert occupied([f, g[:, ::-1] + 8]) == [False, True, False]
    assert occupied([f[:, ::-1], g + 8]) == [False, True, False]
    assert occupied([f, g + 8]) == [True, True, False]
    assert occupied([f, g + 8], method="parity") == [False, True, False]
    assert occupied([f[:, ::-1], g + 8], method="winding") == [False, False, False]


def test_points_on_a_surface_are_inside_at_distance_zero():
    """In meshes and shapes, by every method."""
    steps = np.linspace(0, 0.3, 31)
    grid = np.stack(np.meshgrid(steps, steps, [0, 0.3], indexing="ij"), -1).reshape(-1, 3)
    mesh, shape = snell.Scene(), snell.Scene()
    mesh.add_mesh(*cube(0, 0.3))
    shape.add_shape("box", min=[0, 0, 0], max=[0.3, 0.3, 0.3])
    for scene in (mesh, shape):
        for axis in range(3):
            points = np.roll(grid, axis, axis=1)
            for method in ("auto", "parity", "winding"):
                assert scene.occupancy(points, method=method).all(), method
                assert (scene.signed_distance(points, method=method) == 0).all(), method


def test_insides_and_distances_hold_at_any_size():
    for size in (1e-110, 1e-30, 1e30, 1e155):
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) * size
        scene = snell.Scene()
        scene.add_mesh(corners, [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
        assert scene.occupancy(corners.mean(0)) and not scene.occupancy(np.full(3, size))
        assert scene.distance(np.full(3, 2 * size)) / size == pytest.approx(5 / 3**0.5)


def test_sheets_have_no_inside_below():
    x = np.linspace(-1, 1, 60)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), -1)
    z = 0.05 * np.sin(9 * grid[..., :1]) * np.cos(7 * grid[..., 1:])
    vertices = np.concatenate([grid, z], -1).reshape(-1, 3)
    a = (np.arange(59)[:, None] * 60 + np.arange(59)).ravel()
    faces = np.concatenate([np.stack([a, a + 60, a + 61], 1), np.stack([a, a + 61, a + 1], 1)])
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    points = [[0, 0, -0.1], [0.5, 0.5, -0.5], [0, 0, -0.001], [0, 0, 1]]
    assert not scene.occupancy(points).any()
    assert (scene.signed_distance(points) > 0).all()
    assert scene.occupancy(points, method="parity").tolist() == [True, True, True, False]
    assert scene.winding_number([0, 0, -0.1]) > 0.4


def test_flat_triangles_have_the_distance_of_their_line():
    for face in ([0, 1, 1], [0, 0, 1], [0, 1, 0], [0, 1, 2]):
        for dtype in (np.float32, np.float64):
            scene = snell.Scene()
            scene.add_mesh([[0, 0, 0], [1, 0, 0], [0.5, 0, 0.0]], [face])
            assert scene.distance(np.array([0.5, 1, 0], dtype)) == 1


def test_double_precision_tells_sides_of_a_millimetre_in_a_city(rng):
    vertices, faces = sphere_mesh(20, 40)
    radius = 1e-3
    scene = snell.Scene()
    scene.add_mesh(vertices * radius + UTM, faces)
    d = rng.normal(size=(200, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    size = np.linalg.norm(vertices, axis=1).max()
    for share, inside in ((0.5, True), (1.1, False)):
        points = d * (radius * size * share) + UTM
        assert (scene.occupancy(points) == inside).all()
        assert ((scene.signed_distance(points) < 0) == inside).all()
        np.testing.assert_allclose(scene.winding_number(points), float(inside), atol=0.1)
        near = scene.closest_points(points)
        # No corner of any triangle is nearer than the point that was found.
        corners = (vertices * radius + UTM)[faces].reshape(-1, 3)
        least = np.linalg.norm(corners[None] - points[:, None], axis=2).min(1)
        assert (near.distances <= least + 1e-12).all()
        np.testing.assert_allclose(
            np.linalg.norm(near.points - points, axis=1), near.distances, atol=4e-9
        )


def test_edits_show_in_double_precision():
    vertices, faces = sphere_mesh(20, 40)
    scene = snell.Scene()
    ball = scene.add_mesh(vertices + UTM, faces)
    other = scene.add_mesh(vertices, faces, transform=np.diag([1.0, 1.0, 1.0, 1.0]))
    origin = UTM - [0, 0, 5]
    before = scene.cast_rays((origin, [0, 0.01, 1.0])).t_hit
    scene.update_vertices(ball, vertices + UTM + [0, 0, 0.125])
    np.testing.assert_allclose(
        scene.cast_rays((origin, [0, 0.01, 1.0])).t_hit, before + 0.125, atol=1e-2
    )
    assert scene.distance(UTM + [0, 0, 0.125]) > 0.9
    scene.remove(ball)
    assert np.isinf(scene.cast_rays((origin, [0, 0.01, 1.0])).t_hit)
    assert scene.distance(np.zeros(3)) > 0.9
    scene.remove(other)
    assert np.isinf(scene.distance(np.zeros(3)))
