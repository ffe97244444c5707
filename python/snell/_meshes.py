"""Meshes of other libraries as arrays. No library is imported: attributes identify the mesh."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ._cells import Blocks, blocks_of_vtk, surface
from ._snell import Material, Texture


def arrays_of(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """The vertices ``(n, 3)`` and faces ``(m, 3)`` of what :func:`parts_of` takes."""
    parts = parts_of(mesh)
    return parts["vertices"], parts["faces"]


def parts_of(mesh: Any) -> dict[str, Any]:
    """The arguments of ``Scene.add_mesh`` for a mesh of trimesh (or a scene of trimesh), Open3D
    (both kinds), meshio or PyVista, or for a list of such meshes: ``vertices`` and ``faces``, and
    as far as the mesh has them ``colors``, ``uvs`` and ``material``.
    """
    if isinstance(mesh, (list, tuple)) and mesh and not np.isscalar(mesh[0]):
        return _joined([parts_of(part) for part in mesh])
    if hasattr(mesh, "geometry") and hasattr(mesh, "dump"):  # trimesh.Scene
        parts = mesh.dump()
        if not len(parts):
            raise ValueError("vertices: the scene of trimesh is empty, expected a mesh in it")
        return _joined([parts_of(part) for part in parts])
    if hasattr(mesh, "n_blocks") and hasattr(mesh, "recursive_iterator"):  # pyvista.MultiBlock
        parts = [part for part in mesh.recursive_iterator() if part is not None]
        if not parts:
            raise ValueError("vertices: the MultiBlock of PyVista is empty, expected a mesh in it")
        return _joined([parts_of(part) for part in parts])
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):  # trimesh
        return _of_trimesh(mesh)
    if hasattr(mesh, "vertices") and hasattr(mesh, "triangles"):  # open3d.geometry.TriangleMesh
        parts = {"vertices": np.asarray(mesh.vertices), "faces": np.asarray(mesh.triangles)}
        colors = np.asarray(getattr(mesh, "vertex_colors", ()))
        return parts | ({"colors": _encoded(colors)} if len(colors) else {})
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):  # open3d.t.geometry.TriangleMesh
        parts = {
            "vertices": mesh.vertex.positions.numpy(),
            "faces": mesh.triangle.indices.numpy(),
        }
        try:
            return parts | {"colors": _encoded(mesh.vertex.colors.numpy())}
        except (AttributeError, IndexError, KeyError, RuntimeError):  # It has none.
            return parts
    if hasattr(mesh, "vertices"):  # trimesh.PointCloud, trimesh.path.Path3D
        raise TypeError(
            f"vertices: {type(mesh).__name__} has no faces; points are added by "
            "add_spheres(points, radius), lines by add_curves(points, radius)"
        )
    vertices, faces = _surface_of(mesh)
    return {"vertices": vertices, "faces": faces}


def _encoded(colors: np.ndarray) -> np.ndarray:
    """Colours as they are shown, floats up to 1 or 8-bit, as 16-bit or 8-bit sRGB."""
    if colors.dtype == np.uint8:
        return colors
    encoded: np.ndarray = (np.clip(colors, 0, 1) * 65535 + 0.5).astype(np.uint16)
    return encoded


def _of_trimesh(mesh: Any) -> dict[str, Any]:
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    parts: dict[str, Any] = {"vertices": vertices, "faces": faces}
    visual: Any = getattr(mesh, "visual", None)
    kind = getattr(visual, "kind", None)
    if kind == "vertex":
        parts["colors"] = np.asarray(visual.vertex_colors)
    elif kind == "face":
        # Corners are not shared by faces of two colours.
        parts["vertices"] = vertices[faces].reshape(-1, 3)
        parts["faces"] = np.arange(faces.size).reshape(-1, 3)
        parts["colors"] = np.repeat(np.asarray(visual.face_colors), 3, axis=0)
    elif kind == "texture":
        material, uv = visual.material, getattr(visual, "uv", None)
        image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
        if uv is not None:
            parts["uvs"] = np.asarray(uv) * [1, -1] + [0, 1]
        if uv is not None and image is not None:
            texture = Texture(np.asarray(image.convert("RGB")))
            parts["material"] = Material("diffuse", reflectance=texture)
        elif getattr(material, "main_color", None) is not None:
            color = np.asarray(material.main_color, np.uint8)
            parts["colors"] = np.tile(color, (len(vertices), 1))
    return parts


def _joined(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Several meshes as one, in order. Colours are kept, white where a mesh has none; textures are
    not, with a warning.
    """
    if len(parts) == 1:
        return parts[0]
    sizes = [len(part["vertices"]) for part in parts]
    starts = np.cumsum([0, *sizes[:-1]])
    joined: dict[str, Any] = {
        "vertices": np.concatenate([part["vertices"] for part in parts]),
        "faces": np.concatenate(
            [np.asarray(part["faces"], np.int64) + s for part, s in zip(parts, starts, strict=True)]
        ),
    }
    if any("colors" in part for part in parts):
        joined["colors"] = np.concatenate(
            [_bytes(part.get("colors"), n) for part, n in zip(parts, sizes, strict=True)]
        )
    if any("material" in part for part in parts):
        warnings.warn(
            "vertices: the textures of several meshes are left out; add the meshes one by one",
            stacklevel=2,
        )
    return joined


def _bytes(colors: np.ndarray | None, count: int) -> np.ndarray:
    """Colours ``(count, 4)`` as 8-bit sRGB; white for ``None``."""
    found = np.full((count, 4), 255, np.uint8)
    if colors is not None:
        wide = colors.astype(np.float64) / (257 if colors.dtype == np.uint16 else 1)
        found[:, : colors.shape[1]] = np.round(wide)
    return found


def _surface_of(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    has_cells = hasattr(mesh, "points") and hasattr(mesh, "cells_dict")
    if has_cells and not hasattr(mesh, "celltypes"):  # meshio.Mesh
        points = _in_space(np.asarray(mesh.points))
        blocks = list(mesh.cells_dict.items())
        if hasattr(mesh, "cells"):
            blocks = [(block.type, block.data) for block in mesh.cells]
        return points, surface(points, blocks, "meshio")
    if hasattr(mesh, "points") and hasattr(mesh, "faces") and not hasattr(mesh, "celltypes"):
        return np.asarray(mesh.points), surface(  # pyvista.PolyData
            np.asarray(mesh.points), _blocks_of_polydata(mesh), "PyVista"
        )
    if not hasattr(mesh, "celltypes") and hasattr(mesh, "cast_to_unstructured_grid"):
        mesh = mesh.cast_to_unstructured_grid()  # pyvista.ImageData, StructuredGrid and others
    if hasattr(mesh, "points") and hasattr(mesh, "celltypes"):  # pyvista.UnstructuredGrid
        points, nodes = np.asarray(mesh.points), np.asarray(mesh.cell_connectivity)
        # The older name of the newer one.
        offsets = np.asarray(mesh.cell_offsets if hasattr(mesh, "cell_offsets") else mesh.offset)
        blocks = blocks_of_vtk(np.asarray(mesh.celltypes), offsets, nodes)
        return points, surface(points, blocks, "PyVista")
    raise TypeError(
        f"faces is left out, and vertices is {type(mesh).__name__}, not a mesh of trimesh, Open3D, "
        "meshio or PyVista"
    )


def _in_space(points: np.ndarray) -> np.ndarray:
    """Points of the plane in space, at z = 0."""
    if points.ndim == 2 and points.shape[1] == 2:
        return np.column_stack([points, np.zeros(len(points), points.dtype)])
    return points


def _blocks_of_polydata(mesh: Any) -> Blocks:
    """The cells of a surface of VTK: its lists have the number of corners, then the corners."""
    blocks: Blocks = []
    lists = {1: "verts", 3: "lines", 7: "faces", 6: "strips"}
    for kind, name in lists.items():
        nodes = np.asarray(getattr(mesh, name, ()), dtype=np.int64).ravel()
        if kind == 7 and len(nodes) % 4 == 0 and (nodes[::4] == 3).all():
            blocks.append(("triangle", nodes.reshape(-1, 4)[:, 1:]))
            continue
        starts, at = [], 0
        while at < len(nodes):
            starts.append(at)
            at += 1 + int(nodes[at])
        keep = np.ones(len(nodes), dtype=bool)
        keep[starts] = False
        offsets = np.concatenate([[0], np.cumsum(nodes[starts])]).astype(np.int64)
        blocks += blocks_of_vtk(np.full(len(starts), kind), offsets, nodes[keep])
    return blocks
