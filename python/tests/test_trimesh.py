"""The drop-in for ``mesh.ray`` agrees with trimesh's own engine, except where that one is wrong at
edges.
"""

from __future__ import annotations

import ast
import inspect
import pathlib
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import sphere_mesh

from snell.trimesh import RayMeshIntersector

trimesh = pytest.importorskip("trimesh")
ray_triangle = pytest.importorskip("trimesh.ray.ray_triangle")
pytest.importorskip("rtree")
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def meshes():
    ball = trimesh.Trimesh(*sphere_mesh(12, 24), process=False)
    torus = trimesh.creation.torus(major_radius=1.0, minor_radius=0.4)
    box = trimesh.creation.box()
    both = trimesh.util.concatenate([ball, trimesh.creation.icosphere(subdivisions=2, radius=0.5)])
    return [ball, torus, box, both]


def rays(count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(11)
    origins = rng.normal(size=(count, 3)) * 2
    return origins, rng.normal(size=(count, 3)) * 0.7 - origins


def in_order(index_tri, index_ray, locations=None):
    order = np.lexsort([index_tri, index_ray])
    return [
        array[order]
        for array in (index_ray, index_tri, *(() if locations is None else (locations,)))
    ]


def test_all_hits_agree(meshes):
    origins, directions = rays()
    for mesh in meshes:
        theirs, ours = ray_triangle.RayMeshIntersector(mesh), RayMeshIntersector(mesh)
        for multiple in (True, False):
            their_id = theirs.intersects_id(
                origins, directions, multiple_hits=multiple, return_locations=True
            )
            our_id = ours.intersects_id(
                origins, directions, multiple_hits=multiple, return_locations=True
            )
            assert [a.dtype.kind for a in our_id] == [a.dtype.kind for a in their_id]
            assert len(our_id[0]) > 100
            for a, b in zip(in_order(*our_id), in_order(*their_id), strict=True):
                np.testing.assert_allclose(a, b, atol=1e-9)
            locations, index_ray, index_tri = ours.intersects_location(
                origins, directions, multiple_hits=multiple
            )
            np.testing.assert_array_equal(locations, our_id[2])
            np.testing.assert_array_equal(index_ray, our_id[1])
            np.testing.assert_array_equal(index_tri, our_id[0])
        np.testing.assert_array_equal(
            ours.intersects_first(origins, directions), theirs.intersects_first(origins, directions)
        )
        np.testing.assert_array_equal(
            ours.intersects_any(origins, directions), theirs.intersects_any(origins, directions)
        )


def test_points_inside_agree(meshes):
    points = np.random.default_rng(5).normal(size=(500, 3)) * 0.8
    for mesh in meshes[:3]:
        ours, theirs = RayMeshIntersector(mesh), ray_triangle.RayMeshIntersector(mesh)
        np.testing.assert_array_equal(ours.contains_points(points), theirs.contains_points(points))


def test_the_methods_and_their_arguments_are_those_of_the_embree_engine():
    """The file of that engine is only read, because importing it needs Embree. (trimesh's two
    engines differ in the order of two arguments.)
    """
    path = pathlib.Path(ray_triangle.__file__).with_name("ray_pyembree.py")
    classes = [n for n in ast.parse(path.read_text()).body if isinstance(n, ast.ClassDef)]
    theirs = next(c for c in classes if c.name == "RayMeshIntersector")
    methods = {
        f.name: [a.arg for a in f.args.args] for f in theirs.body if isinstance(f, ast.FunctionDef)
    }
    methods = {name: arguments for name, arguments in methods.items() if not name.startswith("_")}
    assert len(methods) >= 5
    for name, arguments in methods.items():
        ours = list(inspect.signature(getattr(RayMeshIntersector, name)).parameters)
        assert ours[: len(arguments)] == arguments, name


def test_it_takes_the_place_of_a_meshs_ray(meshes):
    mesh = meshes[0].copy()
    mesh.ray = RayMeshIntersector(mesh)
    assert mesh.ray.intersects_any([[0, 0, -5]], [[0, 0, 1]]).tolist() == [True]


def test_the_mesh_is_read_when_it_is_asked(meshes):
    mesh = meshes[2].copy()
    ours = RayMeshIntersector(mesh)
    assert ours.intersects_any([[0, 0, 5]], [[0, 0, -1]]).tolist() == [True]
    mesh.apply_translation([10, 0, 0])
    down = [[0, 0, 5], [10, 0, 5]], [[0, 0, -1], [0, 0, -1]]
    assert ours.intersects_any(*down).tolist() == [False, True]
    assert ours.contains_points([[0, 0, 0], [10, 0, 0]]).tolist() == [False, True]
    # Plain arrays have no hash, and are compared.
    plain = SimpleNamespace(vertices=np.eye(3), faces=np.array([[0, 1, 2]]))
    ours = RayMeshIntersector(plain)
    assert ours.intersects_first([[0, 0, 0]], [[1, 1, 1]]).tolist() == [0]
    plain.vertices += 5
    assert ours.intersects_first([[0, 0, 0]], [[1, 0.1, 0.1]]).tolist() == [-1]


def test_primitives_work_and_may_change():
    ball = trimesh.primitives.Sphere(radius=1)
    ours = RayMeshIntersector(ball)
    top = lambda: ours.intersects_location([[0, 0, 5]], [[0, 0, -1]])[0][:, 2].max()  # noqa: E731
    assert abs(top() - 1) < 1e-9
    ball.primitive.radius = 0.25
    assert abs(top() - 0.25) < 1e-9
    assert abs(pickle.loads(pickle.dumps(ours)).mesh.volume - ball.volume) < 1e-12


def test_the_surface_on_which_a_ray_starts_counts(meshes):
    box = meshes[2]
    points, faces = trimesh.sample.sample_surface(box, 500, seed=1)
    normals = box.face_normals[faces]
    for engine in (RayMeshIntersector(box), ray_triangle.RayMeshIntersector(box)):
        assert engine.intersects_any(points, normals).all()
        np.testing.assert_array_equal(engine.intersects_first(points, normals), faces)
        _, index_ray, _ = engine.intersects_location(points, -normals)
        np.testing.assert_array_equal(np.bincount(index_ray), np.full(500, 2))
    above = points + 1e-9 * normals
    assert not RayMeshIntersector(box).intersects_any(above, normals).any()
    assert len(RayMeshIntersector(box).intersects_id([], [])[0]) == 0


def test_max_hits_keeps_the_first(meshes):
    ours = RayMeshIntersector(meshes[3])
    tri, _ = ours.intersects_id([[0.01, 0.02, -5]], [[0, 0, 1]])
    assert len(tri) == 4
    some, _ = ours.intersects_id([[0.01, 0.02, -5]], [[0, 0, 1]], max_hits=3)
    np.testing.assert_array_equal(some, tri[:3])


def test_a_ray_through_a_vertex_or_edge_counts_as_it_should(meshes):
    """There, trimesh counts each triangle around the vertex."""
    ball = meshes[0]
    vertices = ball.vertices[1:-1]
    ours = RayMeshIntersector(ball)
    _, index_ray = ours.intersects_id(np.zeros_like(vertices), vertices)
    np.testing.assert_array_equal(np.bincount(index_ray), np.ones(len(vertices)))
