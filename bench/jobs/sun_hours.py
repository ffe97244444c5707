"""The hours of sun on a terrain, 90,000 places by 16 times: the raster itself, beside its triangles
in trimesh with Embree.
"""

import math

import numpy as np
import trimesh
from common import Outcome, beside, terrain

import snell


def ours(vertices, faces, places, sun):
    scene = snell.Scene()
    side = math.isqrt(len(vertices))
    scene.add_heightfield(vertices[:, 2].reshape(side, side), [[0, 10, -5], [10, 0, -5]])
    return (~scene.test_occlusions((places[:, None], sun))).sum(axis=1)


def theirs(vertices, faces, places, sun):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    origins = np.repeat(places, len(sun), axis=0)
    blocked = mesh.ray.intersects_any(origins, np.tile(sun, (len(places), 1)))
    return (~blocked).reshape(len(places), len(sun)).sum(axis=1)


def run() -> Outcome:
    vertices, faces = terrain()
    angle = np.radians(np.linspace(-75, 75, 16))
    sun = np.stack([-np.sin(angle), -0.6 * np.cos(angle), 0.8 * np.cos(angle)], -1)
    values = vertices, faces, vertices + [0, 0, 0.01], sun
    return beside("sun hours", "trimesh + embreex", ours, theirs, *values)
