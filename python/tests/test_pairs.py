"""Pairs of scenes: distances, collisions, moments of contact."""

from __future__ import annotations

import itertools
import os
import signal
import threading
from fractions import Fraction

import numpy as np
import pytest
from conftest import sphere_mesh

import snell

CUBE = {"min": [0, 0, 0], "max": [1, 1, 1]}


def scene_of(vertices, faces, **options) -> snell.Scene:
    scene = snell.Scene()
    scene.add_mesh(vertices, faces, **options)
    return scene


def cube() -> snell.Scene:
    scene = snell.Scene()
    scene.add_shape("box", **CUBE)
    return scene


def at(*offset: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def turned(rng, count: int, away: float) -> np.ndarray:
    turns, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = turns * np.sign(np.linalg.det(turns))[:, None, None]
    place = rng.normal(size=(count, 3))
    matrices[:, :3, 3] = away * place / np.linalg.norm(place, axis=1, keepdims=True)
    return matrices


def soup(rng, count: int) -> tuple[np.ndarray, np.ndarray]:
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, 0.15, (count, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def exact_height(a, b, c, d) -> int:
    """The sign of a determinant, in fractions."""
    u, v, w = ([Fraction(x) - Fraction(y) for x, y in zip(p, d, strict=True)] for p in (a, b, c))
    value = (
        u[0] * (v[1] * w[2] - v[2] * w[1])
        - u[1] * (v[0] * w[2] - v[2] * w[0])
        + u[2] * (v[0] * w[1] - v[1] * w[0])
    )
    return (value > 0) - (value < 0)


def exactly_meet(p, q) -> bool:
    """Whether two triangles in general position meet: an edge of one goes through the other."""
    for one, other in ((p, q), (q, p)):
        for i in range(3):
            u, v = one[i], one[(i + 1) % 3]
            if exact_height(*other, u) * exact_height(*other, v) >= 0:
                continue
            sides = {exact_height(u, other[k], other[(k + 1) % 3], v) for k in range(3)}
            if not {1, -1} <= sides:
                return True
    return False


def test_a_pair_says_how_far_where_and_what():
    needle = scene_of([[9, 9, 9], [0, 0, 0], [1, 0.5, 0], [1, -0.5, 0.1]], [[0, 0, 0], [1, 2, 3]])
    near = snell.closest_pair(needle, cube(), transform_a=at(3, 0.5, 0.25))
    assert near.distance == 2 and near.is_found is True
    np.testing.assert_allclose(near.points, [[3, 0.5, 0.25], [1, 0.5, 0.25]])
    assert near.primitive_ids.tolist() == [1, 1]  # The second triangle, and the face +x.
    assert near.geometry_ids.tolist() == [0, 0]
    assert near.instance_ids.tolist() == [snell.INVALID_ID] * 2
    assert repr(near) == "<snell.ClosestPair: distance 2>"


def test_poses_are_answered_as_one_at_a_time_on_any_number_of_threads(rng, sphere):
    a, b = scene_of(*sphere), scene_of(*sphere_mesh(9, 14))
    poses, others = turned(rng, 40, 2.0), turned(rng, 40, 0.3)
    both = {"transform_a": poses, "transform_b": others}
    whole = snell.closest_pair(a, b, **both)
    assert whole.distance.shape == (40,) and whole.points.shape == (40, 2, 3)
    assert repr(whole) == "<snell.ClosestPair: 40 poses>"
    np.testing.assert_array_equal(snell.collides(a, b, **both), whole.distance == 0)
    assert 0 < (whole.distance == 0).sum() < 40
    for threads in (1, 3):
        again = snell.closest_pair(a, b, **both, threads=threads)
        for name in ("distance", "points", "geometry_ids", "primitive_ids", "instance_ids"):
            np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    for i in (0, 7, 39):
        one = snell.closest_pair(a, b, transform_a=poses[i], transform_b=others[i])
        assert one.distance == whole.distance[i]
        np.testing.assert_array_equal(one.points, whole.points[i])
    # One pose stands for all of the other side, and three rows for four.
    same = snell.closest_pair(a, b, transform_a=poses[:, :3], transform_b=others[0])
    assert same.distance.shape == (40,)
    assert snell.closest_pair(a, b, transform_a=poses[:0]).distance.shape == (0,)


def test_no_point_of_one_is_nearer_to_the_other(rng):
    for _ in range(20):
        (va, fa), (vb, fb) = soup(rng, 60), soup(rng, 50)
        vb = vb + rng.normal(size=3) * 2
        a, b = scene_of(va, fa), scene_of(vb, fb)
        near = snell.closest_pair(a, b)
        weights = rng.dirichlet(np.ones(3), 4000)
        samples = np.einsum("nk,nkd->nd", weights, va[fa[rng.integers(60, size=4000)]])
        assert near.distance <= b.distance(samples).min() + 1e-12
        np.testing.assert_allclose(np.linalg.norm(near.points[1] - near.points[0]), near.distance)
        assert a.distance(near.points[0]) < 1e-12 and b.distance(near.points[1]) < 1e-12
        on_a = scene_of(va, fa[near.primitive_ids[:1]])
        assert on_a.distance(near.points[0]) < 1e-12


def test_triangles_meet_as_fractions_say(rng):
    met = []
    for i in range(150):
        p, q = rng.normal(size=(2, 3, 3))
        if i % 3 == 0:
            # A corner that is on the other triangle but for rounding.
            q[0] = rng.dirichlet(np.ones(3)) @ p
        if i % 3 == 1:
            q[1] = 2 * (rng.dirichlet(np.ones(3)) @ p) - q[0]
        expected = exactly_meet(p, q)
        met.append(expected)
        a, b = scene_of(p, [[0, 1, 2]]), scene_of(q, [[0, 1, 2]])
        assert snell.collides(a, b) == expected
        assert (snell.closest_pair(a, b).distance == 0) == expected
    assert 30 < sum(met) < 120


def test_surfaces_collide_and_bodies_only_if_asked():
    inner = snell.Scene()
    inner.add_shape("box", min=[0.4, 0.4, 0.4], max=[0.6, 0.6, 0.6])
    poses = np.stack([at(0, 0, 0), at(0.4, 0, 0), at(5, 0, 0), at(0.39, 0, 0)])
    touching = snell.collides(inner, cube(), transform_a=poses)
    assert touching.tolist() == [False, True, False, False]
    for a, b, side in ((inner, cube(), "transform_a"), (cube(), inner, "transform_b")):
        solid = snell.collides(a, b, **{side: poses}, solid=True)
        assert solid.tolist() == [True, True, False, True]
    assert snell.collides(inner, cube(), solid=True) is True
    # One of several bodies is enough; a room with walls is not entered.
    two = snell.Scene()
    vertices, faces = sphere_mesh(6, 8, 0.1)
    two.add_mesh(np.concatenate([vertices + 9, vertices + 0.5]), np.vstack([faces, faces + 42]))
    assert snell.collides(two, cube(), solid=True) and not snell.collides(two, cube())


def test_instances_and_moved_objects_count_where_they_are():
    part = cube()
    cell = snell.Scene()
    cell.add_shape("rectangle", at(0, 0, -5), half_size=[50, 50])
    inner = snell.Scene()
    inner.add_instance(part, at(0, 10, 0))
    first = cell.add_instance(inner, at(20, 0, 0))
    second = cell.add_instance(part, np.diag([1, 2, 3, 1.0]))
    near = snell.closest_pair(cube(), cell, transform_a=at(20.25, 7, 0))
    assert near.distance == 2 and near.instance_ids.tolist() == [snell.INVALID_ID, first]
    near = snell.closest_pair(cube(), cell, transform_a=at(0, 0, 3.5))
    assert near.distance == 0.5 and near.instance_ids.tolist() == [snell.INVALID_ID, second]
    cell.update_transform(second, at(0, 0, 2))
    assert snell.closest_pair(cube(), cell, transform_a=at(0, 0, 3.5)).distance == 0.5
    cell.remove(second)
    assert snell.closest_pair(cube(), cell, transform_a=at(0, 0, 3.5)).distance == 8.5


def test_far_from_zero_distances_keep_their_digits(rng, sphere):
    near_zero = sphere[0].astype(np.float32).astype(np.float64)
    far = np.array([5e6, -4e6, 1000.0])
    shift = np.array([2.25, 0.5, 0.125])
    here = snell.closest_pair(
        scene_of(near_zero, sphere[1]), scene_of(near_zero + shift, sphere[1])
    )
    there = snell.closest_pair(
        scene_of(near_zero + far, sphere[1]), scene_of(near_zero + far + shift, sphere[1])
    )
    rounded = scene_of((near_zero + far) - far, sphere[1])
    moved = scene_of((near_zero + far + shift) - far, sphere[1])
    assert abs(snell.closest_pair(rounded, moved).distance - there.distance) < 1e-14
    assert abs(here.distance - there.distance) < 4e-9
    posed = snell.closest_pair(
        scene_of(near_zero, sphere[1]),
        scene_of(near_zero, sphere[1]),
        transform_a=at(*far),
        transform_b=at(*(far + shift)),
    )
    assert abs(posed.distance - here.distance) < 1e-14


def test_a_limit_leaves_out_what_is_farther():
    near = snell.closest_pair(cube(), cube(), transform_a=at(3, 0, 0), max_distance=2)
    assert near.distance == 2
    near = snell.closest_pair(cube(), cube(), transform_a=at(3, 0, 0), max_distance=1.999)
    assert near.distance == np.inf and near.is_found is False and np.isnan(near.points).all()
    assert (near.geometry_ids == snell.INVALID_ID).all()
    assert snell.closest_pair(cube(), snell.Scene()).distance == np.inf
    assert snell.collides(cube(), snell.Scene()) is False
    assert snell.collides(cube(), snell.Scene(), solid=True) is False
    assert snell.time_of_impact(snell.Scene(), cube(), [np.eye(4), np.eye(4)]) == np.inf


def test_what_has_no_triangles_is_refused_with_the_way():
    for kind, options, way in (
        ("sphere", {"radius": 1}, "add a mesh"),
        ("plane", {}, "add a rectangle"),
    ):
        scene = snell.Scene()
        scene.add_shape(kind, **options)
        with pytest.raises(ValueError, match=f"b: object 0 is a {kind}.*{way}"):
            snell.closest_pair(cube(), scene)
    scene = snell.Scene()
    scene.add_spheres([[0, 0, 0]], 1)
    with pytest.raises(ValueError, match="a: object 0 is a set of spheres"):
        snell.collides(scene, cube())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"transform_a": np.diag([1, 1, 2, 1])}, "transform_a: the pose is not a rotation"),
        (
            {"transform_a": np.tile(np.diag([1, 1, 0, 1.0]), (2, 1, 1))},
            r"transform_a\[0\]: the pos",
        ),
        ({"transform_b": np.eye(3)}, r"transform_b: shape is \(3, 3\)"),
        ({"transform_b": np.eye(4) * 2}, "the last row is"),
        ({"transform_b": np.eye(4) * np.nan}, "transform_b holds NaN"),
        ({"transform_b": np.zeros((1, 1, 4, 4)) + np.eye(4)}, r"shape is \(1, 1, 4, 4\)"),
        (
            {"transform_a": [np.eye(4)] * 2, "transform_b": [np.eye(4)] * 3},
            "2 poses in transform_a and 3",
        ),
        ({"threads": 0}, "threads is 0"),
    ],
)
def test_bad_arguments_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        snell.closest_pair(cube(), cube(), **options)
    with pytest.raises(ValueError, match=message):
        snell.collides(cube(), cube(), **options)


def test_other_bad_arguments_are_named():
    with pytest.raises(ValueError, match="max_distance is -1"):
        snell.closest_pair(cube(), cube(), max_distance=-1)
    with pytest.raises(TypeError, match=r"b is a list, expected a snell\.Scene"):
        snell.closest_pair(cube(), [])
    for motion, message in (
        (np.eye(4), r"motion: shape is \(4, 4\)"),
        ([np.eye(4), np.diag([2, 2, 2, 1])], "motion: the two poses of a motion differ"),
        ([[np.eye(4), np.diag([1, 1, -1, 1])]], r"motion\[0\]: the two poses"),
        ([np.eye(4), np.diag([1, 1, 3, 1])], "not a rotation"),
    ):
        with pytest.raises(ValueError, match=message):
            snell.time_of_impact(cube(), cube(), motion)
    with pytest.raises(ValueError, match="tolerance is NaN"):
        snell.time_of_impact(cube(), cube(), [np.eye(4)] * 2, tolerance=np.nan)


def test_nothing_tunnels():
    wall = snell.Scene()
    wall.add_shape("rectangle", half_size=[4, 4])
    shot = snell.time_of_impact(cube(), wall, [at(0, 0, 1000), at(0, 0, -1000)], tolerance=1e-9)
    assert 0 <= 0.5 - shot < 1e-12
    motions = [[at(x, 0, 3), at(x, 0, -5)] for x in (0, 3.9, 4.1, -4.9, -5.1)]
    times = snell.time_of_impact(cube(), wall, motions, tolerance=1e-9)
    np.testing.assert_allclose(times, [0.375, 0.375, np.inf, 0.375, np.inf], atol=1e-9)


def test_moments_of_contact_are_those_of_small_steps(rng):
    found = 0
    for _ in range(12):
        (va, fa), (vb, fb) = soup(rng, 25), soup(rng, 25)
        a, b = scene_of(va, fa), scene_of(vb, fb)
        motion = turned(rng, 2, 3.5)
        t = snell.time_of_impact(a, b, motion, tolerance=1e-7)
        turn = motion[1, :3, :3] @ motion[0, :3, :3].T
        angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
        skew = (turn - turn.T) / (2 * np.sin(angle))
        steps = np.linspace(0, 1, 500)
        poses = np.tile(np.eye(4), (500, 1, 1))
        for pose, s in zip(poses, steps, strict=True):
            part = np.sin(angle * s) * skew + (1 - np.cos(angle * s)) * skew @ skew
            pose[:3, :3] = (np.eye(3) + part) @ motion[0, :3, :3]
            pose[:3, 3] = motion[0, :3, 3] * (1 - s) + motion[1, :3, 3] * s
        hits = snell.collides(a, b, transform_a=poses)
        assert not hits[steps < t].any()
        found += bool(np.isfinite(t))
        if hits.any():
            assert t <= steps[hits.argmax()]
    assert found > 3


def test_agrees_with_fcl(rng):
    fcl = pytest.importorskip("fcl")
    (va, fa), (vb, fb) = sphere_mesh(20, 30), soup(rng, 300)
    a, b = scene_of(va, fa), scene_of(vb, fb)
    models = []
    for vertices, faces in ((va, fa), (vb, fb)):
        model = fcl.BVHModel()
        model.beginModel(len(vertices), len(faces))
        model.addSubModel(vertices, faces)
        model.endModel()
        models.append(model)
    poses = np.concatenate([turned(rng, 40, away) for away in (1.9, 2.4, 6)])
    near = snell.closest_pair(a, b, transform_a=poses)
    still = fcl.CollisionObject(models[1], fcl.Transform())
    for pose, distance in zip(poses, near.distance, strict=True):
        moved = fcl.CollisionObject(models[0], fcl.Transform(pose[:3, :3], pose[:3, 3]))
        theirs = fcl.distance(moved, still, fcl.DistanceRequest(), fcl.DistanceResult())
        meets = fcl.collide(moved, still, fcl.CollisionRequest(), fcl.CollisionResult()) > 0
        assert meets == (distance == 0)
        if not meets:
            assert abs(theirs - distance) < 1e-9


def test_every_pair_of_kinds_of_vertices(sphere):
    kinds = [sphere[0].astype(np.float32), sphere[0]]
    for p, q in itertools.product(kinds, kinds):
        near = snell.closest_pair(scene_of(p, sphere[1]), scene_of(q + [0, 2.5, 0], sphere[1]))
        assert abs(near.distance - 0.5) < 1e-6


@pytest.mark.skipif(os.name == "nt", reason="signals are those of Unix")
@pytest.mark.parametrize("count", [1, 3000])
def test_ctrl_c_interrupts(rng, count):
    vertices, faces = sphere_mesh(100, 200)
    # A shell just inside a shell: much is near to much.
    a, b = scene_of(vertices, faces), scene_of(vertices * 0.999, faces)
    poses = np.tile(np.eye(4), (count, 1, 1))
    snell.collides(a, b)
    timer = threading.Timer(0.2, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        while True:
            snell.closest_pair(a, b, transform_a=poses if count > 1 else None)
    timer.join()
    assert snell.closest_pair(a, b, transform_a=at(3, 0, 0)).distance > 0.9


def test_pairs_have_the_names_and_paths_of_their_things():
    wheel, car, street, pole = (snell.Scene() for _ in range(4))
    wheel.add_shape("box", name="tyre", **CUBE)
    car.add_shape("box", name="body", **CUBE)
    away = np.eye(4)
    away[0, 3] = 3
    car.add_instance(wheel, away, "front")
    away[0, 3] = -3
    car.add_instance(wheel, away)
    street.add_instance(car, name="taxi")
    pole.add_shape("box", min=[0, 0, 0], max=[0.1, 0.1, 9])
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 3] = [5, -5, 1.2, 1e9]
    pairs = snell.closest_pair(pole, street, transform_a=poses, max_distance=100)
    assert pairs.names.tolist() == [
        ["", "taxi/front/tyre"],
        ["", "taxi/2/tyre"],
        ["", "taxi/body"],
        ["", ""],
    ]
    none = snell.INVALID_ID
    assert pairs.instance_paths.tolist() == [
        [[none, none], [0, 1]],
        [[none, none], [0, 2]],
        [[none, none], [0, none]],
        [[none, none], [none, none]],
    ]
    assert pairs.instance_ids[:, 1].tolist() == [0, 0, 0, none]
    # They are those of hits.
    hit = street.cast_rays([9, 0.5, 0.5, -1, 0, 0])
    assert hit.names == pairs.names[0, 1]
    assert (hit.instance_paths == pairs.instance_paths[0, 1]).all()
    alone = snell.closest_pair(pole, street)
    assert alone.names.shape == (2,) and alone.instance_paths.shape == (2, 2)
    flat = snell.closest_pair(pole, pole)
    assert flat.instance_paths.shape == (2, 0) and flat.names.tolist() == ["", ""]
