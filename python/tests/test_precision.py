"""A city in coordinates of millions gives what the same city near zero gives."""

from __future__ import annotations

import pathlib
import pickle
import warnings

import numpy as np
import pytest

import snell

FAR = np.array([448262.125, 5411932.625, 120.0])
NEAR = np.zeros(3)
CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
FACES = np.array(
    [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3]]
    + [[0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]]
)


def houses(place: np.ndarray) -> list[np.ndarray]:
    """Corners with millimetres, up to a kilometre from the place."""
    rng = np.random.default_rng(3)
    where = rng.uniform(-1000, 1000, (12, 3)) * [1, 1, 0]
    size = rng.uniform(8, 30, (12, 3))
    return [np.round(CORNERS * s + p, 3) + place for p, s in zip(where, size, strict=True)]


def text(kind: str, boxes: list[np.ndarray]) -> bytes:
    points = np.concatenate(boxes)
    faces = np.concatenate([FACES + 8 * i for i in range(len(boxes))])
    rows = "".join("{:.17g} {:.17g} {:.17g}\n".format(*p) for p in points)
    lists = "".join("3 {} {} {}\n".format(*f) for f in faces)
    if kind == "obj":
        rows = "".join("v " + row + "\n" for row in rows.splitlines())
        return (rows + "".join("f {} {} {}\n".format(*(f + 1)) for f in faces)).encode()
    if kind == "off":
        return f"OFF\n{len(points)} {len(faces)} 0\n{rows}{lists}".encode()
    form = "ascii" if kind == "text.ply" else "binary_little_endian"
    header = (
        f"ply\nformat {form} 1.0\nelement vertex {len(points)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    if form == "ascii":
        return (header + rows + lists).encode()
    row = np.zeros(len(faces), [("n", "u1"), ("i", "<i4", 3)])
    row["n"], row["i"] = 3, faces
    return header.encode() + points.astype("<f8").tobytes() + row.tobytes()


def corners(scene: snell.Scene) -> np.ndarray:
    """The corners of all triangles, in order of their sizes and places."""
    parts = []
    for id in scene.ids:
        points, faces = scene.mesh(id)
        matrix = scene.transform(id)
        points = points.astype(float)
        points = points if matrix is None else points @ matrix[:3, :3].T + matrix[:3, 3]
        parts.append(points[faces].reshape(-1, 3))
    return np.concatenate(parts)


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "text.ply"])
def test_files_keep_the_digits_of_their_corners(tmp_path: pathlib.Path, kind: str) -> None:
    rays = np.random.default_rng(5).uniform([-999, -999, 50], [999, 999, 60], (4000, 3))
    down = np.broadcast_to([0, 0, -1.0], rays.shape)
    found = []
    for place in (NEAR, FAR):
        path = tmp_path / f"city.{kind}"
        path.write_bytes(text(kind, houses(place)))
        scene = snell.load(path)
        expected = np.concatenate([box[FACES].reshape(-1, 3) for box in houses(place)])
        assert np.abs(corners(scene) - expected).max() < 2e-9
        bounds = np.array([expected.min(0), expected.max(0)])
        assert np.abs(scene.bounds - bounds).max() < 2e-9
        hits = scene.cast_rays((rays + place, down))
        found.append((hits.t_hit, hits.primitive_ids, scene.distance(rays + place)))
    (t, ids, distance), (far_t, far_ids, far_distance) = found
    assert np.isfinite(t).sum() > 5
    assert (ids == far_ids).all()
    hit = np.isfinite(t)
    assert np.abs(t[hit] - far_t[hit]).max() < 1e-6
    assert np.abs(distance - far_distance).max() < 1e-6


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "snell"])
def test_files_are_written_with_the_digits_of_the_scene(tmp_path: pathlib.Path, kind: str) -> None:
    scene = snell.Scene()
    for box in houses(FAR):
        scene.add_mesh(box, FACES)
    path = tmp_path / f"city.{kind}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", snell.SceneWarning)  # Objects may become one mesh.
        scene.save(path)
    expected = np.concatenate([box[FACES].reshape(-1, 3) for box in houses(FAR)])
    assert np.abs(corners(snell.load(path)) - expected).max() < 1e-6
    again = tmp_path / f"again.{kind}"
    snell.load(path).save(again)
    assert np.abs(corners(snell.load(again)) - expected).max() < 1e-6


def test_small_things_far_away_are_hit() -> None:
    scene = snell.Scene()
    scene.add_spheres([FAR], 0.05)
    scene.add_curves([FAR + [0, 5, 0], FAR + [0, 5, 3]], 0.05, basis="linear")
    curve = [FAR + [0, 10, z] for z in range(4)]
    scene.add_curves(curve, 0.05)
    for same in (scene, pickle.loads(pickle.dumps(scene))):
        origins = FAR + [[-4, 0, 0], [-4, 5, 1.5], [-4, 10, 1.5]]
        hits = same.cast_rays((origins, [1, 0, 0.0]))
        assert hits.geometry_ids.tolist() == [0, 1, 2]
        assert np.abs(hits.t_hit - 3.95).max() < 1e-6
        assert np.abs(hits.points - (origins + [3.95, 0, 0])).max() < 1e-6
        assert np.abs(hits.normals - [-1, 0, 0]).max() < 1e-6
        assert np.abs(same.distance(origins) - 3.95).max() < 1e-6


def view(place: np.ndarray) -> snell.Camera:
    eye = place + [40.125, -60.5, 35.25]
    return snell.Camera(eye=eye, target=place + [0, 0, 5], up=(0, 0, 1), fov=50)


def test_rays_of_cameras_are_double_if_asked() -> None:
    near, far = (view(place).rays(40, 30, dtype=np.float64) for place in (NEAR, FAR))
    assert far.dtype == np.float64
    assert np.abs(far[..., :3] - FAR - near[..., :3]).max() < 2e-9
    assert np.abs(far[..., 3:] - near[..., 3:]).max() < 1e-9
    single = view(NEAR).rays(40, 30)
    assert single.dtype == np.float32
    assert np.abs(single - near).max() < 1e-5
    scene = snell.Scene()
    scene.add_camera(view(FAR))
    assert (scene.create_rays_camera(0, 40, 30, dtype="float64") == far).all()
    with pytest.raises(ValueError, match="dtype is int64, expected float32 or float64"):
        view(NEAR).rays(40, 30, dtype=int)
    points = np.array([[1.5, 2, 3], [-8, 4, 12]])
    seen = [view(place).project(points + place, (640, 480)) for place in (NEAR, FAR)]
    assert np.abs(seen[0] - seen[1]).max() < 1e-6
    # A pixel's ray leads back to the pixel.
    at = far[..., :3] + far[..., 3:] * 50
    pixel = view(FAR).project(at, (40, 30))
    assert np.abs(pixel[7, 9] - [9.5, 7.5]).max() < 1e-6


def city(place: np.ndarray) -> snell.Scene:
    scene = snell.Scene()
    size = np.array([12.5, 9.25, 14.75])
    for x in range(-2, 3):
        scene.add_mesh(CORNERS * size + [x * 20, 5, 0] + place, FACES)
    ground = np.array([[-90, -90, 0], [90, -90, 0], [90, 90, 0], [-90, 90, 0.0]])
    scene.add_mesh(ground + place, [[0, 1, 2], [0, 2, 3]])
    scene.add_spheres([[x * 5, -5, 2] for x in range(-6, 7)] + place, 1.25)
    pole = [[[x * 7, -9, 0], [x * 7, -9, 6]] for x in range(-5, 6)]
    points = np.array(pole).reshape(-1, 3) + place
    scene.add_curves(points, 0.125, strands=[2] * 11, basis="linear")
    scene.add_light(snell.Light("point", position=place + [0, -30, 60], intensity=5000))
    scene.background = (0.5, 0.5, 0.5)
    return scene


def test_pictures_of_far_scenes_are_those_of_near_ones() -> None:
    layers = ["depth", "geometry-id", "normal", "position"]
    options = {"size": (80, 60), "spp": 1, "filter": "box", "integrator": "direct"}
    pictures = []
    for place in (NEAR, FAR):
        scene = city(place)
        for camera in (view(place), None):
            if camera is None:
                scene.add_camera(view(place))
            pictures.append(snell.render(scene, camera=camera, aovs=layers, **options))
    near = pictures[0]
    for other in pictures[1:]:
        same = near.aovs["geometry-id"] == other.aovs["geometry-id"]
        assert same.all()
        depth, found = near.aovs["depth"], other.aovs["depth"]
        assert np.abs(found - depth).max() <= 1e-6 * depth.max()
        assert np.abs(near.aovs["normal"] - other.aovs["normal"]).max() < 1e-5
        assert np.abs(np.asarray(near) - np.asarray(other)).max() < 1e-3
    position = pictures[2].aovs["position"]
    seen = near.aovs["depth"] > 0
    assert np.abs(position - near.aovs["position"] - FAR)[seen].max() < 1


@pytest.mark.parametrize("exponent", [-38, -34, -31, -29, -20, 0, 20, 33])
def test_batches_find_what_single_rays_find_at_any_scale(exponent: int) -> None:
    rng, scale = np.random.default_rng(1), 10.0**exponent
    triangles = rng.uniform(-1, 1, (400, 1, 3)) + rng.uniform(-0.2, 0.2, (400, 3, 3))
    scene = snell.Scene()
    vertices = (triangles.reshape(-1, 3) * scale).astype(np.float32)
    scene.add_mesh(vertices, np.arange(1200).reshape(-1, 3))
    for count in (16, 20, 32, 33):
        origins = (rng.uniform(-0.02, 0.02, (count, 3)) * scale).astype(np.float32)
        rays = np.concatenate([origins, rng.normal(size=(count, 3)).astype(np.float32)], axis=1)
        alone = [scene.cast_rays(ray[None]).primitive_ids[0] for ray in rays]
        assert scene.cast_rays(rays).primitive_ids.tolist() == alone
