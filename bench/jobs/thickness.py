"""The wall thickness at each triangle of a mesh. Beside trimesh with Embree."""

import numpy as np
import trimesh
from common import Outcome, beside, torus

import snell


def ours(vertices, faces):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return scene.cast_rays(((a + b + c) / 3, -normals), t_min=1e-9).t_hit


def theirs(vertices, faces):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    starts = mesh.triangles_center - 1e-5 * mesh.face_normals
    places, rays, _ = mesh.ray.intersects_location(starts, -mesh.face_normals, multiple_hits=False)
    thickness = np.full(len(faces), np.inf)
    thickness[rays] = np.linalg.norm(places - mesh.triangles_center[rays], axis=1)
    return thickness


def run() -> Outcome:
    return beside("wall thickness", "trimesh + embreex", ours, theirs, *torus(256))
