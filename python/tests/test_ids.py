"""Layers of ids in pictures have the ids that queries give."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import sphere_mesh

import snell

SIZE = (48, 32)


def moved(x: float) -> np.ndarray:
    return np.array([[1.0, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]])


def table() -> snell.Scene:
    """Objects of every kind, in instances and not, after some were removed."""
    ball, pair, scene = snell.Scene(), snell.Scene(), snell.Scene()
    gone = ball.add_shape("box", min=[-9, -9, -9], max=[9, 9, 9])
    ball.add_shape("sphere", radius=0.4)
    ball.remove(gone)
    pair.add_mesh(np.eye(3), [[0, 1, 2]], moved(90))
    pair.add_instance(ball, moved(-0.5))
    pair.add_instance(ball, moved(0.5))
    alone = snell.Scene()
    alone.remove(alone.add_shape("sphere", radius=1))
    alone.add_mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    gone = scene.add_shape("box", min=[-9, -9, -9], max=[9, 9, 9])
    scene.add_spheres([[-3, 1, 0], [-3, -1, 0], [-4, 0, 0]], [0.4, 0.4, 0.5])
    scene.remove(gone)
    scene.add_instance(pair, moved(-1))
    scene.add_instance(pair, moved(1.5))
    scene.add_instance(alone, moved(4))
    scene.add_instance(alone, moved(6))
    scene.add_mesh([[-8, -2, -1], [8, -2, -1], [8, 2, -1], [-8, 2, -1]], [[0, 1, 2], [0, 2, 3]])
    return scene


def check(scene: snell.Scene, names: list[str]) -> None:
    camera = snell.Camera("orthographic", eye=(1, 0, 9), half_size=(7, None))
    aovs = [*names, "position", "depth"]
    picture = snell.render(scene, "aov", camera=camera, size=SIZE, spp=1, aovs=aovs)
    assert list(picture.aovs) == aovs
    # The ray of the sample whose point is in the layer of positions.
    origins = picture.aovs["position"].astype(float)
    origins[..., 2] = 9
    hits = scene.cast_rays((origins, [0, 0, -1.0]))
    arrays = {
        "geometry-id": hits.geometry_ids,
        "instance-id": hits.instance_ids,
        "primitive-id": hits.primitive_ids,
    }
    for name in names:
        layer, seen = picture.aovs[name], picture.aovs["position"].any(axis=-1)
        assert seen.sum() > 100 and (layer[~seen] == -1).all()
        np.testing.assert_array_equal(layer[seen], arrays[name].astype(np.int32)[seen], name)


@pytest.mark.parametrize(
    "names", [["geometry-id"], ["instance-id"], ["primitive-id", "geometry-id", "instance-id"]]
)
def test_ids_are_those_of_queries(names):
    check(table(), names)


def test_ids_of_files_are_those_of_queries(tmp_path):
    table().save(tmp_path / "table.snell")
    scene = snell.load(tmp_path / "table.snell")
    names = ["geometry-id", "instance-id", "primitive-id"]
    check(scene, names)
    scene.remove(scene.ids[0])
    check(scene, names)


def test_surfaces_of_one_node_are_objects_of_their_own(tmp_path):
    """A node of glTF has one surface for each material of a mesh."""
    vertices, faces = sphere_mesh(8, 16, 2.0)
    materials = [snell.Material("diffuse", reflectance=x) for x in (0.2, 0.5, 0.8)]
    scene = snell.Scene()
    for x in (-2, 4):
        slots = np.arange(len(faces)) % 3
        scene.add_mesh(vertices + [x, 0, 0], faces, material=materials, material_ids=slots)
    scene.save(tmp_path / "balls.glb")
    loaded = snell.load(tmp_path / "balls.glb")
    assert len(loaded) == 6
    check(loaded, ["geometry-id", "primitive-id"])
