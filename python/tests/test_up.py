"""Scenes in which another direction than y is up."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import snell

# From axes in which y is up to those in which z is up.
TURN = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])


def thing(turn: np.ndarray, up: str) -> snell.Scene:
    """A small still life that is turned as a whole."""
    scene = snell.Scene()
    scene.up = up
    place = np.eye(4)
    place[:3, 3] = 0.7, 0.2, 1.4
    scene.add_shape("box", turn, min=[-1, 0, -0.5], max=[1, 1, 0.5])
    scene.add_shape("cone", turn @ place, radius=0.6, height=2)
    return scene


def picture(scene: snell.Scene, **options) -> np.ndarray:
    return np.asarray(
        snell.render(scene, "direct", spp=16, size=(48, 36), progress=False, **options)
    )


def test_the_default_camera_light_and_floor_follow_up():
    usual, turned = picture(thing(np.eye(4), "y")), picture(thing(TURN, "z"))
    assert np.abs(usual - turned).mean() < 0.01
    fallen = picture(thing(TURN, "y"))
    assert np.abs(usual - fallen).mean() > 0.03


def test_environments_turn_with_up_whatever_comes_first():
    sky = np.zeros((16, 32, 3), np.float32)
    sky[:8] = [0.2, 0.4, 1.0]
    sky[8:, 12:20] = [1.0, 0.3, 0.1]
    camera = snell.Camera(eye=(3, 1.5, 5), target=(0, 0.5, 0), fov=50)
    z_up = snell.Camera(eye=(3, -5, 1.5), target=(0, 0, 0.5), up=(0, 0, 1), fov=50)
    usual = thing(np.eye(4), "y")
    usual.environment = sky
    expected = picture(usual, camera=camera)
    first, last = thing(TURN, "z"), thing(TURN, "y")
    first.environment = sky
    last.environment = sky
    last.up = "z"
    for scene in (first, last):
        assert np.abs(picture(scene, camera=z_up) - expected).mean() < 0.01
    fixed = thing(TURN, "z")
    fixed.set_environment(sky, transform=TURN)
    assert np.abs(picture(fixed, camera=z_up) - expected).mean() < 0.01


def test_up_is_read_kept_and_checked(tmp_path):
    scene = thing(TURN, "z")
    assert snell.Scene().up == "y" and scene.up == "z"
    scene.background = "studio"
    scene.save(tmp_path / "a.snell")
    assert snell.load(tmp_path / "a.snell").up == "z"
    assert pickle.loads(pickle.dumps(scene)).up == "z"
    scene.up = (0, 3, 4)
    assert np.allclose(scene.up, (0, 0.6, 0.8))
    for bad in ("up", (0, 0, 0), (1, 2), 3, None, (np.nan, 0, 1)):
        with pytest.raises((ValueError, TypeError), match="up"):
            scene.up = bad


@pytest.mark.filterwarnings("ignore::snell.SceneWarning")
def test_gltf_is_turned_and_other_formats_say_what_is_lost(tmp_path):
    scene = thing(TURN, "z")
    scene.add_camera(snell.Camera(eye=(3, -5, 1.5), target=(0, 0, 0.5), up=(0, 0, 1), fov=50))
    scene.add_light(snell.Light("directional", direction=(0.3, 0.5, -1), irradiance=2))
    expected = picture(scene)
    scene.save(tmp_path / "a.glb")
    loaded = snell.load(tmp_path / "a.glb")
    assert loaded.up == "y"
    assert np.allclose(loaded.bounds, thing(np.eye(4), "y").bounds, atol=1e-5)
    assert np.abs(picture(loaded) - expected).mean() < 0.02
    mesh = snell.Scene()
    mesh.up = "z"
    mesh.add_mesh(np.eye(3), [[0, 1, 2]])
    with pytest.warns(snell.SceneWarning, match="that 0 0 1 is up is left out"):
        mesh.save(tmp_path / "a.obj")
    mesh.save(tmp_path / "a.stl")
    assert snell.load(tmp_path / "a.stl").up == "z"
