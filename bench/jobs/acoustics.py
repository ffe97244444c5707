"""The ways of 20,000 rays over 50 mirror reflections in a room. Beside trimesh with Embree."""

import numpy as np
import trimesh
from common import Outcome, beside

import snell


def ours(vertices, faces, origins, directions):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    way = np.zeros(len(origins))
    for _ in range(50):
        hits = scene.cast_rays((origins, directions), t_min=1e-9)
        way += hits.t_hit
        normals = hits.normals
        directions = directions - 2 * (directions * normals).sum(1, keepdims=True) * normals
        origins = hits.points
    return way


def theirs(vertices, faces, origins, directions):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    way = np.zeros(len(origins))
    for _ in range(50):
        starts = origins + 1e-6 * directions
        points, rays, triangles = mesh.ray.intersects_location(
            starts, directions, multiple_hits=False
        )
        ends, normals = np.full_like(origins, np.inf), np.zeros_like(origins)
        ends[rays], normals[rays] = points, mesh.face_normals[triangles]
        way += np.linalg.norm(ends - origins, axis=1)
        directions = directions - 2 * (directions * normals).sum(1, keepdims=True) * normals
        origins = ends
    return way


def run() -> Outcome:
    room = trimesh.creation.box(bounds=[[0, 0, 0], [7, 5, 3]])
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = np.tile([2.0, 2.2, 1.4], (len(directions), 1))
    vertices, faces = np.asarray(room.vertices), np.asarray(room.faces)
    # Mirrored room by room, each ray is straight: its reflections are where it crosses the walls'
    # planes, and the last is the fiftieth crossing.
    size = np.array([7.0, 5.0, 3.0])
    first = np.where(directions > 0, size - origins, origins)[..., None]
    crossings = (first + size[:, None] * np.arange(50)) / np.abs(directions)[..., None]
    exact = np.sort(crossings.reshape(len(origins), -1), axis=1)[:, 49]
    values = vertices, faces, origins, directions
    return beside("room acoustics", "trimesh + embreex", ours, theirs, *values, exact=exact)
