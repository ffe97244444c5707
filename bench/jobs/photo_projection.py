"""The pixel of a photo for each vertex that its camera sees. Beside OpenCV with Open3D."""

import cv2
import numpy as np
import open3d as o3d
from common import Outcome, beside, torus

import snell


def ours(vertices, faces, intrinsics, eye):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    camera = snell.Camera(
        "intrinsics",
        eye=eye,
        towards=(0, 0, 1),
        up=(0, -1, 0),
        focal_length=(intrinsics[0, 0], intrinsics[1, 1]),
        principal_point=intrinsics[:2, 2] + 0.5,
        size=(1280, 800),
    )
    pixels = camera.project(vertices, (1280, 800)) - 0.5
    pixels[scene.test_occlusions((eye, vertices - eye), t_max=1 - 1e-5)] = np.nan
    return np.nan_to_num(pixels, nan=-1)


def theirs(vertices, faces, intrinsics, eye):
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    pixels = cv2.projectPoints(vertices, np.zeros(3), -eye, intrinsics, None)[0][:, 0]
    way = vertices - eye
    rays = np.concatenate([np.broadcast_to(eye, way.shape), way], axis=-1).astype(np.float32)
    hidden = scene.test_occlusions(o3d.core.Tensor(rays), tfar=1 - 1e-5).numpy()
    pixels[hidden] = -1
    return pixels


def run() -> Outcome:
    vertices, faces = torus(256)
    turn = cv2.Rodrigues(np.array([0.7, 0.2, 0.1]))[0]
    intrinsics = np.array([[900, 0, 640.25], [0, 900, 399.5], [0, 0, 1.0]])
    eye = np.array([0.1, 0.05, -4.0])
    values = vertices @ turn.T, faces, intrinsics, eye
    return beside("photo projection", "OpenCV + Open3D", ours, theirs, *values)
