"""Meshes of other libraries as arrays. No library is imported: attributes identify the mesh."""

from __future__ import annotations

from typing import Any

import numpy as np


def arrays_of(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """The vertices ``(n, 3)`` and faces ``(m, 3)`` of a mesh of trimesh, Open3D (both kinds) or
    meshio.
    """
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):  # trimesh
        return np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if hasattr(mesh, "vertices") and hasattr(mesh, "triangles"):  # open3d.geometry.TriangleMesh
        return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):  # open3d.t.geometry.TriangleMesh
        return mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()
    if hasattr(mesh, "points") and hasattr(mesh, "cells_dict"):  # meshio.Mesh
        quads = np.asarray(mesh.cells_dict.get("quad", np.empty((0, 4), dtype=np.int64)))
        triangles = np.asarray(mesh.cells_dict.get("triangle", np.empty((0, 3), dtype=np.int64)))
        return np.asarray(mesh.points), np.concatenate(
            [triangles, quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        )
    raise TypeError(
        f"faces is left out, and vertices is {type(mesh).__name__}, not a mesh of trimesh, Open3D "
        "or meshio"
    )
