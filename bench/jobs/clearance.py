"""The smallest distance of two meshes. Beside python-fcl."""

import fcl
import numpy as np
from common import Outcome, beside, torus

import snell


def ours(vertices, faces, moved):
    first, second = snell.Scene(), snell.Scene()
    first.add_mesh(vertices, faces)
    second.add_mesh(moved, faces)
    return snell.closest_pair(first, second).distance


def theirs(vertices, faces, moved):
    objects = []
    for corners in (vertices, moved):
        model = fcl.BVHModel()
        model.beginModel(len(corners), len(faces))
        model.addSubModel(corners, faces)
        model.endModel()
        objects.append(fcl.CollisionObject(model, fcl.Transform()))
    return fcl.distance(*objects, fcl.DistanceRequest(), fcl.DistanceResult())


def run() -> Outcome:
    vertices, faces = torus(96)
    moved = np.roll(vertices, 2, axis=1) + [1, 0.05, 0]
    return beside("clearance", "python-fcl", ours, theirs, vertices, faces, moved)
