"""A second of a lidar on a driving car: 576,000 rays with an origin each. Beside Open3D."""

import numpy as np
import open3d as o3d
from common import Outcome, beside, terrain

import snell


def ours(vertices, faces, places, directions):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    return scene.cast_rays((places, directions)).t_hit


def theirs(vertices, faces, places, directions):
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    rays = np.concatenate([np.broadcast_to(places, directions.shape), directions], axis=-1)
    return scene.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))["t_hit"].numpy()


def run() -> Outcome:
    vertices, faces = terrain()
    time = np.linspace(0, 1, 18_000, endpoint=False)
    places = np.stack([1000 + 15 * time, np.full_like(time, 1500.0), np.full_like(time, 120)], -1)
    up = np.radians(np.linspace(-25, 10, 32))[:, None]
    turn = 20 * np.pi * time
    directions = np.stack(
        np.broadcast_arrays(np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)), -1
    )
    values = vertices, faces, places.astype(np.float32), directions.astype(np.float32)
    return beside("lidar on a car", "Open3D", ours, theirs, *values, tolerance=1e-3)
