"""Rays that leave hits: they stay in closed rooms and do not meet the wall that they leave."""

import pickle

import numpy as np
import pytest

import snell

FAR = np.array([448262.0, 5411932.0, 120.0])


def box(center, half):
    scene = snell.Scene()
    scene.add_shape("box", min=list(center - half), max=list(center + half))
    return scene


def ball_of_triangles(center, radius, rings=50, around=52):
    theta = np.pi * np.arange(1, rings)[:, None] / rings
    phi = 2 * np.pi * np.arange(around) / around
    ring = np.stack(
        np.broadcast_arrays(
            np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
        ),
        axis=-1,
    )
    points = np.concatenate([[[0, 0, 1]], ring.reshape(-1, 3), [[0, 0, -1]]])
    at = 1 + np.arange((rings - 1) * around).reshape(rings - 1, around)
    right = np.roll(at, -1, axis=1)
    quads = [
        np.stack([at[:-1], at[1:], right[1:]], -1),
        np.stack([at[:-1], right[1:], right[:-1]], -1),
        np.stack([np.zeros_like(at[0]), at[0], right[0]], -1),
        np.stack([np.full_like(at[0], len(points) - 1), right[-1], at[-1]], -1),
    ]
    faces = np.concatenate([quad.reshape(-1, 3) for quad in quads])
    scene = snell.Scene()
    scene.add_mesh(points * radius + center, faces)
    return scene


def bounce(scene, rays, bounces, rng, *, diffuse, flat=True):
    last = None
    for _ in range(bounces):
        hits = scene.cast_rays(rays)
        assert hits.is_hit.all()
        if flat and last is not None:
            assert (hits.primitive_ids != last).all()
        last = hits.primitive_ids
        d, n = rays[:, 3:], hits.primitive_normals
        along = (d * n).sum(-1, keepdims=True)
        if diffuse:
            new = rng.normal(size=d.shape)
            new /= np.linalg.norm(new, axis=-1, keepdims=True)
            new = 0.9999 * new - np.sign(along) * n
        else:
            new = d - 2 * along * n
        new /= np.linalg.norm(new, axis=-1, keepdims=True)
        rays = hits.spawn_rays(new)
        assert rays.dtype == hits.t_hit.dtype
    return rays


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("diffuse", [False, True])
@pytest.mark.parametrize(
    ("size", "center"), [(1e-6, 0 * FAR), (1, 0 * FAR), (1e6, 0 * FAR), (1e3, FAR)]
)
def test_reflected_rays_stay_in_a_room(dtype, diffuse, size, center):
    rng = np.random.default_rng(0)
    half = np.array([3.5, 2.5, 1.5]) * size
    corners = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), axis=-1).reshape(-1, 3)
    aimed = corners[(corners != 0).any(axis=-1)] * half
    free = rng.normal(size=(300, 3))
    for room, flat in [(box(center, half), True), (ball_of_triangles(center, half[0]), True)]:
        directions = np.concatenate([aimed, free])
        rays = np.concatenate([np.broadcast_to(center, directions.shape), directions], axis=-1)
        bounce(room, rays.astype(dtype), 100, rng, diffuse=diffuse, flat=flat)


def test_a_round_room_of_one_surface():
    rng = np.random.default_rng(1)
    scene = snell.Scene()
    scene.add_shape("sphere", radius=2)
    rays = np.concatenate([np.zeros((200, 3)), rng.normal(size=(200, 3))], axis=-1)
    for dtype in (np.float32, np.float64):
        end = bounce(scene, rays.astype(dtype), 200, rng, diffuse=True, flat=False)
        assert (np.linalg.norm(end[:, :3], axis=-1) < 2).all()


def test_walls_of_several_objects_and_instances():
    rng = np.random.default_rng(2)
    wall, room = snell.Scene(), snell.Scene()
    wall.add_shape("rectangle", half_size=[1, 1], name="wall")
    turns = [
        np.eye(3),
        np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
        np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    ]
    for turn in turns:
        for side in (-1, 1):
            pose = np.eye(4)
            pose[:3, :3] = turn
            pose[:3, 3] = turn @ [0, 0, side]
            room.add_instance(wall, pose)
    corners = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), axis=-1).reshape(-1, 3)
    aimed = corners[(corners != 0).any(axis=-1)]
    directions = np.concatenate([aimed, rng.normal(size=(300, 3))])
    rays = np.concatenate([np.zeros_like(directions), directions], axis=-1)
    for dtype in (np.float32, np.float64):
        bounce(room, rays.astype(dtype), 100, rng, diffuse=False, flat=False)
        bounce(room, rays.astype(dtype), 100, rng, diffuse=True, flat=False)


def test_both_sides_misses_parts_and_broadcasting():
    scene = snell.Scene()
    scene.add_shape("plane")
    hits = scene.cast_rays([[0, 0, 5, 0, 0, -1], [1, 2, 5, 0, 0, 1], [3, 4, 5, 0, 0, -1]])
    rays = hits.spawn_rays([0, 0, 1])
    assert rays.shape == (3, 6)
    assert (rays[[0, 2], 2] > 0).all()
    assert (rays[[0, 2], 2] < 1e-12).all()
    assert np.isnan(rays[1, :3]).all()
    assert not scene.test_occlusions(rays).any()
    through = hits.spawn_rays([0, 0, -1])
    assert (through[[0, 2], 2] < 0).all()
    assert not scene.test_occlusions(through).any()
    part = hits[hits.is_hit]
    assert part.spawn_rays([0, 0, 1]).tolist() == rays[[0, 2]].tolist()
    assert part[1].spawn_rays([0, 0, 1]).tolist() == rays[2].tolist()
    assert hits[:0].spawn_rays(np.zeros((0, 3))).shape == (0, 6)
    single = scene.cast_rays(np.float32([0, 0, 5, 0, 0, -1]))
    assert single.spawn_rays([0, 0, 1.0]).dtype == np.float32


def test_masks_and_intervals_of_the_query_count():
    scene = snell.Scene()
    scene.add_shape("plane", mask=1)
    scene.add_shape("plane", [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]], mask=2)
    down = [0, 0, 5, 0, 0, -1]
    for hits in (
        scene.cast_rays(down, mask=1),
        scene.cast_rays(down, t_min=4.5),
        scene.cast_rays(down, exclude=1),
    ):
        assert hits.t_hit == 5
        assert 0 < hits.spawn_rays([0, 0, 1])[2] < 1e-12


def test_wrong_directions_are_named():
    scene = snell.Scene()
    scene.add_shape("plane")
    hits = scene.cast_rays([[0, 0, 5, 0, 0, -1]] * 2)
    with pytest.raises(ValueError, match=r"^directions: shape is \(3, 3\), expected \(2, 3\)"):
        hits.spawn_rays(np.zeros((3, 3)))
    with pytest.raises(ValueError, match=r"^directions: shape is \(2, 2\), expected \(\.\.\., 3\)"):
        hits.spawn_rays(np.zeros((2, 2)))
    with pytest.raises(TypeError, match=r"^directions: dtype is complex128"):
        hits.spawn_rays(np.zeros((2, 3), dtype=complex))
    with pytest.raises(ValueError, match=r"^spawn_rays: these hits were unpickled"):
        pickle.loads(pickle.dumps(hits)).spawn_rays([0, 0, 1])


def test_changed_rays_do_no_harm():
    room = ball_of_triangles(np.zeros(3), 1.0, 8, 9)
    rays = np.array([[0, 0, 0, 1.0, 0.1, 0.2]])
    hits = room.cast_rays(rays)
    expected = hits.spawn_rays([[-1.0, 0, 0]])
    rays[:] = 50
    assert hits.spawn_rays([[-1.0, 0, 0]]) == pytest.approx(expected)
