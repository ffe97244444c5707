"""Integers are 8-bit or 16-bit sRGB, in and out; floats are linear."""

from __future__ import annotations

import numpy as np
import pytest

import snell

QUAD = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
FACES = [[0, 1, 2], [0, 2, 3]]


def seen(colors: object) -> np.ndarray:
    scene = snell.Scene()
    white = snell.Material("diffuse", reflectance=1)
    scene.add_mesh(QUAD, FACES, colors=colors, material=white)
    camera = snell.Camera(eye=(0, 0, 1))
    return snell.render(scene, "flat", camera=camera, spp=1, size=(4, 4)).pixels[2, 2]


def test_colors_of_vertices():
    grey = ((51 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(seen(np.full((4, 3), 51, dtype=np.uint8)), grey, rtol=1e-5)
    np.testing.assert_allclose(seen(np.full((4, 3), 51 * 257, dtype=np.uint16)), grey, rtol=1e-5)
    np.testing.assert_allclose(seen(np.full((4, 3), 0.25)), 0.25, rtol=1e-5)
    np.testing.assert_allclose(seen([[1, 1, 1]] * 4), 1, rtol=1e-5)
    with pytest.raises(ValueError, match="colors: dtype is int64, from 0 to 255; expected uint8"):
        seen([[0, 255, 0]] * 4)
    with pytest.warns(UserWarning, match="colors: whole numbers up to 255"):
        seen([[0, 255.0, 0]] * 4)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_pictures_of_bytes_come_back_to_the_level(channels):
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(channels, axis=2)
    if channels == 4:
        levels[..., 3] = 200
    back = snell.Image(levels).to_uint8()
    np.testing.assert_array_equal(back[..., : levels.shape[2]], levels[..., :4])
    with pytest.warns(UserWarning, match="pixels: whole numbers up to 255"):
        snell.Image(levels.astype(float))
    with pytest.raises(ValueError, match="pixels: dtype is int64"):
        snell.Image(levels.astype(int))


def test_float_textures_of_bytes_are_warned_about():
    with pytest.warns(UserWarning, match="image: whole numbers up to 200"):
        snell.Texture(np.full((2, 2, 3), 200.0))
    assert snell.Texture([[0.2, 0.3]], wrap="clamp").__reduce__()
    assert "wrap=('clamp', 'clamp')" in repr(snell.Texture([[0.2, 0.3]], wrap="clamp"))


def test_ply_has_the_bytes_that_were_given(tmp_path):
    colors = np.arange(12, dtype=np.uint8).reshape(4, 3) * 20
    scene = snell.Scene()
    scene.add_mesh(np.float32(QUAD), FACES, colors=colors)
    with pytest.warns(snell.SceneWarning, match="flat shading"):
        scene.save(tmp_path / "quad.ply")
    header, _, body = (tmp_path / "quad.ply").read_bytes().partition(b"end_header\n")
    for name in ("red", "green", "blue", "alpha"):
        assert f"property uchar {name}\n".encode() in header
    vertices = np.frombuffer(body[: 4 * 16], dtype=np.uint8).reshape(4, 16)
    np.testing.assert_array_equal(vertices[:, 12:15], colors)
    assert (vertices[:, 15] == 255).all()


def test_a_mesh_with_colours_and_no_material_has_just_these():
    colors = np.array([[200, 30, 90]] * 4, np.uint8)
    scene = snell.Scene()
    scene.add_mesh(QUAD, FACES, colors=colors)
    scene.add_mesh(np.add(QUAD, [9, 0, 0]), FACES)
    ray = [0.1, 0.2, 5, 0, 0, -1]
    linear = np.where(
        colors[0] / 255 <= 0.04045,
        colors[0] / 255 / 12.92,
        ((colors[0] / 255 + 0.055) / 1.055) ** 2.4,
    )
    assert np.allclose(scene.cast_rays(ray).albedo, linear, atol=1e-5)
    assert (scene.cast_rays(np.add(ray, [9, 0, 0, 0, 0, 0])).albedo < 0.9).all()
    camera = snell.Camera(eye=(0, 0, 5), target=(0, 0, 0), fov=10)
    look = {"camera": camera, "spp": 1, "size": (4, 4), "aovs": ["albedo"], "progress": False}
    assert np.allclose(snell.render(scene, "flat", **look).aovs["albedo"], linear, atol=1e-4)
