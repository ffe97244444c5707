"""The length of a quarter of a million rays inside of a part. Beside trimesh with Embree."""

import numpy as np
import trimesh
from common import Outcome, beside, torus

import snell


def ours(vertices, faces, source, pixels):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    found = scene.list_intersections((source, pixels - source))
    way = (pixels - source)[found.ray_ids]
    leaving = (way * found.normals).sum(axis=1) > 0
    part = np.where(leaving, found.t_hit, -found.t_hit) * np.linalg.norm(way, axis=1)
    return np.bincount(found.ray_ids, part, len(pixels))


def theirs(vertices, faces, source, pixels):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    way = pixels - source
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    places, rays, triangles = mesh.ray.intersects_location(np.tile(source, (len(way), 1)), way)
    leaving = (way[rays] * mesh.face_normals[triangles]).sum(axis=1) > 0
    distance = np.linalg.norm(places - source, axis=1)
    return np.bincount(rays, np.where(leaving, distance, -distance), len(pixels))


def run() -> Outcome:
    u, v = np.meshgrid(np.linspace(-2, 2, 512), np.linspace(-2, 2, 512))
    pixels = np.stack([u.ravel(), np.full(u.size, 3.0), v.ravel()], -1)
    source = np.array([0.1, -9.0, 0.2])
    return beside("radiography", "trimesh + embreex", ours, theirs, *torus(), source, pixels)
