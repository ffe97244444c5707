"""The drop-in for Open3D's class has its keys, dtypes and miss values."""

from __future__ import annotations

from types import SimpleNamespace

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
    by_view = RaycastingScene.create_rays_pinhole(90, [0, 0, 0], [0, 0, -5], [0, 1, 0], 8, 4)
    intrinsics, extrinsics = np.array([[4, 0, 4], [0, 4, 2], [0, 0, 1]]), np.eye(4)
    extrinsics[2, 3] = 5
    by_matrices = RaycastingScene.create_rays_pinhole(intrinsics, extrinsics, 8, 4)
    np.testing.assert_allclose(by_view, by_matrices, atol=1e-6)
    named = RaycastingScene.create_rays_pinhole(
        fov_deg=90, center=[0, 0, 0], eye=[0, 0, -5], up=[0, 1, 0], width_px=8, height_px=4
    )
    np.testing.assert_array_equal(named, by_view)


def test_rows_of_pixels_follow_each_other_along_up():
    """The numbers are those of Open3D 0.20."""
    rays = RaycastingScene.create_rays_pinhole(90, [0, 0, 0], [0, 0, -5], [0, 1, 0], 4, 2)
    np.testing.assert_allclose(rays[0, 0], [0, 0, -5, -0.75, -0.25, 1], atol=1e-6)
    tilted = RaycastingScene.create_rays_pinhole(60, [1, 2, 3], [-4, 5, -6], [0.2, 1, 0.1], 8, 6)
    np.testing.assert_allclose(
        tilted[1, 6],
        [-4, 5, -6, 0.7205598, -0.52891785, 0.6149171],
        atol=1e-6,
    )


def test_transposed_matrices_are_refused():
    intrinsics, extrinsics = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), np.eye(4)
    extrinsics[:3, 3] = 1, 2, 3
    make = RaycastingScene.create_rays_pinhole
    with pytest.raises(ValueError, match=r"row vectors, give intrinsic_matrix\.T"):
        make(intrinsics.T, extrinsics, 8, 4)
    with pytest.raises(ValueError, match=r"row vectors, give extrinsic_matrix\.T"):
        make(intrinsics, extrinsics.T, 8, 4)
    with pytest.raises(ValueError, match=r"divide it by intrinsic_matrix\[2, 2\]"):
        make(2 * intrinsics, extrinsics, 8, 4)


def test_keywords_count_by_name():
    positions, indices = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], dtype=np.uint32)
    scene = RaycastingScene()
    assert scene.add_triangles(triangle_indices=indices, vertex_positions=positions) == 0
    assert scene.count_intersections([[0, 0, 0, 1, 1, 1]]).tolist() == [1]
    mesh = SimpleNamespace(vertices=positions, triangles=indices)
    assert scene.add_triangles(mesh=mesh) == 1 and scene.add_triangles(mesh) == 2
    with pytest.raises(TypeError, match="unexpected keyword argument 'verts'"):
        scene.add_triangles(verts=positions, tris=indices)
    for wrong in [(), (positions, indices, indices)]:
        with pytest.raises(TypeError, match="add_triangles"):
            scene.add_triangles(*wrong)
    with pytest.raises(TypeError, match="expected vertex_positions and triangle_indices"):
        scene.add_triangles(vertex_positions=positions, mesh=mesh)


def test_the_surface_on_which_a_ray_starts_counts():
    scene = RaycastingScene()
    scene.add_triangles(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32),
        np.array([[0, 1, 2]], dtype=np.uint32),
    )
    rays = [[0.2, 0.2, 0, 0, 0, 1], [0.2, 0.2, 1e-6, 0, 0, 1], [0.2, 0.2, 1, 0, 0, -1]]
    assert scene.cast_rays(rays)["t_hit"].tolist() == [0, np.inf, 1]
    assert scene.count_intersections(rays).tolist() == [1, 0, 1]
    assert scene.list_intersections(rays)["ray_splits"].tolist() == [0, 1, 1, 2]
    assert scene.test_occlusions(rays).tolist() == [True, False, True]
    assert scene.test_occlusions(rays, tnear=0.5, tfar=1.0).tolist() == [False, False, True]


def test_answers_have_the_dtypes_and_methods_of_tensors(scene):
    found = scene.list_intersections(np.float32([[0.01, 0.02, -5, 0, 0, 1]]))
    assert found["ray_splits"].dtype == found["ray_ids"].dtype == np.uint32
    assert type(found["t_hit"].cpu().numpy()) is np.ndarray
    with pytest.raises(ValueError, match="nsamples is 2, expected an odd number"):
        scene.compute_occupancy([[0, 0, 0]], nsamples=2)
    with pytest.raises(ValueError, match="device is CUDA:0, expected the CPU"):
        RaycastingScene(device="CUDA:0")


class FarTensor(Tensor):
    """A tensor on a GPU, as DLPack describes it."""

    device = "cuda:0"

    def __dlpack_device__(self):
        return (2, 0)


class LearntTensor(Tensor):
    """A tensor that keeps a gradient."""

    requires_grad = True


def test_tensors_that_cannot_be_read_are_refused_with_a_remedy(scene):
    rays = np.zeros((1, 6), dtype=np.float32)
    for ask in (scene.cast_rays, snell.Scene().cast_rays):
        with pytest.raises(TypeError, match=r"is on cuda:0, .*; give rays\.cpu\(\)"):
            ask(FarTensor(rays))
        with pytest.raises(TypeError, match=r"has a gradient, .*; give rays\.detach\(\)"):
            ask(LearntTensor(rays))
    assert snell.Scene().cast_rays(Tensor(rays)).t_hit.dtype == np.float32


def test_tensors_of_open3d_come_back_as_such():
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    tensor, theirs = open3d.core.Tensor, open3d.t.geometry.RaycastingScene
    box = open3d.t.geometry.TriangleMesh.create_box()
    rng = np.random.default_rng(3)
    rays = tensor(rng.normal(size=(200, 6)).astype(np.float32))
    points = tensor(rng.normal(size=(200, 3)).astype(np.float32))
    answers = []
    for kind in (theirs, RaycastingScene):
        scene = kind()
        scene.add_triangles(box)
        answers.append(
            {
                **{f"cast {k}": v for k, v in scene.cast_rays(rays).items()},
                **{f"list {k}": v for k, v in scene.list_intersections(rays).items()},
                "count": scene.count_intersections(rays),
                "blocked": scene.test_occlusions(rays),
                "signed": scene.compute_signed_distance(points),
                "inside": scene.compute_occupancy(points),
                "view": kind.create_rays_pinhole(
                    60.0, tensor([0.0, 0, 0]), tensor([0.0, 0, -3]), tensor([0.0, 1, 0]), 8, 6
                ),
            }
        )
    assert answers[0].keys() == answers[1].keys()
    for name, expected in answers[0].items():
        assert answers[1][name].dtype == expected.dtype, name
        if name.startswith("list ") and not name.startswith("list ray"):
            continue  # There, the hits of a ray are in no order.
        a, b = answers[1][name].numpy(), expected.numpy()
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5, err_msg=name)


def test_meshes_of_other_libraries_are_recognised():
    vertices, faces = sphere_mesh(6, 8)
    quads = SimpleNamespace(
        points=np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
        cells_dict={"quad": [[0, 1, 2, 3]]},
    )
    meshes = [
        SimpleNamespace(vertices=vertices, faces=faces),
        SimpleNamespace(vertices=vertices, triangles=faces),
        SimpleNamespace(
            vertex=SimpleNamespace(positions=Tensor(vertices)),
            triangle=SimpleNamespace(indices=Tensor(faces)),
        ),
        SimpleNamespace(points=vertices, cells_dict={"triangle": faces}),
        quads,
    ]
    for mesh in meshes:
        scene = snell.Scene()
        scene.add_mesh(mesh)
        assert scene.cast_rays([0.3, 0.2, -5, 0, 0, 1]).geometry_ids == 0
    assert scene.statistics()["triangles"] == 2


def colored(colors, kind):
    """A square of trimesh with colours of vertices or of faces."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    names = {"vertex": "vertex_colors", "face": "face_colors"}
    visual = SimpleNamespace(kind=kind, **{names[kind]: np.array(colors, np.uint8)})
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return SimpleNamespace(vertices=square, faces=faces, visual=visual)


def seen(scene, x, y):
    camera = snell.Camera(eye=(x, y, 1), target=(x, y, 0), fov=1)
    options = {"camera": camera, "spp": 1, "size": (1, 1), "progress": False}
    return snell.render(scene, "flat", **options).pixels[0, 0]


def test_meshes_bring_their_colours():
    red, green = [255, 0, 0, 255], [0, 255, 0, 255]
    scene = snell.Scene()
    scene.add_mesh(colored([red] * 4, "vertex"))
    assert seen(scene, 0.1, 0.2)[0] > 0.1 and seen(scene, 0.1, 0.2)[1] == 0
    scene = snell.Scene()
    scene.add_mesh(colored([red, green], "face"))
    assert seen(scene, 0.5, -0.5)[1] == 0 and seen(scene, -0.5, 0.5)[0] == 0
    given = snell.Scene()
    given.add_mesh(colored([red] * 4, "vertex"), colors=[[0, 0, 1.0]] * 4)
    assert seen(given, 0.1, 0.2)[0] == 0


def test_a_mesh_of_trimesh_brings_its_texture():
    image = np.zeros((8, 8, 3), np.uint8)
    image[:4, :4] = 255  # The upper left quarter.
    visual = SimpleNamespace(
        kind="texture",
        uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]),  # v grows upwards.
        material=SimpleNamespace(image=SimpleNamespace(convert=lambda mode: image)),
    )
    mesh = colored([[0] * 4] * 4, "vertex")
    mesh.visual = visual
    scene = snell.Scene()
    scene.add_mesh(mesh)
    assert seen(scene, -0.5, 0.5)[0] > 0.1 > seen(scene, -0.5, -0.5)[0]


def test_a_mesh_of_trimesh_without_a_picture_brings_its_colour():
    mesh = colored([[0] * 4] * 4, "vertex")
    material = SimpleNamespace(main_color=np.array([0, 255, 0, 255], np.uint8))
    mesh.visual = SimpleNamespace(kind="texture", uv=None, material=material)
    scene = snell.Scene()
    scene.add_mesh(mesh)
    assert seen(scene, 0.1, 0.2)[0] == 0 < seen(scene, 0.1, 0.2)[1]


def test_what_is_no_mesh_is_refused_with_the_way():
    empty = SimpleNamespace(geometry={}, dump=list)
    with pytest.raises(ValueError, match="the scene of trimesh is empty"):
        snell.Scene().add_mesh(empty)
    cloud = SimpleNamespace(vertices=np.eye(3))
    for given in (cloud, [cloud, cloud]):
        with pytest.raises(TypeError, match="points are added by add_spheres"):
            snell.Scene().add_mesh(given)


def test_several_meshes_become_one():
    first, second = colored([[255, 0, 0, 255]] * 4, "vertex"), colored([[0] * 4] * 2, "face")
    del second.visual
    second.vertices = second.vertices + [3, 0, 0]
    whole = SimpleNamespace(geometry={}, dump=lambda: [first, second])
    for meshes in ([first, second], whole):
        scene = snell.Scene()
        assert scene.add_mesh(meshes) == 0
        hits = scene.cast_rays(([[0, 0.5, 1], [3, -0.5, 1]], [0, 0, -1.0]))
        assert hits.primitive_ids.tolist() == [1, 2]
        assert seen(scene, 0, 0.2)[1] == 0 < seen(scene, 3, 0.2)[1]


def test_of_solid_cells_there_is_the_boundary():
    points = np.eye(4)[:, :3]
    solid = SimpleNamespace(points=points, cells_dict={"tetra": np.array([[0, 1, 2, 3]])})
    scene = snell.Scene()
    scene.add_mesh(solid)
    assert len(scene.mesh(0).faces) == 4
    wire = SimpleNamespace(points=points, cells_dict={"line": [[0, 1]], "triangle": [[0, 1, 2]]})
    with pytest.warns(UserWarning, match="kind line are left out"):
        snell.Scene().add_mesh(wire)


def test_polygons_of_pyvista():
    points = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    for faces in ([4, 0, 1, 2, 3], [3, 0, 1, 2, 3, 0, 2, 3], [3, 0, 1, 2, 4, 0, 1, 2, 3]):
        scene = snell.Scene()
        scene.add_mesh(SimpleNamespace(points=points, faces=np.array(faces)))
        assert scene.test_occlusions([0.7, 0.4, 1, 0, 0, -1])
    assert scene.statistics()["triangles"] == 3
