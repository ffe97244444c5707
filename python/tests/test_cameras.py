"""Cameras of other fields: calibrated ones of OpenCV, and poses by convention."""

from __future__ import annotations

import numpy as np
import pytest

import snell

K = np.array([[800.0, 0, 321.5], [0, 790, 242.25], [0, 0, 1]])
POINTS = np.array([[0.3, -0.2, 2], [-0.5, 0.4, 2.5], [0.05, 0.6, 3]])
POSE = {"rvec": np.array([0.1, -0.2, 0.3]), "tvec": np.array([[0.05], [-0.1], [0.4]])}
SIZE = (640, 480)

# What cv2.projectPoints and cv2.fisheye.projectPoints of OpenCV 4 return.
LENSES = [
    (
        {"distortion": [-0.25, 0.08, 1e-3, -2e-3]},
        [
            [331.4223314852377, 92.36276590140326],
            [43.01158464206753, 192.4990680865875],
            [174.1921800704266, 266.06534280543167],
        ],
    ),
    (
        {"distortion": [[0.1, -0.05, 1e-3, 2e-3, 0.01, 0.2, 0.03, 0.001]]},
        [
            [331.59514759664563, 91.53908870541528],
            [39.230407473209596, 191.74539609192084],
            [173.76446903663089, 266.1527076303396],
        ],
    ),
    (
        {
            "distortion": (
                [0.1, -0.05, 1e-3, 2e-3, 0.01, 0.2, 0.03, 0.001, 1e-3, 2e-3, -1e-3, 5e-4, 0, 0]
            )
        },
        [
            [331.6268164218653, 91.5105001988143],
            [39.365075867112864, 191.64733225231598],
            [173.7947437075358, 266.1252786747527],
        ],
    ),
    (
        {"fisheye": [0.05, -0.01, 0.002, -0.001]},
        [
            [331.47408805809747, 92.44225654942369],
            [44.615497370440494, 192.64326028137592],
            [174.53214359585178, 265.9916371833622],
        ],
    ),
]


@pytest.mark.parametrize(("lens", "expected"), LENSES)
def test_a_calibrated_camera_projects_as_opencv(lens, expected):
    camera = snell.Camera.from_opencv(K, **POSE, **lens, size=SIZE)
    assert np.abs(camera.project(POINTS, SIZE) - expected).max() < 1e-9
    assert camera.principal_point == (321.5, 242.25)


@pytest.mark.parametrize(("lens", "_"), LENSES)
def test_rays_of_a_calibrated_camera_pass_through_the_centres_of_pixels(lens, _):
    camera = snell.Camera.from_opencv(K, **POSE, **lens, size=SIZE)
    rays = camera.rays().astype(np.float64)
    assert rays.shape == (480, 640, 6)
    seen = np.abs(rays[..., 3:]).sum(-1) > 0
    assert seen.mean() > 0.9
    points = rays[..., :3] + 3 * rays[..., 3:]
    rows, columns = np.indices((480, 640))
    off = camera.project(points, SIZE) - np.stack([columns, rows], -1)
    assert np.abs(off[seen]).max() < 2e-3


def test_a_picture_through_a_lens_shows_what_it_projects():
    camera = snell.Camera.from_opencv(K, distortion=[-0.3, 0.1, 0, 0], size=SIZE)
    scene = snell.Scene()
    centre = [0.55, 0.35, 2.0]
    place = np.eye(4)
    place[:3, 3] = centre
    scene.add_shape("sphere", place, radius=0.02)
    options = {"camera": camera, "size": SIZE, "spp": 1, "aovs": ["depth"], "progress": False}
    depth = snell.render(scene, "aov", **options).aovs["depth"]
    rows, columns = np.nonzero(np.isfinite(depth) & (depth > 0) & (depth < 10))
    (x, y), straight = (
        c.project([centre], SIZE)[0] for c in (camera, snell.Camera.from_opencv(K, size=SIZE))
    )
    assert abs(columns.mean() - x) < 0.3 and abs(rows.mean() - y) < 0.3
    assert abs(straight[0] - x) > 5


def test_poses_are_given_in_the_axes_of_each_field():
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    for axes, towards, up in [
        ("opencv", (0, 0, 1), (0, -1, 0)),
        ("opengl", (0, 0, -1), (0, 1, 0)),
        ("blender", (0, 0, -1), (0, 1, 0)),
        ("ros", (1, 0, 0), (0, 0, 1)),
    ]:
        camera = snell.Camera.from_matrix(pose, axes, fov=50)
        assert (camera.eye, camera.towards, camera.up) == ((1, 2, 3), towards, up)
        assert np.allclose(camera.matrix(axes), pose)
    with pytest.raises(ValueError, match="resolution is"):
        snell.Camera.from_matrix(pose, "ros", resolution=(0, 480))
    extrinsic = np.linalg.inv(pose)
    ways = [{"T_world_cam": pose}, {"T_cam_world": extrinsic[:3]}]
    eyes = [snell.Camera.from_opencv(K, **way, size=SIZE).eye for way in ways]
    assert eyes == [(1, 2, 3), (1, 2, 3)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"K": K.T}, "transpose it"),
        ({"size": None}, "size"),
        ({"T_world_cam": np.diag([1.0, 1, -1, 1])}, "mirrors"),
        ({"T_world_cam": np.arange(16.0).reshape(4, 4)}, "last row 0 0 0 1"),
        ({"distortion": [1, 2, 3]}, "expected 4, 5, 8, 12 or 14"),
        ({"distortion": [0] * 12 + [0.1, 0]}, "tilted"),
        ({"distortion": [0] * 4, "fisheye": [0] * 4}, "not both"),
        ({"rvec": [0, 0, 0]}, "rvec and tvec"),
    ],
)
def test_messages_say_what_is_wrong_with_a_calibration(arguments, message):
    given = {"K": K, "size": SIZE, **arguments}
    with pytest.raises((TypeError, ValueError), match=message):
        snell.Camera.from_opencv(given.pop("K"), **given)


def test_matrices_that_are_no_poses_are_refused():
    sheared = np.eye(4)
    sheared[0, 1] = 0.2
    stretched = np.diag([1.0, 1, 2, 1])
    half = 0.5 * np.eye(4)
    half[3, 3] = 1
    for pose, message in [
        (sheared, "not perpendicular"),
        (stretched, r"lengths 1, 1 and 2, expected 1"),
        (half, "expected 1; divide the scale out"),
        (np.diag([1.0, 1, -1, 1]), "mirrors"),
        (np.diag([1.0, 1, 0, 1]), "lengths 1, 1 and 0"),
    ]:
        for name in ("T_world_cam", "T_cam_world"):
            with pytest.raises(ValueError, match=message):
                snell.Camera.from_opencv(K, size=SIZE, **{name: pose})
    with pytest.raises(ValueError, match=r"T_world_cam: .*not perpendicular"):
        snell.Camera.from_matrix(sheared, "opengl")
    # The scale of an object of Blender, and rounded numbers of a file, are no fault.
    assert snell.Camera.from_matrix(half, "blender").eye == (0, 0, 0)
    turned = snell.Camera.from_opencv(K, size=SIZE, **POSE).matrix("opencv")
    assert snell.Camera.from_opencv(K, turned.round(4), size=SIZE).kind == "intrinsics"
    with pytest.raises((TypeError, ValueError), match="T_world_cam"):
        snell.Camera.from_opencv(K, "identity", size=SIZE)


def test_matrices_of_other_units_than_pixels_are_refused_or_warned_about():
    with pytest.raises(ValueError, match=r"fx is -800 .*expected positive"):
        snell.Camera.from_opencv(K * [[-1, 1, 1]] * [[1], [1], [1]], size=SIZE)
    with pytest.warns(UserWarning, match="multiply the first row by the width"):
        snell.Camera.from_opencv([[1.25, 0, 0.5], [0, 1.6, 0.5], [0, 0, 1]], size=SIZE)


def test_a_camera_is_made_from_another():
    camera = snell.Camera(
        eye=(1, 2, 8), target=(0, 0, 0), fov=30, aperture_radius=0.1, resolution=(64, 48), name="a"
    )
    assert camera.replace().__reduce__() == camera.__reduce__()
    moved = camera.replace(eye=(4, 4, 4))
    assert moved.eye == (4, 4, 4) and moved.towards == camera.towards
    assert (moved.name, moved.resolution, moved.aperture_radius) == ("a", (64, 48), 0.1)
    aimed = moved.replace(target=(0, 0, 0), up=(0, 0, 1), name="b", resolution=(8, 8))
    assert np.allclose(aimed.towards, -np.full(3, 3**-0.5)) and aimed.name == "b"
    assert np.isclose(aimed.focus_distance, 48**0.5) and aimed.resolution == (8, 8)
    wide = camera.replace(fov=90)
    assert np.isclose(wide.tan_half_fov[1], 1) and wide.eye == camera.eye
    for same in (wide.replace(fov=30), wide.replace(tan_half_fov=camera.tan_half_fov)):
        assert same.tan_half_fov == camera.tan_half_fov
    calibrated = snell.Camera.from_opencv(K, size=SIZE, distortion=[-0.2, 0.1, 0, 0], **POSE)
    shifted = calibrated.replace(principal_point=(300, 200), eye=(0, 0, 1))
    assert shifted.principal_point == (300, 200) and shifted.resolution == SIZE
    assert shifted.distortion == calibrated.distortion and shifted.focal_length == (800, 790)
    assert shifted.pixel_center == calibrated.pixel_center
    with pytest.raises(TypeError, match="target or towards"):
        camera.replace(target=(0, 0, 0), towards=(0, 0, 1))
    with pytest.raises(ValueError, match="target is where eye is"):
        camera.replace(target=camera.eye)
    with pytest.raises((TypeError, ValueError), match="radius"):
        camera.replace(radius=1)
    with pytest.raises(AttributeError, match="replace"):
        camera.eye = (0, 0, 0)


def test_a_plane_cuts_open_what_a_camera_sees():
    camera = snell.Camera(eye=(0, 0, 5), clip=(0, 0, -1, 1))
    assert camera.clip == (0, 0, -1, 1) and snell.Camera(eye=(0, 0, 5)).clip is None
    assert camera.replace(fov=30).clip == camera.clip
    assert camera.replace(clip=(1, 0, 0, 0)).clip == (1, 0, 0, 0)
    with pytest.raises(ValueError, match="clip is"):
        snell.Camera(eye=(0, 0, 5), clip=(0, 0, 0, 1))
