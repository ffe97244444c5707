"""Meshes of other libraries as arrays. No library is imported: attributes identify the mesh."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np


def arrays_of(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """The vertices ``(n, 3)`` and faces ``(m, 3)`` of a mesh of trimesh, Open3D (both kinds),
    meshio or PyVista.
    """
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):  # trimesh
        return np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if hasattr(mesh, "vertices") and hasattr(mesh, "triangles"):  # open3d.geometry.TriangleMesh
        return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):  # open3d.t.geometry.TriangleMesh
        return mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()
    if hasattr(mesh, "points") and hasattr(mesh, "cells_dict"):  # meshio.Mesh
        _check_cells(mesh.cells_dict)
        quads = np.asarray(mesh.cells_dict.get("quad", np.empty((0, 4), dtype=np.int64)))
        triangles = np.asarray(mesh.cells_dict.get("triangle", np.empty((0, 3), dtype=np.int64)))
        return np.asarray(mesh.points), np.concatenate(
            [triangles, quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        )
    if hasattr(mesh, "points") and hasattr(mesh, "faces"):  # pyvista.PolyData
        return np.asarray(mesh.points), _fans(np.asarray(mesh.faces).ravel())
    raise TypeError(
        f"faces is left out, and vertices is {type(mesh).__name__}, not a mesh of trimesh, Open3D, "
        "meshio or PyVista"
    )


def _check_cells(cells: dict[str, Any]) -> None:
    """Refuses cells of a meshio mesh that are no surface, and warns of points and lines."""
    others = [kind for kind in cells if kind not in ("triangle", "quad") and len(cells[kind])]
    left_out = [kind for kind in others if kind.startswith(("vertex", "line"))]
    if others != left_out:
        kinds = ", ".join(kind for kind in others if kind not in left_out)
        raise TypeError(
            f"vertices: the meshio mesh has cells of the kind {kinds}, expected triangle and quad; "
            "give it the triangles of its surface"
        )
    if left_out:
        warnings.warn(
            f"vertices: the cells of the kind {', '.join(left_out)} are left out", stacklevel=2
        )


def _fans(faces: np.ndarray) -> np.ndarray:
    """The triangles of polygons in the form of VTK: the number of corners, then the corners."""
    found, at = [], 0
    if len(faces) % 4 == 0 and (faces[::4] == 3).all():
        return faces.reshape(-1, 4)[:, 1:]
    while at < len(faces):
        corners = faces[at + 1 : at + 1 + faces[at]]
        found += [[corners[0], b, c] for b, c in itertools.pairwise(corners[1:])]
        at += 1 + len(corners)
    return np.array(found, dtype=np.int64).reshape(-1, 3)
