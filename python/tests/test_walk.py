"""What was put into a scene is found again."""

from __future__ import annotations

import numpy as np
import pytest

import snell


def test_children_tell_everything_of_the_objects():
    inner, scene = snell.Scene(), snell.Scene()
    inner.add_shape("sphere", radius=2, name="ball")
    red = snell.Material("diffuse", reflectance=(1, 0, 0))
    place = np.eye(4)
    place[0, 3] = 5
    mesh = scene.add_mesh(np.eye(3), [[0, 1, 2]], place, "triangle", mask=6, material=red)
    cloud = scene.add_spheres(np.eye(3, dtype=np.float32), [1, 2, 3])
    wire = scene.add_curves([[0, 0, 0], [0, 1, 0], [1, 1, 0]], 0.25, basis="linear")
    keys = np.stack([np.eye(4), place])
    copy = scene.add_instance(inner, keys, "copy", times=[2, 3])
    gone = scene.add_shape("sphere", radius=1)
    scene.remove(gone)
    nodes = scene.children
    assert [node.id for node in nodes] == [mesh, cloud, wire, copy] == list(scene.ids)
    assert [node.kind for node in nodes] == ["mesh", "spheres", "curves", "instance"]
    assert [node.name for node in nodes] == ["triangle", None, None, "copy"]
    assert nodes[0].mask == 6 and (nodes[0].transform == place).all()
    assert repr(nodes[0].materials) == repr([red]) and nodes[1].materials == []
    vertices, faces = nodes[0].content
    assert (vertices == np.eye(3)).all() and faces.tolist() == [[0, 1, 2]]
    assert nodes[1].content["centers"].dtype == np.float32
    assert nodes[1].content["radii"].tolist() == [1, 2, 3]
    assert nodes[2].content["basis"] == "linear" and nodes[2].content["strands"].tolist() == [3]
    assert nodes[3].motion[1].tolist() == [2, 3] and nodes[0].motion is None
    assert nodes[3].children[0].content == {"shape": "sphere", "radius": 2.0}
    assert nodes[0].children == []
    with pytest.raises(AttributeError, match="update_transform"):
        nodes[0].transform = place
    with pytest.raises(AttributeError, match="add objects"):
        scene.children = []
    with pytest.raises(TypeError, match="cannot be changed"):
        nodes.append(nodes[0])
    with pytest.raises(TypeError, match="id 0 is not a set of spheres"):
        scene.spheres(mesh)
    with pytest.raises(TypeError, match="id 0 is not curves"):
        scene.curves(mesh)
    # They stay as they were.
    scene.remove(mesh)
    assert nodes[0].content.faces.tolist() == [[0, 1, 2]] and len(scene.children) == 3


def test_what_is_read_can_be_added_again():
    scene, again = snell.Scene(), snell.Scene()
    scene.add_spheres([[0, 0, 0], [3, 0, 0]], [1, 0.5])
    scene.add_curves([[0, 0, 0], [0, 1, 0], [0, 5, 0], [1, 5, 0]], 0.25, [2, 2], basis="linear")
    scene.add_shape("box", min=[5, 5, 5], max=[6, 6, 6])
    again.add_spheres(**scene.spheres(0))
    again.add_curves(**scene.curves(1))
    again.add_shape(**scene.shape(2))
    rng = np.random.default_rng(2)
    rays = np.concatenate([rng.uniform(-9, 9, (500, 3)), rng.normal(size=(500, 3))], axis=1)
    assert (again.cast_rays(rays).t_hit == scene.cast_rays(rays).t_hit).all()


def test_a_walk_finds_each_object_where_rays_hit_it():
    wheel, car, street = snell.Scene(), snell.Scene(), snell.Scene()
    wheel.add_shape("sphere", radius=0.5, name="tyre")
    place = lambda x, y: np.array([[0, -1, 0, x], [1, 0, 0, y], [0, 0, 1, 0.0]])  # noqa: E731
    for x in (-2, 2):
        car.add_instance(wheel, place(x, 0))
    car.add_shape("box", min=[-3, -1, 1], max=[3, 1, 2], name="body")
    for y in (0, 10):
        street.add_instance(car, place(0, y), name=f"car {y}")
    found = {}
    for path, node, transform in street.walk():
        if node.kind != "instance":
            center = transform @ [0, 0, 1.5 if node.name == "body" else 0, 1]
            found[path, node.id] = center[:3]
    assert len(found) == 6 and next(iter(found)) == ((0, 0), 0)
    centers = np.array(list(found.values()))
    hits = street.cast_rays((centers - [0, 0, 30], [0, 0, 1.0]))
    for (path, id), hit in zip(found, range(6), strict=True):
        if id == 0:
            assert hits.instance_paths[hit].tolist() == list(path)
            assert hits.geometry_ids[hit] == id


def test_a_heightfield_is_read_back_as_its_mesh():
    scene = snell.Scene()
    scene.add_heightfield(np.zeros((3, 4)))
    vertices, faces = scene.children[0].content
    assert vertices.shape == (12, 3) and faces.shape == (12, 3)
