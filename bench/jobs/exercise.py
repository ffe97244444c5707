"""The lecture's exercise: 20,000 rays at 338 triangles, with every pair in NumPy as the peer."""

import numpy as np
from common import Outcome, beside, torus

import snell


def ours(vertices, faces, origins, directions):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    return scene.cast_rays((origins, directions)).t_hit


def theirs(vertices, faces, origins, directions):
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    nearest = np.full(len(origins), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for p, q, r in zip(a, b, c, strict=True):
            across = np.cross(directions, r - p)
            scale = across @ (q - p)
            start = origins - p
            u = (start * across).sum(axis=1) / scale
            other = np.cross(start, q - p)
            v = (directions * other).sum(axis=1) / scale
            t = other @ (r - p) / scale
            inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
            nearest = np.where(inside & (t < nearest), t, nearest)
    return nearest


def run() -> Outcome:
    rng = np.random.default_rng(0)
    origins, directions = rng.uniform(-2, 2, (20_000, 3)), rng.normal(size=(20_000, 3))
    return beside("the lecture's exercise", "NumPy", ours, theirs, *torus(13), origins, directions)
