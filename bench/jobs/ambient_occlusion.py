"""Ambient occlusion of each vertex, 64 rays each. Beside Open3D."""

import numpy as np
import open3d as o3d
from common import Outcome, beside, torus

import snell


def ours(vertices, faces, normals, directions):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    starts = (vertices + 1e-3 * normals)[:, None].astype(np.float32)
    return 1 - scene.test_occlusions((starts, directions)).mean(axis=1)


def theirs(vertices, faces, normals, directions):
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    starts = np.broadcast_to((vertices + 1e-3 * normals)[:, None], directions.shape)
    rays = np.concatenate([starts, directions], axis=-1).astype(np.float32)
    return 1 - scene.test_occlusions(o3d.core.Tensor(rays)).numpy().mean(axis=1)


def run() -> Outcome:
    vertices, faces = torus()
    ring = vertices * [1, 1, 0]
    normals = vertices - ring / np.linalg.norm(ring, axis=1, keepdims=True)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ball = np.random.default_rng(0).normal(size=(len(vertices), 64, 3))
    directions = normals[:, None] + 0.999 * ball / np.linalg.norm(ball, axis=-1, keepdims=True)
    values = vertices, faces, normals, directions.astype(np.float32)
    return beside("ambient occlusion", "Open3D", ours, theirs, *values)
