"""Things that move in time, and many things moved at once."""

from __future__ import annotations

import copy
import pickle
import warnings

import numpy as np
import pytest

import snell


def placed(x=0.0, y=0.0, z=0.0, turn=0.0) -> np.ndarray:
    """A turn around z in degrees, then a translation."""
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return np.array([[cos, -sin, 0, x], [sin, cos, 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


def rays_at(rng, count: int, dtype=np.float64) -> np.ndarray:
    origins = rng.uniform(-20, 20, (count, 3))
    targets = rng.uniform(-6, 6, (count, 3))
    return np.concatenate([origins, targets - origins], axis=-1).astype(dtype)


def street() -> tuple[snell.Scene, list[int]]:
    """Objects of every kind; all but the first move, also within an instance."""
    corners = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]]
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    wheel, car, scene = snell.Scene(), snell.Scene(), snell.Scene()
    wheel.add_mesh(corners, faces)
    car.add_shape("box", min=[-1, -1, 0], max=[1, 1, 1])
    spin = np.stack([placed(1, 0, 1, turn) for turn in (0, 90, 180)])
    car.add_instance(wheel, spin, times=[-1, 2, 5])
    still = scene.add_mesh(corners, faces, placed(0, 0, -4))
    road = np.stack([placed(-5, -3), placed(3, -3), placed(5, 2, 0, 80)])
    when = [0.5, 2, 3]
    moving = [
        scene.add_instance(car, road, times=[0, 1, 4]),
        scene.add_mesh(corners, faces, road + placed(0, 0, 3) - np.eye(4), times=when),
        scene.add_shape("sphere", road, times=when, radius=1),
        scene.add_spheres([[0, 0, -1], [0, 2, -1]], 0.7, road, times=when),
        scene.add_curves([[0, 0, 0], [0, 0, 4]], 0.3, None, "linear", road, times=when),
    ]
    return scene, [still, *moving]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_ray_sees_things_where_they_are_at_its_time(rng, dtype):
    scene, _ = street()
    rays = rays_at(rng, 9000, dtype)
    shared = np.array([-3, -1, 0, 0.25, 0.5, 1, 1.7, 2.6, 4, 5, 9.0])
    times = rng.choice(shared, len(rays))
    hits = scene.cast_rays(rays, times=times)
    counts = scene.count_intersections(rays, times=times)
    blocked = scene.test_occlusions(rays, times=times)
    every = scene.list_intersections(rays, times=times)
    total = 0
    for time in shared:
        chosen = times == time
        expected = scene.at(time).cast_rays(rays[chosen])
        same = hits.is_hit[chosen] == expected.is_hit
        # At a silhouette the last digits decide.
        assert same.mean() > 0.99
        both = hits.is_hit[chosen] & expected.is_hit
        near = np.abs(hits.t_hit[chosen][both] - expected.t_hit[both]) < 1e-4
        assert near.mean() > 0.99
        alike = both.copy()
        alike[both] = near
        for name in ("points", "normals", "primitive_normals", "geometry_ids", "instance_paths"):
            mine, theirs = hits[name][chosen][alike], expected[name][alike]
            assert np.allclose(mine, theirs, atol=2e-3), name
        total += alike.sum()
        assert (counts[chosen] == scene.at(time).count_intersections(rays[chosen])).mean() > 0.98
    assert total > 800
    assert (blocked == hits.is_hit).all()
    assert (np.diff(every.ray_splits) == counts).all()
    first = every.ray_splits[:-1][counts > 0]
    assert (every.t_hit[first] == hits.t_hit[counts > 0]).all()
    assert np.allclose(every.points[first], hits.points[counts > 0], atol=1e-6)


def test_times_do_not_depend_on_the_batch_or_the_threads(rng):
    scene, _ = street()
    rays, times = rays_at(rng, 3000, np.float32), rng.uniform(-1, 5, 3000)
    all_at_once = scene.cast_rays(rays, times=times)
    alone = scene.cast_rays(rays, times=times, threads=1)
    one_by_one = [
        scene.cast_rays(ray, times=time).t_hit for ray, time in zip(rays, times, strict=True)
    ]
    assert (all_at_once.t_hit == alone.t_hit).all()
    assert (all_at_once.t_hit == np.array(one_by_one)).all()
    grid = scene.cast_rays(rays.reshape(50, 60, 6), times=times.reshape(50, 60))
    assert (grid.t_hit.ravel() == all_at_once.t_hit).all()
    column = scene.cast_rays(rays.reshape(50, 60, 6), times=times[:60])
    assert (column.t_hit[3] == scene.cast_rays(rays[180:240], times=times[:60]).t_hit).all()


def test_translations_are_linear_and_rotations_are_rigid():
    scene = snell.Scene()
    keys = np.stack([placed(), placed(10, 0, 0, 120)])
    bar = scene.add_shape("box", keys, times=[0, 1], min=[-4, -1, -1], max=[4, 1, 1])
    for time in (0, 0.1, 0.37, 0.5, 0.99, 1):
        there = placed(10 * time, 0, 0, 120 * time)
        assert np.allclose(scene.at(time).transform(bar), there, atol=1e-12)
        # Along the long side of the box, from outside.
        origin = there @ [20, 0, 0, 1]
        towards = there @ [-1, 0, 0, 0]
        t = scene.cast_rays((origin[:3], towards[:3]), times=time).t_hit
        assert abs(t - 16) < 1e-4, time


def test_things_rest_before_and_after_their_keys_and_without_times():
    scene = snell.Scene()
    keys = np.stack([placed(), placed(4)])
    scene.add_shape("sphere", keys, radius=1, times=[10, 20])
    late = keys + placed(0, 10) - np.eye(4)
    scene.add_shape("sphere", late, radius=1, times=[100, 200])
    rays = ([[0, 0, 9], [4, 0, 9], [0, 10, 9], [4, 10, 9]], [0, 0, -1])
    for time, seen in [
        (None, [1, 0, 1, 0]),
        (-1e300, [1, 0, 1, 0]),
        (10, [1, 0, 1, 0]),
        (20, [0, 1, 1, 0]),
        (99, [0, 1, 1, 0]),
        (200, [0, 1, 0, 1]),
        (1e300, [0, 1, 0, 1]),
    ]:
        assert scene.test_occlusions(rays, times=time).tolist() == seen, time
    assert scene.distance([0, 0, 3]) == 2
    assert scene.bounds.tolist() == [[-1, -1, -1], [5, 11, 1]]
    # Where nothing moves, times make no difference.
    assert snell.Scene().cast_rays([0, 0, 0, 0, 0, 1], times=3).t_hit == np.inf


def test_motion_is_read_back_copied_pickled_and_ended():
    scene, (still, car, *_) = street()
    transforms, times = scene.motion(car)
    assert times.tolist() == [0, 1, 4] and transforms.shape == (3, 4, 4)
    assert (scene.transform(car) == transforms[0]).all() and scene.motion(still) is None
    again = pickle.loads(pickle.dumps(copy.deepcopy(scene)))
    ray, when = [-20, -3, 0.5, 1, 0, 0], np.linspace(-1, 5, 40)
    expected = scene.cast_rays(ray, times=2).t_hit
    assert again.cast_rays(ray, times=2).t_hit == expected
    rays = np.tile(np.array(ray, float), (40, 1))
    assert (
        again.cast_rays(rays, times=when).t_hit == scene.cast_rays(rays, times=when).t_hit
    ).all()
    again.update_transform(car, transforms[1])
    assert again.motion(car) is None
    assert again.cast_rays(ray, times=2).t_hit == again.cast_rays(ray, times=3).t_hit
    posed = scene.at(1)
    assert all(posed.motion(id) is None for id in posed.ids)
    assert posed.instance(car).motion(1) is None and scene.instance(car).motion(1) is not None


@pytest.mark.filterwarnings("ignore::snell.SceneWarning")
def test_a_file_keeps_the_motion_and_pictures_show_it(tmp_path):
    scene = snell.Scene()
    keys = np.stack([placed(-1.5), placed(1.5)])
    scene.add_shape("sphere", keys, radius=0.5, times=[3, 5])
    scene.environment, scene.background = 1.0, (0, 0, 0)
    scene.add_camera(snell.Camera(eye=(0, 0, 8), target=(0, 0, 0), fov=16))
    look = {"integrator": "flat", "spp": 16, "size": (64, 24), "progress": False}
    brightness = lambda picture: np.asarray(picture).mean(axis=(0, 2))  # noqa: E731
    at_rest = brightness(snell.render(scene, **look))
    assert at_rest[:26].sum() > 10 * at_rest[32:].sum() + 1
    blurred = brightness(snell.render(scene, shutter=(3, 5), **look))
    assert np.allclose(blurred, blurred[::-1], atol=0.1) and blurred[28:36].min() > 0.02
    half = brightness(snell.render(scene, shutter=(4, 5), **look))
    assert half[:20].sum() < 0.1 * half[32:].sum()
    moment = brightness(snell.render(scene, shutter=(4, 4), **look))
    assert np.allclose(moment, brightness(snell.render(scene.at(4), **look)), atol=0.02)
    scene.save(tmp_path / "ball.snell")
    loaded = snell.load(tmp_path / "ball.snell")
    again = brightness(snell.render(loaded, shutter=(3, 5), **look))
    assert np.allclose(again, blurred, atol=0.02)
    with pytest.warns(snell.SceneWarning, match="motion"):
        scene.save(tmp_path / "ball.glb")
    with pytest.raises(ValueError, match="nothing in the scene moves"):
        snell.render(scene.at(3), shutter=(0, 1), **look)
    with pytest.raises(ValueError, match="in order"):
        snell.render(scene, shutter=(1, 0), **look)


def test_many_are_added_and_moved_at_once(rng):
    ball, scene = snell.Scene(), snell.Scene()
    ball.add_shape("sphere", radius=0.4)
    places = np.tile(np.eye(4), (500, 1, 1))
    places[:, 0, 3] = np.arange(500)
    names = [f"ball {i}" if i % 2 else None for i in range(500)]
    ids = scene.add_instances(ball, places, names, mask=2)
    assert ids.dtype == np.uint32 and ids.tolist() == list(range(500))
    assert scene["ball 7"] == 7 and scene.names[9] == "ball 9" and 8 not in scene.names
    rays = (places[:, :3, 3] + [0, 0, 9], [0, 0, -1])
    assert (scene.cast_rays(rays).instance_ids == ids).all()
    assert not scene.test_occlusions(rays, mask=1).any()
    order = rng.permutation(500)
    scene.update_transforms(ids[order], places[:, :3])
    assert (scene.cast_rays(rays).instance_ids == ids[order]).all()
    moving = np.stack([places, places + placed(0, 5) - np.eye(4)], axis=1)
    scene.update_transforms(ids, moving, times=[0, 10])
    hits = scene.cast_rays((rays[0] + [0, 2.5, 0], rays[1]), times=5)
    assert (hits.instance_ids == ids).all()
    more = scene.add_instances(ball, moving + placed(0, 50) - np.eye(4), times=[0, 1])
    assert more.tolist() == list(range(500, 1000)) and scene.motion(700)[1].tolist() == [0, 1]
    assert len(scene.add_instances(ball, np.empty((0, 4, 4)))) == 0
    scene.update_transforms([], np.empty((0, 4, 4)))


def test_many_transforms_without_times_are_refused():
    ball, scene = snell.Scene(), snell.Scene()
    ball.add_shape("sphere", radius=1)
    many = np.tile(np.eye(4), (3, 1, 1))
    triangle = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    for add in [
        lambda: scene.add_instance(ball, many),
        lambda: scene.add_mesh(*triangle, many),
        lambda: scene.add_shape("sphere", many, radius=1),
        lambda: scene.add_spheres([[0, 0, 0]], 1, many),
        lambda: scene.add_curves([[0, 0, 0], [0, 0, 1]], 1, basis="linear", transform=many),
    ]:
        with pytest.raises(ValueError, match=r"\(3, 4, 4\).*times=.*add_instances"):
            add()
    assert len(scene) == 0
    ids = scene.add_instances(ball, many)
    with pytest.raises(ValueError, match=r"give times="):
        scene.update_transform(0, many)
    with pytest.raises(ValueError, match=r"no times; give times=.*reshape"):
        scene.update_transforms(ids, np.stack([many] * 3))
    moving = np.stack([placed(), placed(6)])
    scene.add_mesh(*triangle, moving, times=[0, 2])
    scene.add_spheres([[0, 5, 0]], 1, moving, times=[0, 2])
    scene.add_curves([[0, 9, 0], [0, 9, 1]], 1, basis="linear", transform=moving, times=[0, 2])
    rays = ([[3.2, 0.2, 9], [3, 5, 9], [3, 9, 9]], [0, 0, -1])
    assert scene.test_occlusions(rays, times=1).all()
    assert not scene.test_occlusions(rays, times=2).any()


def animated(rng):
    """A scene of everything that moves: meshes (near and far), shapes, nested instances."""
    scene, wheel, car = snell.Scene(), snell.Scene(), snell.Scene()
    far = rng.uniform(-1, 1, (30, 3)) + [448262.123, 5411932.456, 119.9]
    faces = np.arange(30).reshape(-1, 3)
    away = placed(-448262, -5411932, -120)
    keys = np.stack([away @ placed(), placed(3, 0, 0) @ away, placed(3, 0, 2, 45) @ away])
    scene.add_mesh(far, faces, keys, "far", times=[0, 1, 4])
    scene.add_mesh(rng.uniform(-1, 1, (30, 3)).astype(np.float32), faces, placed(0, 4), "still")
    turning = [placed(0, -4, 0, angle) for angle in (0, 90, 180)]
    scene.add_shape("box", turning, "box", times=[1, 2, 3], min=[-2, -0.2, -0.2], max=[2, 0.2, 0.2])
    wheel.add_shape("cylinder", placed(0, 0.2), radius=0.5, height=0.3)
    wheel.add_shape("sphere", placed(0, 0, 0.9), radius=0.3)
    spin = np.stack([placed(turn=angle) for angle in (0, 120, 240, 360)])
    for x in (-1, 1):
        moved = placed(x) @ spin
        car.add_instance(wheel, moved, f"wheel {x}", times=[0, 1, 2, 3])
    car.add_shape("box", name="body", min=[-2, -0.5, 0.2], max=[2, 0.5, 1])
    drive = np.stack([placed(-9, 9), placed(9, 9, 0, 30)])
    scene.add_instance(car, drive, "car", times=[-1, 5])
    scene.add_instance(car, placed(0, -12), "parked")
    return scene


def test_a_file_moves_for_queries_as_the_scene_that_was_saved(rng, tmp_path):
    scene = animated(rng)
    scene.save(tmp_path / "all.snell")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        loaded = snell.load(tmp_path / "all.snell")
        origins = rng.uniform(-12, 12, (4000, 3))
        rows = np.array([[0, 0, 0], [0, 4, 0], [0, -4, 0], [0, 9, 0.5], [0, -12, 0.5]])
        targets = rows[np.arange(4000) % 5] + rng.uniform(-1, 1, (4000, 3)) * [3, 0.6, 0.4]
        rays = np.concatenate([origins, targets - origins], axis=1)
        for times in (None, rng.uniform(-2, 6, 4000)):
            expected = scene.cast_rays(rays, times=times)
            found = loaded.cast_rays(rays, times=times)
            assert (found.is_hit == expected.is_hit).mean() > 0.9995
            both = found.is_hit & expected.is_hit
            assert both.sum() > 300
            close = np.isclose(found.t_hit[both], expected.t_hit[both], atol=1e-5)
            assert close.mean() > 0.998
            same = found.names[both] == expected.names[both]
            assert same.mean() > 0.998, (found.names[both][~same], expected.names[both][~same])
        for time in (0.3, 1.7, 4.2):
            ours, theirs = loaded.at(time), scene.at(time)
            assert np.allclose(ours.bounds, theirs.bounds, atol=1e-6)
        again = pickle.loads(pickle.dumps(loaded))
        assert np.allclose(
            again.cast_rays(rays, times=2).t_hit, loaded.cast_rays(rays, times=2).t_hit
        )
    for name in ("far", "box", "car"):
        ours, theirs = loaded.motion(loaded[name]), scene.motion(scene[name])
        assert np.allclose(ours[0], theirs[0], atol=1e-12) and (ours[1] == theirs[1]).all()
    assert loaded.motion(loaded["still"]) is None and loaded.motion(loaded["parked"]) is None
    inner = loaded.instance(loaded["car"])
    assert inner.motion(inner["wheel 1"])[1].tolist() == [0, 1, 2, 3]
    # What was read is written and rendered as it was, and after a change, too.
    for changed in (False, True):
        if changed:
            loaded.remove(loaded["still"])
            scene.remove(scene["still"])
        loaded.save(tmp_path / "again.snell")
        again = snell.load(tmp_path / "again.snell")
        for name in ("far", "box", "car"):
            assert np.allclose(again.motion(again[name])[0], scene.motion(scene[name])[0])


def test_layers_of_ids_of_a_moving_file_are_those_of_queries(rng, tmp_path):
    scene = animated(rng)
    scene.add_camera(snell.Camera(eye=(0, 0, 30), target=(0, 0, 0), fov=50))
    scene.save(tmp_path / "all.snell")
    loaded = snell.load(tmp_path / "all.snell")
    aovs = ["geometry-id", "instance-id"]
    picture = snell.render(loaded, "flat", spp=1, size=(180, 180), aovs=aovs, progress=False)
    hits = loaded.cast_rays(loaded.cameras[0].rays(180, 180))
    seen = hits.is_hit & (picture.aovs["geometry-id"] >= 0)
    assert seen.sum() > 100
    ids = [
        np.where(ids == snell.INVALID_ID, -1, ids.astype(int))
        for ids in (hits.geometry_ids, hits.instance_ids)
    ]
    for layer, wanted in zip(aovs, ids, strict=True):
        assert (picture.aovs[layer][seen] == wanted[seen]).mean() > 0.95, layer


def test_bad_arguments_change_nothing():
    ball, scene = snell.Scene(), snell.Scene()
    ball.add_shape("sphere", radius=1)
    good = np.tile(np.eye(4), (3, 1, 1))
    ids = scene.add_instances(ball, good)
    bad = good.copy()
    bad[2, 1, 1] = np.nan
    flat = good.copy()
    flat[1, 0, 0] = 0
    mirrored = good.copy()
    mirrored[1, 0, 0] = -1
    before = scene.transform(0).tolist(), len(scene)
    for call, message in [
        (lambda: scene.add_instances(ball, bad), r"transforms\[2\]\[1, 1\] is nan"),
        (lambda: scene.update_transforms(ids, flat), r"transforms\[1\] is singular"),
        (lambda: scene.update_transforms([0, 1, 9], good + 1e-3), r"transforms\[0\]\[3\] is"),
        (lambda: scene.update_transforms([0, 1, 9], good * 1.0), "id 9 is not in the scene"),
        (lambda: scene.update_transforms([0, 1, 0], good), r"ids\[0\] and ids\[2\] are both 0"),
        (lambda: scene.update_transforms([0, 1], good), "2 ids and 3 transforms"),
        (lambda: scene.add_instances(ball, good, ["a"]), "1 names and 3 transforms"),
        (lambda: scene.add_instances(ball, np.eye(4)), r"shape is \(4, 4\), expected \(n, 4, 4\)"),
        (lambda: scene.add_instances(ball, good, times=[0, 1, 2]), r"expected \(n, k, 4, 4\)"),
        (
            lambda: scene.update_transform(0, good, times=[0, 1]),
            r"shape is \(2,\), expected \(3,\)",
        ),
        (
            lambda: scene.update_transform(0, good, times=[0, 2, 1]),
            r"times\[2\] is 1, expected more",
        ),
        (lambda: scene.update_transform(0, good, times=[0, np.inf, 1]), r"times\[1\] is inf"),
        (lambda: scene.update_transform(0, good[:0], times=[]), "there are no keys"),
        (lambda: scene.update_transform(0, np.eye(4), times=[0]), r"expected \(k, 4, 4\)"),
        (
            lambda: scene.update_transform(0, mirrored, times=[0, 1, 2]),
            "keys 0 and 1 the map is singular",
        ),
        (lambda: scene.cast_rays([0, 0, 0, 0, 0, 1], times=np.nan), "times is nan"),
        (
            lambda: scene.cast_rays(np.ones((2, 3, 6)), times=[[0, 0, 0], [0, np.nan, 0]]),
            r"times\[1, 1\] is nan",
        ),
        (lambda: scene.cast_rays(np.ones((2, 6)), times=[1, 2, 3]), "times: shape"),
        (lambda: scene.at(np.nan), "time is nan"),
    ]:
        with pytest.raises((ValueError, IndexError), match=f"(?i){message}"):
            call()
    with pytest.raises(TypeError, match="names: expected a list"):
        scene.add_instances(ball, good, "abc")
    assert (scene.transform(0).tolist(), len(scene)) == before


def test_removed_movers_leave_the_others_as_they_are():
    scene, (still, *moving) = street()
    rays = np.tile([-20, -3, 0.5, 1, 0, 0.0], (30, 1))
    times = np.linspace(0, 4, 30)
    scene.cast_rays(rays, times=times)
    scene.remove(moving[2])
    fresh, ids = street()
    fresh.remove(ids[3])
    assert (
        fresh.cast_rays(rays, times=times).t_hit == scene.cast_rays(rays, times=times).t_hit
    ).all()
    assert scene.cast_rays([0.2, 0.2, -9, 0, 0, 1]).geometry_ids == still


def test_progress_is_told(rng):
    scene, _ = street()
    told: list[tuple[int, int]] = []
    rays = rays_at(rng, 1000, np.float32)
    scene.cast_rays(rays, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (1000, 1000) and all(0 <= done <= total for done, total in told)
    for query in (scene.test_occlusions, scene.count_intersections, scene.list_intersections):
        told.clear()
        query(rays, progress=lambda done, total: told.append((done, total)))
        assert told[-1] == (1000, 1000)
    assert scene.cast_rays(rays, progress=True).shape == (1000,)
    with pytest.raises(TypeError, match="progress is 3"):
        scene.cast_rays(rays, progress=3)


def test_an_exception_of_the_report_ends_the_query(rng):
    scene = snell.Scene()
    scene.add_spheres(rng.uniform(-5, 5, (20000, 3)), 0.1)
    rays = rays_at(rng, 3_000_000, np.float32)

    def stop(done: int, total: int) -> None:
        raise RuntimeError(f"enough: {total}")

    with pytest.raises(RuntimeError, match="enough: 3000000"):
        scene.count_intersections(rays, progress=stop, threads=1)


def test_keys_too_close_for_the_span_of_all_are_warned_about():
    scene = snell.Scene()
    epoch = 1.7e9
    scene.add_shape("sphere", radius=1)
    ball = snell.Scene()
    ball.add_shape("sphere", radius=1)
    scene.add_instance(ball, np.stack([placed(20), placed(17)]), times=[epoch, epoch + 0.1])
    ray = [0, 0, 0, 1, 0, 0]
    assert np.isclose(scene.cast_rays(ray, t_min=2, times=epoch + 0.05).t_hit, 17.5)
    scene.add_instance(ball, np.stack([placed(-90), placed(-91)]), times=[0, 1])
    with pytest.warns(UserWarning, match="only 0.1.* apart; give all times from"):
        scene.cast_rays(ray, t_min=2, times=epoch + 0.05)


def test_a_mesh_takes_its_transform_by_name():
    trimesh = pytest.importorskip("trimesh")
    with pytest.raises(TypeError, match="transform="):
        snell.Scene().add_mesh(trimesh.creation.box(), placed(1))
