"""Signed distances of 100,000 points to a closed mesh of 33 thousand triangles. Beside Open3D."""

import numpy as np
import open3d as o3d
from common import Outcome, beside, torus

import snell


def ours(vertices, faces, points):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    return scene.signed_distance(points)


def theirs(vertices, faces, points):
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    return scene.compute_signed_distance(o3d.core.Tensor(points)).numpy()


def run() -> Outcome:
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (100_000, 3)).astype(np.float32)
    return beside("signed distance", "Open3D", ours, theirs, *torus(), points)
