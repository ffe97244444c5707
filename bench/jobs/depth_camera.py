"""Depth for a calibrated camera of a megapixel. Beside Open3D."""

import numpy as np
import open3d as o3d
from common import Outcome, beside, torus

import snell


def ours(vertices, faces, intrinsics, extrinsics):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    return scene.cast_rays(snell.create_rays_pinhole(intrinsics, extrinsics, 1280, 800)).t_hit


def theirs(vertices, faces, intrinsics, extrinsics):
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    rays = o3d.t.geometry.RaycastingScene.create_rays_pinhole(
        o3d.core.Tensor(intrinsics), o3d.core.Tensor(extrinsics), 1280, 800
    )
    return scene.cast_rays(rays)["t_hit"].numpy()


def run() -> Outcome:
    intrinsics = np.array([[900, 0, 640], [0, 900, 400], [0, 0, 1.0]])
    extrinsics = np.eye(4)
    extrinsics[:3, 3] = 0.1, 0.2, 3
    return beside("depth camera", "Open3D", ours, theirs, *torus(), intrinsics, extrinsics)
