"""The drop-in for Open3D's class has its keys, dtypes and miss values."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import sphere_mesh

import snell
from snell.open3d import RaycastingScene


class Tensor:
    """The part of Open3D's class that these tests need."""

    def __init__(self, array):
        self.array = array

    def numpy(self):
        return self.array


@pytest.fixture
def scene() -> RaycastingScene:
    vertices, faces = sphere_mesh(24, 48)
    scene = RaycastingScene()
    assert scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32)) == 0
    assert (
        scene.add_triangles(
            Tensor((vertices * 0.5).astype(np.float32)), Tensor(faces.astype(np.uint32))
        )
        == 1
    )
    return scene


def test_rays(scene):
    rays = [[[0.01, 0.02, -5, 0, 0, 1], [9, 0, -5, 0, 0, 1]]]
    hits = scene.cast_rays(rays)
    kinds = {
        "t_hit": "f4",
        "geometry_ids": "u4",
        "primitive_ids": "u4",
        "primitive_uvs": "f4",
        "primitive_normals": "f4",
    }
    assert {name: array.dtype.str[1:] for name, array in hits.items()} == kinds
    assert hits["t_hit"].shape == (1, 2) and hits["primitive_uvs"].shape == (1, 2, 2)
    assert (
        hits["geometry_ids"].tolist() == [[0, RaycastingScene.INVALID_ID]]
        and hits["t_hit"][0, 1] == np.inf
    )
    assert hits["primitive_normals"][0, 0, 2] < -0.9
    counts = scene.count_intersections(Tensor(np.array(rays)))
    assert counts.dtype == np.int32 and counts.tolist() == [[4, 0]]
    assert scene.test_occlusions(rays).tolist() == [[True, False]]
    assert scene.test_occlusions(rays, tnear=4.7, tfar=5.3).tolist() == [[False, False]]
    found = scene.list_intersections(rays)
    assert list(found) == [
        "ray_splits",
        "ray_ids",
        "t_hit",
        "geometry_ids",
        "primitive_ids",
        "primitive_uvs",
    ]
    assert found["ray_splits"].tolist() == [0, 4, 4] and found["geometry_ids"].tolist() == [
        0,
        1,
        1,
        0,
    ]


def test_points(scene):
    points = np.array([[0, 0, 3], [0, 0, 0.75], [0.1, 0, 0]], dtype=np.float32)
    near = scene.compute_closest_points(points)
    assert list(near) == [
        "points",
        "geometry_ids",
        "primitive_ids",
        "primitive_uvs",
        "primitive_normals",
    ]
    assert near["geometry_ids"][0] == 0 and near["geometry_ids"][2] == 1
    np.testing.assert_allclose(scene.compute_distance(points), [2, 0.25, 0.4], atol=0.01)
    np.testing.assert_allclose(scene.compute_signed_distance(points), [2, -0.25, -0.4], atol=0.01)
    occupancy = scene.compute_occupancy(points)
    assert occupancy.dtype == np.float32 and occupancy.tolist() == [0, 1, 1]


def test_pinhole_rays_in_both_ways():
    by_view = RaycastingScene.create_rays_pinhole(90, [0, 0, 0], [0, 0, -5], [0, -1, 0], 8, 4)
    intrinsics, extrinsics = np.array([[4, 0, 4], [0, 4, 2], [0, 0, 1]]), np.eye(4)
    extrinsics[2, 3] = 5
    by_matrices = RaycastingScene.create_rays_pinhole(intrinsics, extrinsics, 8, 4)
    np.testing.assert_allclose(by_view, by_matrices, atol=1e-6)
    named = RaycastingScene.create_rays_pinhole(
        fov_deg=90, center=[0, 0, 0], eye=[0, 0, -5], up=[0, -1, 0], width_px=8, height_px=4
    )
    np.testing.assert_array_equal(named, by_view)


def test_meshes_of_other_libraries_are_recognised():
    from types import SimpleNamespace as Thing

    vertices, faces = sphere_mesh(6, 8)
    quads = Thing(
        points=np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
        cells_dict={"quad": [[0, 1, 2, 3]]},
    )
    meshes = [
        Thing(vertices=vertices, faces=faces),
        Thing(vertices=vertices, triangles=faces),
        Thing(vertex=Thing(positions=Tensor(vertices)), triangle=Thing(indices=Tensor(faces))),
        Thing(points=vertices, cells_dict={"triangle": faces}),
        quads,
    ]
    for mesh in meshes:
        scene = snell.Scene()
        scene.add_mesh(mesh)
        assert scene.cast_rays([0.3, 0.2, -5, 0, 0, 1]).geometry_ids == 0
    assert scene.statistics()["triangles"] == 2
