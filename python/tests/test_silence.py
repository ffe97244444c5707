"""What a scene is told is done, refused or warned about."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import snell

QUAD = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
FACES = [[0, 1, 2], [0, 2, 3]]


@pytest.fixture
def scene() -> snell.Scene:
    made = snell.Scene()
    made.add_shape("sphere", radius=1, material=snell.Material("diffuse", reflectance=0.5))
    return made


def test_lists_write_through(scene):
    camera, light = (
        snell.Camera(eye=(0, 0, 5)),
        snell.Light("point", position=(0, 3, 0), intensity=1),
    )
    scene.cameras.append(camera)
    scene.lights += [light, light]
    scene.lights.pop()
    assert len(scene.cameras) == 1 and len(scene.lights) == 1
    scene.cameras[0] = snell.Camera(eye=(0, 0, 9))
    assert scene.cameras[0].eye == (0, 0, 9)
    scene.materials[0] = snell.Material("diffuse", reflectance=0.25)
    assert scene.materials[0].reflectance == (0.25, 0.25, 0.25)
    scene.names[0] = "ball"
    assert scene.names == {0: "ball"} and scene["ball"] == 0
    del scene.names[0]
    assert scene.names == {}
    assert type(pickle.loads(pickle.dumps(scene.cameras))) is list


def test_what_cannot_be_changed_says_what_can(scene):
    with pytest.raises(TypeError, match="objects bring their materials"):
        scene.materials.append(snell.Material("diffuse", reflectance=1))
    with pytest.raises(TypeError, match=r"remove\(id\) removes them"):
        scene.ids.remove(0)
    old = scene.cameras
    scene.add_camera(snell.Camera(eye=(0, 0, 5)))
    with pytest.raises(RuntimeError, match=r"read scene\.cameras again"):
        old.append(snell.Camera(eye=(0, 0, 5)))
    with pytest.raises(IndexError, match="id 7 is not in the scene"):
        scene.names[7] = "nothing"
    scene.names = {0: "ball"}
    assert scene["ball"] == 0
    for name, remedy in {
        "ids": r"remove\(id\)",
        "bounds": "update_transform",
        "materials": "replace_material",
    }.items():
        with pytest.raises(AttributeError, match=remedy):
            setattr(scene, name, [])
    light = snell.Light("point", position=(0, 3, 0), intensity=1)
    for thing, name, remedy in [
        (scene.cameras[0], "fov", r"replace\(fov=…\) makes another"),
        (light, "intensity", r"replace\(intensity=…\) makes another"),
        (scene.cast_rays([0, 0, 5, 0, 0, -1]), "t_hit", "a copy of the array"),
        (scene.mesh(scene.add_mesh(QUAD, FACES)), "uvs", "update_vertices"),
    ]:
        with pytest.raises(AttributeError, match=remedy):
            setattr(thing, name, 1)


def test_a_sky_is_scaled_and_turned():
    def seen(**options: object) -> np.ndarray:
        scene = snell.Scene()
        scene.set_environment("sky", **options)
        up = snell.Camera(eye=(0, 0, 0), towards=(0, 1, 0.1))
        return snell.render(scene, "path", camera=up, size=(4, 4), spp=1).pixels.mean((0, 1))

    plain = seen()
    np.testing.assert_allclose(seen(scale=(2, 1, 0.5)), plain * [2, 1, 0.5], rtol=1e-5)
    upside_down = np.diag([1.0, -1, -1, 1])
    assert abs(seen(transform=upside_down) / plain - 1).max() > 0.1
    scene = snell.Scene()
    scene.set_environment(0.5, scale=3)
    assert scene.environment == (1.5, 1.5, 1.5)


def test_what_a_format_cannot_hold_is_named(scene, tmp_path):
    scene.add_light(snell.Light("point", position=(0, 3, 0), intensity=1))
    scene.add_shape("plane")
    with pytest.warns(snell.SceneWarning) as caught:
        scene.save(tmp_path / "scene.ply")
    said = " | ".join(str(warning.message) for warning in caught)
    for loss in ("light", "materials are left out", "plane"):
        assert loss in said
    inner = snell.Scene()
    inner.add_instance(scene)
    scene.update_mask(0, 1)
    inner.add_instance(scene)
    with pytest.warns(snell.SceneWarning, match="masks are left out"):
        inner.save(tmp_path / "scene.snell")


def test_values_of_other_units_are_warned_about(scene):
    with pytest.warns(UserWarning, match=r"background: .* given as \"#rrggbb\""):
        scene.background = (255, 255, 255)
    with pytest.warns(UserWarning, match=r"fov is 0\.5 degrees; .* math\.degrees\(0\.5\)"):
        snell.Camera(eye=(0, 0, 5), fov=0.5)
    checks = snell.Material("diffuse", reflectance=snell.Texture([[0.2, 0.8]]))
    with pytest.warns(UserWarning, match="no texture coordinates"):
        scene.add_mesh(QUAD, FACES, material=checks)
    plain = scene.add_mesh(QUAD, FACES, uvs=[[0, 0], [1, 0], [1, 1], [0, 1]], material=checks)
    assert scene.mesh(plain).materials[0].reflectance.size == [2, 1]


def test_masked_and_missing_numbers_are_refused(scene):
    masked = np.ma.masked_array(np.eye(3), mask=np.eye(3) > 0)
    for ask in (scene.distance, lambda points: scene.add_mesh(points, FACES)):
        with pytest.raises(ValueError, match="3 of 9 numbers are masked"):
            ask(masked)
    assert scene.distance(np.ma.masked_array([2.0, 0, 0])) == 1


def test_a_camera_matrix_has_its_size():
    camera = snell.Camera(
        "intrinsics",
        eye=(0, 0, 0),
        focal_length=(500, 500),
        principal_point=(320, 240),
        size=(64, 48),
    )
    assert camera.rays().shape == (48, 64, 6)
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1)
    picture = snell.render(scene, "flat", camera=camera, spp=1, progress=False)
    assert picture.pixels.shape[:2] == (48, 64)


def test_what_was_put_in_can_be_read_back(scene):
    colors = np.full((4, 3), 255, dtype=np.uint8)
    materials = [snell.Material("diffuse", reflectance=x) for x in (0.25, 0.75)]
    mesh = scene.add_mesh(
        np.float32(QUAD),
        FACES,
        normals=[[0, 0, 1]] * 4,
        uvs=[[0, 0], [1, 0], [1, 1], [0, 1]],
        colors=colors,
        material=materials,
        material_ids=[1, 0],
    )
    got = scene.mesh(mesh)
    vertices, faces = got
    np.testing.assert_array_equal(vertices, QUAD)
    np.testing.assert_array_equal(faces, FACES)
    assert got.normals.shape == (4, 3) and got.uvs[2].tolist() == [1, 1]
    assert (got.colors == 1).all() and got.material_ids.tolist() == [1, 0]
    assert [m.reflectance[0] for m in got.materials] == [0.25, 0.75]
    assert pickle.loads(pickle.dumps(got)).uvs.tolist() == got.uvs.tolist()
    hits = scene.cast_rays([[0.5, -0.5, 5, 0, 0, -1], [-0.5, 0.5, 5, 0, 0, -1], [9, 9, 9, 0, 0, 1]])
    assert hits.geometry_ids[:2].tolist() == [0, 0]
    scene.update_mask(0, 2)
    hits = scene.cast_rays(
        [[0.5, -0.5, 5, 0, 0, -1], [-0.5, 0.5, 5, 0, 0, -1], [9, 9, 9, 0, 0, 1]], mask=1
    )
    seen = [scene.materials[i].reflectance[0] for i in hits.material_ids[:2]]
    assert seen == [0.75, 0.25] and hits.material_ids[2] == snell.INVALID_ID
    shape = scene.shape(0)
    assert shape == {"shape": "sphere", "radius": 1.0}
    assert scene.shape(scene.add_shape(**shape)) == shape
    outer = snell.Scene()
    inner = outer.add_instance(scene, material=materials[0])
    assert outer.instance(inner).ids == scene.ids
    for wrong in (outer.mesh, outer.shape):
        with pytest.raises(TypeError, match="id 0 is not a"):
            wrong(inner)
    scene.names[0] = scene.names[mesh] = "twin"
    with pytest.raises(KeyError, match="2 objects are called"):
        scene["twin"]
    with pytest.raises(KeyError, match=r"did you mean .*twin"):
        scene["twim"]


MESSAGES = [
    (lambda s: s.cast_rays(np.zeros((4, 3)), np.ones((4, 3))), r"cast_rays\(\(origins, direct"),
    (lambda s: s.cast_rays([np.zeros((4, 3)), np.ones((4, 3))]), r"a tuple: \(origins, direc"),
    (lambda s: s.cast_rays([np.zeros((4, 3)), np.ones(3)]), r"a tuple: \(origins, directions\)"),
    (lambda s: s.distance(s), r"points is a snell\.Scene, expected an array"),
    (lambda s: s.cast_rays([0, 0, 5, 0, 0, -1], mask=-1), "mask is -1, expected 64 bits"),
    (lambda s: s.cast_rays([0, 0, 5, 0, 0, -1], mask=1 << 64), "expected 64 bits"),
    (lambda s: s.cast_rays([0, 0, 5, 0, 0, -1], threads=-1), "threads is -1, expected 1 to"),
    (lambda s: s.add_shape("cube"), 'there is no shape "cube"; it is called "box"'),
    (lambda s: s.update_transform(0, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [1, 2, 3, 1]]),
     "made for row vectors: transpose it"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), MESSAGES)
def test_messages_say_the_remedy(scene, call, message):
    with pytest.raises((TypeError, ValueError), match=message):
        call(scene)
