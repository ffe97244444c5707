"""Texels of meshes."""

from __future__ import annotations

import numpy as np
import pytest

import snell

CORNERS = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1.0]])
FACES = [[0, 2, 1], [0, 3, 2]]
UVS = np.array([[0.0, 0], [0.5, 0], [0.5, 1], [0, 1]])


def test_texels_know_their_points():
    scene = snell.Scene()
    move = np.eye(4)
    move[:3, 3] = 10, 20, 30
    floor = scene.add_mesh(CORNERS, FACES, move, uvs=UVS)
    baked = snell.bake(scene, floor, (8, 4))
    assert baked.points.shape == (16, 3) and baked.size == (8, 4)
    rows, columns = baked.texels.T
    expected = np.stack(
        [9 + (columns + 0.5) / 2, np.full(16, 20.0), 29 + (rows + 0.5) / 2], axis=-1
    )
    assert np.abs(baked.points - expected).max() < 1e-6
    assert np.abs(baked.normals - [0, 1, 0]).max() < 1e-12
    picture = baked.image(columns, margin=1, empty=-1)
    assert picture[0].tolist() == [0, 1, 2, 3, 3, -1, -1, -1]
    assert baked.image(baked.points).shape == (4, 8, 3)


def test_ambient_occlusion_is_the_part_of_the_sky_that_is_seen():
    scene = snell.Scene()
    floor = scene.add_mesh(CORNERS * 1e-3, FACES, uvs=UVS)
    assert snell.bake(scene, floor, 4).ambient_occlusion().tolist() == [1] * 8
    # A disk of radius 1 at a height of 1 takes half of the light of a uniform sky.
    disk = scene.add_shape("disk", [[1, 0, 0, 0], [0, 0, 1, 1], [0, 1, 0, 0]], radius=1, mask=2)
    baked = snell.bake(scene, floor, 4)
    assert np.abs(baked.ambient_occlusion(1024) - 0.5).max() < 0.01
    assert baked.ambient_occlusion(64, mask=1).min() == 1
    assert baked.ambient_occlusion(64, distance=0.9).min() == 1
    scene.remove(disk)
    assert snell.bake(scene, floor, 4).ambient_occlusion().min() == 1


def test_what_cannot_be_baked_is_refused():
    scene = snell.Scene()
    bare = scene.add_mesh(CORNERS, FACES)
    wide = scene.add_mesh(CORNERS, FACES, uvs=UVS * 3)
    with pytest.raises(ValueError, match="no texture coordinates"):
        snell.bake(scene, bare, 4)
    with pytest.warns(UserWarning, match="outside of 0 to 1"):
        snell.bake(scene, wide, 4)
    with pytest.raises(ValueError, match="size is 0"):
        snell.bake(scene, bare, 0)
    with pytest.raises(ValueError, match="there are 3, expected 16"):
        snell.bake(scene, scene.add_mesh(CORNERS, FACES, uvs=UVS), (8, 4)).image([1, 2, 3])


def test_irradiance_is_that_of_lights_and_bounces():
    scene = snell.Scene()
    grey = snell.Material("diffuse", reflectance=0.1)
    floor = scene.add_mesh(CORNERS, FACES, uvs=UVS, material=grey)
    baked = snell.bake(scene, floor, 8)
    lamp = baked.points.mean(axis=0) + 2 * baked.normals[0] + [0.1, 0.1, 0.1]
    scene.add_light(snell.Light("point", position=tuple(lamp), intensity=(8, 4, 2)))
    way = lamp - baked.points
    cosine = (way * baked.normals).sum(axis=1)
    expected = cosine / np.linalg.norm(way, axis=1) ** 3
    found = snell.bake(scene, floor, 8).irradiance(samples=2)
    assert found.dtype == np.float32 and found.shape == (len(expected), 3)
    assert np.allclose(found, expected[:, None] * [8, 4, 2], rtol=1e-3)
    # A furnace: walls that shine 1 and reflect a half are seen to shine 2.
    room = snell.Scene()
    corners = np.array([[x, y, z] for x in (-9, 9) for y in (-9, 9) for z in (-9, 9.0)])
    inwards = [[0, 3, 1], [0, 2, 3], [4, 7, 6], [4, 5, 7], [0, 5, 4], [0, 1, 5]]
    inwards += [[2, 7, 3], [2, 6, 7], [0, 6, 2], [0, 4, 6], [1, 7, 5], [1, 3, 7]]
    glowing = snell.Material("diffuse", reflectance=0.5, emission=1)
    room.add_mesh(corners, inwards, material=glowing)
    inside = room.add_mesh(CORNERS * 0.1, FACES, uvs=UVS)
    light = snell.bake(room, inside, 2).irradiance(samples=256, max_depth=30)
    assert np.allclose(light, 2 * np.pi, rtol=0.1), light
    again = snell.bake(room, inside, 2).irradiance(samples=256, max_depth=30, threads=1)
    assert (again == light).all()
    assert np.allclose(snell.bake(room, inside, 2).irradiance(max_depth=0), np.pi, rtol=0.1)
    far = snell.Scene()
    there = np.asarray(CORNERS) + [448262, 5411932, 119]
    far_floor = far.add_mesh(there, FACES, uvs=UVS)
    far.environment = 1.0
    assert np.allclose(snell.bake(far, far_floor, 2).irradiance(samples=64), np.pi, rtol=0.01)
