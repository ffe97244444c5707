"""What a scene holds, and how it changes."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from conftest import sphere_mesh

import snell


def translation(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def rays_along_z(n: int = 9) -> np.ndarray:
    x = np.linspace(-20, 20, n)
    return np.stack([x, 0 * x + 0.1, 0 * x - 50, 0 * x, 0 * x, 0 * x + 1], axis=1)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_objects_come_move_and_go(dtype, sphere):
    scene = snell.Scene()
    rays = np.array([[0, 0.1, -50, 0, 0, 1], [10, 0.1, -50, 0, 0, 1]], dtype=dtype)
    assert np.isinf(scene.cast_rays(rays).t_hit).all()
    mesh = scene.add_mesh(*sphere, name="ball")
    shape = scene.add_shape("sphere", translation(10, 0, 0), radius=2)
    assert scene.cast_rays(rays).geometry_ids.tolist() == [mesh, shape]
    assert scene.ids == [mesh, shape] and scene.names == {mesh: "ball"} and len(scene) == 2
    before = scene.cast_rays(rays)
    scene.update_transform(mesh, translation(0, 0, 5))
    np.testing.assert_allclose(scene.cast_rays(rays).t_hit - before.t_hit, [5, 0], atol=1e-5)
    assert scene.cast_rays(rays).instance_ids.tolist() == [snell.INVALID_ID] * 2
    scene.update_vertices(mesh, sphere[0] * 2)
    assert scene.cast_rays(rays).t_hit[0] < before.t_hit[0] + 4.1
    scene.remove(mesh)
    assert scene.cast_rays(rays).geometry_ids.tolist() == [snell.INVALID_ID, shape]
    with pytest.raises(IndexError, match="id 0 was removed"):
        scene.remove(mesh)
    assert scene.add_shape("sphere", radius=1) == 2
    # Answers from before are unchanged.
    assert before.normals[0, 2] < -0.9


def test_moving_vertices_refits(sphere):
    scene = snell.Scene()
    mesh = scene.add_mesh(*sphere)
    assert scene.statistics()["groups_built"] == 1
    scene.update_vertices(mesh, sphere[0] * 1.1)
    assert scene.statistics()["groups_refitted"] == 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_instances_of_instances_are_as_copies(dtype, sphere, rng):
    leaf, branch, scene = snell.Scene(), snell.Scene(), snell.Scene()
    leaf.add_shape("sphere", translation(0, 3, 0), radius=0.5)
    ball = leaf.add_mesh(*sphere)
    branch.add_instance(leaf, translation(2, 0, 0))
    branch.add_instance(leaf, translation(-2, 0, 0))
    own = scene.add_mesh(sphere[0] + [0, 0, 9], sphere[1])
    left = scene.add_instance(branch, translation(-10, 0, 0))
    right = scene.add_instance(branch, translation(10, 0, 0))
    flat = snell.Scene()
    flat.add_mesh(sphere[0] + [0, 0, 9], sphere[1])
    for x in (-12, -8, 8, 12):
        flat.add_mesh(sphere[0], sphere[1], translation(x, 0, 0))
        flat.add_shape("sphere", translation(x, 3, 0), radius=0.5)
    rays = np.concatenate(
        [rng.normal(size=(40_000, 3)) * 9, rng.normal(size=(40_000, 3))], axis=1
    ).astype(dtype)
    found, expected = scene.cast_rays(rays), flat.cast_rays(rays)
    np.testing.assert_allclose(found.t_hit, expected.t_hit, rtol=1e-5)
    is_hit = np.isfinite(found.t_hit)
    assert is_hit.sum() > 100
    np.testing.assert_allclose(found.points[is_hit], expected.points[is_hit], atol=1e-4)
    np.testing.assert_allclose(found.normals, expected.normals, atol=1e-4)
    side = np.where(found.points[:, 0] < 0, left, right)
    is_own = is_hit & (found.points[:, 2] > 7.5) & (abs(found.points[:, 0]) < 2)
    assert (found.instance_ids[is_hit & ~is_own] == side[is_hit & ~is_own]).all()
    assert (found.instance_ids[is_own] == snell.INVALID_ID).all() and (
        found.geometry_ids[is_own] == own
    ).all()
    assert (found.geometry_ids[is_hit & ~is_own & (found.points[:, 1] < 1.1)] == ball).all()


def test_an_instance_is_what_the_scene_was():
    inner, outer = snell.Scene(), snell.Scene()
    ball = inner.add_shape("sphere", radius=1)
    outer.add_instance(inner)
    inner.remove(ball)
    outer.add_instance(inner, translation(10, 0, 0))
    assert outer.count_intersections([[0, 0, -5, 0, 0, 1], [10, 0, -5, 0, 0, 1]]).tolist() == [2, 0]


def test_a_scene_may_hold_itself_as_it_was():
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1)
    for i in range(10):
        scene.add_instance(scene, translation(3 * 2**i, 0, 0))
    x = 3.0 * np.arange(1024)
    assert scene.test_occlusions((np.stack([x, 0 * x, 0 * x - 5], 1), [0, 0, 1])).all()


def test_instances_nested_too_deep_are_refused():
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1)
    with pytest.raises(ValueError, match="nested more than 500 deep"):
        for _ in range(1000):
            outer = snell.Scene()
            outer.add_instance(scene)
            scene = outer
    assert scene.test_occlusions([0, 0, -5, 0, 0, 1])


def test_too_many_instances_are_an_error_and_not_a_crash():
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1)
    for _ in range(40):
        outer = snell.Scene()
        outer.add_instance(scene)
        outer.add_instance(scene)
        scene = outer
    with pytest.raises(ValueError, match="more than 4294967294 instances"):
        scene.cast_rays([0, 0, -5, 0, 0, 1])


@pytest.mark.parametrize("shape", sorted(snell.SHAPES))
def test_every_shape_is_added_by_its_name_and_parameters(shape):
    values = {
        "radius": 2,
        "inner_radius": 0.5,
        "height": 3,
        "caps": True,
        "bottom_radius": 1.5,
        "top_radius": 0.5,
        "min": [-1, -1, -1],
        "max": np.ones(3),
        "half_size": (1, 2),
        "vertices": np.array([[-1, -1, 0], [2, -1, 0], [-1, 2, 0]]),
    }
    scene = snell.Scene()
    id = scene.add_shape(shape, **{name: values[name] for name in snell.SHAPES[shape]})
    ray = np.array([0.6, 0.1, -5, 0, 0, 1])
    for dtype in (np.float32, np.float64):
        assert scene.cast_rays(ray.astype(dtype)).geometry_ids == id
    assert scene.closest_points(ray[:3]).geometry_ids == id


def test_spheres_in_bulk_are_as_single_ones(rng):
    centers, radii = rng.normal(size=(200, 3)) * 4, rng.uniform(0.1, 0.5, size=200)
    bulk, single = snell.Scene(), snell.Scene()
    bulk.add_spheres(centers, radii)
    for center, radius in zip(centers, radii, strict=True):
        single.add_shape("sphere", translation(*center), radius=float(radius))
    rays = np.concatenate([rng.normal(size=(2000, 3)) * 8, rng.normal(size=(2000, 3))], axis=1)
    found, expected = bulk.cast_rays(rays), single.cast_rays(rays)
    np.testing.assert_array_equal(found.primitive_ids, expected.geometry_ids)
    np.testing.assert_allclose(found.t_hit, expected.t_hit, rtol=1e-9)
    np.testing.assert_allclose(found.normals, expected.normals, atol=1e-9)


def test_shading_normals_and_texture_coordinates_are_interpolated():
    scene = snell.Scene()
    scene.add_mesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [[0, 1, 2]],
        translation(0, 0, 1),
        normals=[[0, 0, 1], [1, 0, 1], [0, 1, 1]],
        uvs=[[0, 0], [2, 0], [0, 4]],
    )
    for dtype in (np.float32, np.float64):
        hits = scene.cast_rays(np.array([0.5, 0.25, 5, 0, 0, -1], dtype=dtype))
        assert hits.uvs.tolist() == [1, 1] and hits.primitive_normals.tolist() == [0, 0, 1]
        np.testing.assert_allclose(
            hits.normals, np.array([0.5, 0.25, 1]) / np.linalg.norm([0.5, 0.25, 1]), rtol=1e-6
        )


def scene_of_everything(sphere) -> snell.Scene:
    inner, scene = snell.Scene(), snell.Scene()
    inner.add_mesh(sphere[0].astype(np.float32), sphere[1], name="inner")
    scene.add_mesh(
        *sphere, translation(5, 0, 0), name="mesh", normals=sphere[0], uvs=sphere[0][:, :2]
    )
    scene.remove(scene.add_shape("disk", radius=1, inner_radius=0))
    scene.add_shape("cone", translation(-5, 0, 0), radius=1, height=2, mask=3)
    scene.add_spheres([[10, 0, 0], [-10, 0, 0]], [1, 2])
    scene.add_instance(inner, translation(15, 0, 0), name="first")
    scene.add_instance(inner, translation(-15, 0, 0))
    return scene


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))]
)
def test_copies_answer_alike_and_are_independent(copied, sphere):
    scene = scene_of_everything(sphere)
    again = copied(scene)
    assert (again.ids, again.names) == (scene.ids, scene.names)
    for dtype in (np.float32, np.float64):
        rays = rays_along_z(17).astype(dtype)
        expected = scene.cast_rays(rays, mask=1)
        assert np.isfinite(expected.t_hit).sum() >= 6
        for name, array in again.cast_rays(rays, mask=1).items():
            np.testing.assert_array_equal(array, expected[name])
    again.remove(0)
    assert len(again) == len(scene) - 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_compact_scenes_are_smaller_and_answer_alike(dtype, rng):
    vertices, faces = sphere_mesh(80, 160)
    scene = snell.Scene()
    assert not scene.compact
    inner = snell.Scene()
    inner.add_mesh(vertices.astype(dtype), faces)
    scene.add_instance(inner, translation(0.1, 0, 0))
    rays = rng.uniform(-1.5, 1.5, (20000, 6)).astype(dtype)
    expected, memory = scene.cast_rays(rays), scene.statistics(dtype)["memory_bytes"]
    assert 4000 < np.isfinite(expected.t_hit).sum() < 20000
    scene.compact = True
    # (In double precision, the corners of each triangle are stored in addition.)
    part = {np.float32: 0.75, np.float64: 0.9}[dtype]
    for other in (scene, copy.copy(scene), pickle.loads(pickle.dumps(scene))):
        assert other.compact
        for name, array in other.cast_rays(rays).items():
            np.testing.assert_array_equal(array, expected[name])
        assert other.statistics(dtype)["memory_bytes"] < part * memory
    scene.compact = False
    assert scene.statistics(dtype)["memory_bytes"] == memory


def test_answers_pickle(sphere):
    scene = scene_of_everything(sphere)
    rays = rays_along_z()
    for answers in (
        scene.cast_rays(rays),
        scene.list_intersections(rays),
        scene.closest_points(rays[:, :3]),
    ):
        again = pickle.loads(pickle.dumps(answers))
        assert type(again) is type(answers) and again.shape == answers.shape
        for name, array in answers.items():
            np.testing.assert_array_equal(again[name], array)


def test_changing_an_answer_or_the_input_changes_nothing_else(sphere):
    scene = snell.Scene()
    vertices, faces = sphere[0].astype(np.float32), sphere[1].copy()
    scene.add_mesh(vertices, faces)
    vertices[:], faces[:] = 0, 0
    hits = scene.cast_rays(rays_along_z())
    hits.t_hit[:] = -1
    hits.primitive_ids[:] = 4_000_000_000
    assert (hits.t_hit == -1).all()
    expected = scene.cast_rays(rays_along_z())
    np.testing.assert_array_equal(hits.points, expected.points)
    assert np.isfinite(expected.t_hit).any()


def test_copying_into_other_scenes_keeps_nothing_alive_for_long(sphere):
    """The process does not grow over many calls."""
    resource = pytest.importorskip("resource")
    scene = snell.Scene()
    mesh = scene.add_mesh(*sphere)
    rays = np.random.default_rng(1).normal(size=(300, 6))

    def work(times: int) -> int:
        for i in range(times):
            scene.update_transform(mesh, translation(i % 5, 0, 0))
            hits = scene.cast_rays(rays)
            hits.points, hits.t_hit  # noqa: B018
            scene.closest_points(rays[:50, :3]).points  # noqa: B018
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = work(100)
    assert work(400) - before < 20_000


def test_files_are_loaded_with_their_names(tmp_path):
    path = tmp_path / "two.obj"
    path.write_text(
        "o left\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no right\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 4 5 6\n"
    )
    for scene in (snell.load(path), snell.load(str(path))):
        hits = scene.cast_rays(([[0.2, 0.2, 1], [5.2, 0.2, 1]], [0, 0, -1]))
        assert hits.t_hit.tolist() == [1, 1]
    with pytest.raises(FileNotFoundError):
        snell.load(tmp_path / "none.obj")
    (tmp_path / "bad.obj").write_text("v 0 0 zero\nf 1 1 1\n")
    with pytest.raises(ValueError, match=r"bad\.obj"):
        snell.load(tmp_path / "bad.obj")


def test_cameras_of_a_file_give_rays(tmp_path):
    gltf = """{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
      "nodes": [{"camera": 0, "name": "eye", "translation": [1, 2, 3]}],
      "cameras": [{"type": "perspective", "name": "eye",
        "perspective": {"yfov": 1.5707963, "znear": 0.1, "aspectRatio": 2}}]}"""
    (tmp_path / "camera.gltf").write_text(gltf)
    scene = snell.load(tmp_path / "camera.gltf")
    assert [camera.name for camera in scene.cameras] == ["eye"]
    assert scene.cameras[0].rays(8, 4).tolist() == scene.create_rays_camera(0, 8, 4).tolist()
    for camera in (None, 0, "eye"):
        rays = scene.create_rays_camera(camera, 8, 4)
        assert rays.shape == (4, 8, 6) and rays.dtype == np.float32
        assert (rays[..., :3] == [1, 2, 3]).all()
        np.testing.assert_allclose(np.linalg.norm(rays[..., 3:], axis=-1), 1, rtol=1e-6)
        np.testing.assert_allclose(rays[0, 0, 3:] / -rays[0, 0, 5], [-1.75, 0.75, -1], rtol=1e-5)
    again = pickle.loads(pickle.dumps(scene))
    np.testing.assert_array_equal(
        again.create_rays_camera(0, 8, 4), scene.create_rays_camera(0, 8, 4)
    )
    with pytest.raises(ValueError, match='camera is "ear"; there is only "eye"'):
        scene.create_rays_camera("ear", 8, 4)
    with pytest.raises(IndexError, match="camera is 1, but the scene has 1"):
        scene.create_rays_camera(1, 8, 4)


def test_what_an_open_pbr_says_of_emission_and_opacity_counts() -> None:
    lamp = snell.Material("open-pbr", emission_luminance=4, geometry_opacity=0.5)
    assert lamp.emission == (4.0, 4.0, 4.0) and lamp.alpha == 0.5 and lamp.alpha_mode == "blend"
    brighter = lamp.replace(emission_luminance=8)
    assert brighter.emission == (8.0, 8.0, 8.0) and brighter.alpha == 0.5
    assert snell.Material("open-pbr", emission=2).emission == (2.0, 2.0, 2.0)


def test_deeply_nested_scenes_are_pickled():
    inner = snell.Scene()
    inner.add_shape("sphere", radius=1)
    step = np.eye(4)
    step[0, 3] = 1
    for _ in range(400):
        outer = snell.Scene()
        outer.add_instance(inner, step)
        inner = outer
    again = pickle.loads(pickle.dumps(inner))
    hits = again.cast_rays([400, 0, 9, 0, 0, -1])
    assert hits.t_hit == 8 and hits.instance_paths.shape == (400,)


def test_scenes_that_are_shared_are_pickled_once():
    inner = snell.Scene()
    inner.add_mesh(np.random.default_rng(0).random((3000, 3)), np.arange(3000).reshape(-1, 3))
    outer, more = snell.Scene(), snell.Scene()
    outer.add_instances(inner, np.tile(np.eye(4), (50, 1, 1)))
    more.add_instance(outer)
    more.add_instance(inner)
    stored = pickle.dumps(more)
    assert len(stored) < 3 * 3000 * 24
    again = pickle.loads(stored)
    assert again.bounds.tolist() == more.bounds.tolist()
    assert again.instance(1).mesh(0).vertices.shape == (3000, 3)
