"""A city in UTM coordinates, of all that a city model is made of: every answer, picture and file is
that of the same city at the origin.
"""

from __future__ import annotations

import pathlib
import pickle
import warnings

import numpy as np
import pytest

import snell

FAR = np.array([448262.0, 5411932.0, 0.0])
NEAR = np.zeros(3)
# Positions in double precision are 1e-9 m apart there.
WITHIN = 1e-6

CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
FACES = np.array(
    [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3]]
    + [[0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]]
)
LAYERS = ["depth", "geometry-id", "primitive-id", "normal"]
PICTURE = {"size": (96, 72), "spp": 1, "filter": "box", "seed": 3}


def heights() -> np.ndarray:
    """Hills of centimetres, 61 rows and 71 columns with a step of 2 m; a lake has no data."""
    row, column = np.mgrid[:61, :71]
    z = 112.34 + 3 * np.sin(row / 7) * np.cos(column / 9) + 0.02 * ((row * 37 + column * 11) % 13)
    z[40:46, 10:20] = np.nan
    return np.round(z, 2)


def raster_place(place: np.ndarray) -> np.ndarray:
    return np.array([[2, 0, place[0] - 71], [0, -2, place[1] + 61]])


def write_buildings(path: pathlib.Path, place: np.ndarray) -> None:
    """Houses turned by some angle, with corners in millimetres."""
    rng = np.random.default_rng(5)
    lines = []
    for number in range(25):
        x, y = (number % 5 - 2) * 22.0, (number // 5 - 2) * 19.0
        angle = rng.uniform(0, 1.5)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        corners = CORNERS * rng.uniform([6, 5, 4], [11, 9, 22])
        corners[:, :2] = corners[:, :2] @ turn.T + [x, y]
        corners[:, 2] += 110
        lines += [f"o house-{number}"]
        lines += ["v {:.3f} {:.3f} {:.3f}".format(*p) for p in np.round(corners, 3) + place]
        lines += ["f {} {} {}".format(*(f + 1 + 8 * number)) for f in FACES]
    path.write_text("\n".join(lines) + "\n")


def camera(place: np.ndarray) -> snell.Camera:
    """A calibrated camera with distortion, 60 m above the roofs."""
    eye, target = place + [45.25, -70.5, 170.75], place + [0, 0, 112]
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(forward, right), forward, eye], axis=1)
    K = np.array([[88.5, 0, 47.1], [0, 88.1, 36.4], [0, 0, 1]])
    distortion = (-0.11, 0.02, 0.0008, -0.0011, 0.003)
    return snell.Camera.from_opencv(K, pose, distortion=distortion, size=(96, 72))


def city(folder: pathlib.Path, place: np.ndarray) -> snell.Scene:
    path = folder / ("far.obj" if place.any() else "near.obj")
    write_buildings(path, place)
    scene = snell.load(path)
    scene.add_heightfield(heights(), raster_place(place), "terrain")
    rng = np.random.default_rng(6)
    feet = np.round(rng.uniform([-60, -50, 111], [60, 50, 112], (30, 3)), 3)
    poles = np.stack([feet, feet + [0, 0, 8.5]], axis=1).reshape(-1, 3) + place
    scene.add_curves(poles, 0.06, strands=[2] * 30, basis="linear", name="poles")
    scene.add_spheres(feet + [0, 0, 8.75] + place, 0.35, name="lamps")
    scene.add_camera(camera(place))
    scene.add_light(snell.Light("point", position=place + [0, -30, 260], intensity=50000))
    scene.background = (0.4, 0.5, 0.7)
    return scene


@pytest.fixture(scope="module")
def cities(tmp_path_factory: pytest.TempPathFactory) -> tuple[snell.Scene, snell.Scene]:
    folder = tmp_path_factory.mktemp("city")
    return city(folder, NEAR), city(folder, FAR)


def corners(scene: snell.Scene) -> np.ndarray:
    """The corners of all triangles, in the coordinates of the scene."""
    parts = []
    for id in scene.ids:
        try:
            points, faces = scene.mesh(id)
        except TypeError:  # Spheres and curves.
            continue
        matrix = scene.transform(id)
        points = points.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
        parts.append(points[faces].reshape(-1, 3))
    return np.concatenate(parts)


def random_rays() -> np.ndarray:
    rng = np.random.default_rng(7)
    origins = rng.uniform([-90, -80, 100], [90, 80, 190], (6000, 3))
    targets = rng.uniform([-70, -60, 108], [70, 60, 130], (6000, 3))
    down = origins[:2000] * [1, 1, 0] + [0, 0, 400]
    rays = np.concatenate([origins, targets - origins], axis=1)
    return np.concatenate([rays, np.concatenate([down, down * 0 + [0, 0, -1]], axis=1)])


def moved(rays: np.ndarray, place: np.ndarray) -> np.ndarray:
    return np.concatenate([rays[..., :3] + place, rays[..., 3:]], axis=-1)


def assert_same_hits(near: snell.Hits, far: snell.Hits, unlike: float = 0) -> None:
    """The share `unlike` of rays may hit another thing: those through an edge."""
    same = (near.geometry_ids == far.geometry_ids) & (near.primitive_ids == far.primitive_ids)
    assert (~same).mean() <= unlike
    hit = same & np.isfinite(near.t_hit)
    assert hit.mean() > 0.3
    assert set(np.unique(near.geometry_ids[hit])) == set(np.unique(far.geometry_ids[hit]))
    length = np.abs(far.points - FAR - near.points)[hit]
    assert length.max() < WITHIN
    assert np.abs(far.t_hit[hit] - near.t_hit[hit]).max() < WITHIN
    assert np.abs(far.primitive_normals - near.primitive_normals)[hit].max() < WITHIN
    # Vertex normals are in single precision.
    assert np.abs(far.normals - near.normals)[hit].max() < 1e-5


def test_rays_hit_the_same(cities: tuple[snell.Scene, snell.Scene]) -> None:
    near, far = cities
    rays = random_rays()
    assert_same_hits(near.cast_rays(rays), far.cast_rays(moved(rays, FAR)))
    assert len(np.unique(near.cast_rays(rays).geometry_ids)) == len(near.ids) + 1
    blocked = [s.test_occlusions(moved(rays, p)) for s, p in ((near, NEAR), (far, FAR))]
    assert (blocked[0] == blocked[1]).all()
    counts = [s.count_intersections(moved(rays, p)) for s, p in ((near, NEAR), (far, FAR))]
    assert (counts[0] == counts[1]).mean() > 0.9995
    same = pickle.loads(pickle.dumps(far))
    assert (same.cast_rays(moved(rays, FAR)).t_hit == far.cast_rays(moved(rays, FAR)).t_hit).all()


def test_distances_are_the_same(cities: tuple[snell.Scene, snell.Scene]) -> None:
    near, far = cities
    points = random_rays()[:2000, :3]
    a, b = near.closest_points(points), far.closest_points(points + FAR)
    assert np.abs(a.distances - b.distances).max() < WITHIN
    same = (a.geometry_ids == b.geometry_ids) & (a.primitive_ids == b.primitive_ids)
    assert same.mean() > 0.97, "only on common edges and corners another primitive is as near"
    # On a curve the distance changes little near the nearest point, so that is known less well.
    away = np.abs(b.points - FAR - a.points).max(axis=-1)
    is_pole = a.geometry_ids == near["poles"]
    assert away[same & ~is_pole].max() < WITHIN
    assert away[same & is_pole].max() < 1e-5
    assert (near.occupancy(points) == far.occupancy(points + FAR)).all()
    assert np.abs(near.signed_distance(points) - far.signed_distance(points + FAR)).max() < WITHIN


def test_rays_of_a_calibrated_camera_are_the_same(
    cities: tuple[snell.Scene, snell.Scene],
) -> None:
    near, far = (camera(place).rays(dtype=np.float64) for place in (NEAR, FAR))
    assert np.abs(far[..., :3] - FAR - near[..., :3]).max() < WITHIN
    assert np.abs(far[..., 3:] - near[..., 3:]).max() < 1e-8
    assert_same_hits(cities[0].cast_rays(near), cities[1].cast_rays(far))
    points = cities[0].cast_rays(near).points
    seen = [camera(p).project(points + p, (96, 72)) for p in (NEAR, FAR)]
    assert np.nanmax(np.abs(seen[0] - seen[1])) < WITHIN


def assert_same_pictures(near: snell.Image, far: snell.Image, *, ids: bool = True) -> None:
    hit = near.aovs["geometry-id"] >= 0
    assert hit.mean() > 0.5
    if ids:
        assert (near.aovs["geometry-id"] == far.aovs["geometry-id"]).all()
        assert (near.aovs["primitive-id"] == far.aovs["primitive-id"]).all()
    # Pictures are in single precision, which is 1.5e-5 m apart at 170 m, and a grazing ray meets a
    # wall that is so much elsewhere several times as far away.
    apart = np.abs(far.aovs["depth"] - near.aovs["depth"])[hit]
    assert np.quantile(apart, 0.99) < 3.1e-5 and apart.max() < 5e-4
    assert np.abs(far.aovs["normal"] - near.aovs["normal"]).max() < 1e-5


def test_pictures_are_the_same(cities: tuple[snell.Scene, snell.Scene]) -> None:
    near, far = (snell.render(s, integrator="direct", aovs=LAYERS, **PICTURE) for s in cities)
    assert_same_pictures(near, far)
    assert np.abs(np.asarray(near) - np.asarray(far)).max() < 2e-3
    # The ids of pictures are those of the rays, which go through the centres of pixels.
    hits = cities[1].cast_rays(camera(FAR).rays(dtype=np.float64))
    same = far.aovs["geometry-id"] == np.where(
        np.isfinite(hits.t_hit), hits.geometry_ids.astype(float), -1
    )
    assert same.mean() > 0.95


@pytest.mark.parametrize("kind", ["obj", "ply", "off", "snell"])
def test_files_hold_the_same(
    cities: tuple[snell.Scene, snell.Scene], tmp_path: pathlib.Path, kind: str
) -> None:
    back = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", snell.SceneWarning)  # Of what a mesh format cannot hold.
        for scene, place in zip(cities, (NEAR, FAR), strict=True):
            path = tmp_path / f"city.{kind}"
            scene.save(path)
            again, expected = corners(snell.load(path)), corners(scene)
            # Houses and terrain come first. What single precision holds as well as near zero is
            # written in it by mesh formats.
            within = WITHIN if place.any() or kind == "snell" else 8e-6
            assert np.abs(again[: len(expected)] - expected).max() < within
            back.append(again - place)
            if kind == "snell":
                assert np.abs(snell.load(path).bounds - scene.bounds).max() < WITHIN
    near, far = back
    assert near.shape == far.shape
    # Lamps and poles became triangles in single precision.
    assert np.abs(near - far).max() < 1.6e-5


def test_gltf_holds_the_same_to_its_precision(
    cities: tuple[snell.Scene, snell.Scene], tmp_path: pathlib.Path
) -> None:
    """glTF has positions in single precision, in nodes that are placed in double."""
    back = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", snell.SceneWarning)
        for scene, place in zip(cities, (NEAR, FAR), strict=True):
            scene.save(tmp_path / "city.glb")
            back.append(corners(snell.load(tmp_path / "city.glb")) - place)
    assert np.abs(back[0] - back[1]).max() < 2e-5


@pytest.mark.parametrize("kind", ["checkerboard", "solid-checkerboard", "fbm"])
def test_patterns_are_where_they_were(tmp_path: pathlib.Path, kind: str) -> None:
    pictures = []
    for place in (NEAR, FAR):
        scene = city(tmp_path, place)
        rows = np.hstack([np.eye(3) / 8, -place[:, None] / 8])
        moved = {} if kind == "checkerboard" else {"texture_from_world": rows.tolist()}
        pattern = snell.Pattern(kind, **moved)
        scene.update_material(scene["terrain"], snell.Material("diffuse", reflectance=pattern))
        pictures.append(snell.render(scene, integrator="direct", aovs=LAYERS, **PICTURE))
    assert_same_pictures(*pictures)
    colors = [np.asarray(picture) for picture in pictures]
    assert np.quantile(np.abs(colors[0] - colors[1]), 0.99) < 1e-3


def test_fog_is_where_it_was(tmp_path: pathlib.Path) -> None:
    pictures = []
    for place in (NEAR, FAR):
        scene = city(tmp_path, place)
        base = (place + [0, 0, 110]).tolist()
        fog = {"sigma_s": 0.01, "sigma_a": 0.0, "g": 0.0, "base": base, "up": [0, 0, 1]}
        scene.medium = snell.Medium("height-fog", scale_height=20, **fog)
        options = PICTURE | {"size": (32, 24)}
        pictures.append(snell.render(scene, integrator="path", aovs=LAYERS, **options))
    assert_same_pictures(*pictures)
    colors = [np.asarray(picture) for picture in pictures]
    assert np.quantile(np.abs(colors[0] - colors[1]), 0.9) < 1e-2
