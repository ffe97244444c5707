"""Meshes: the triangles of their polygons, the attributes of their points and corners, and the
materials of their parts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pxr import UsdGeom, UsdShade

from ._bindings import material_of
from ._context import Context
from ._polygons import triangulated
from ._subdivision import Topology, levels_for

__all__ = ["mesh", "triangles_of"]

#: Names of texture coordinates, the most common first.
_COORDINATES = ("st", "UVMap", "st0", "map1", "uv")


@dataclass
class _Polygons:
    """The polygons of a mesh and their triangles."""

    points: np.ndarray
    #: For each corner of each face, the index of its point; one face after the other.
    indices: np.ndarray
    #: For each triangle, the positions of its corners in `indices`.
    corners: np.ndarray
    #: The face of each triangle; of a subdivided mesh, the face before the subdivision.
    faces: np.ndarray
    #: The levels of the subdivision, the coarsest first.
    levels: list[Topology] = field(default_factory=list)

    @property
    def triangles(self) -> np.ndarray:
        return self.indices[self.corners]

    def interpolated(self, values: np.ndarray, interpolation: str) -> Any:
        """Values in the form that `Context.add_mesh` takes; `None` if their number is wrong."""
        for level in self.levels:
            if interpolation == "vertex" and len(values) == level.points:
                values = level.smooth(values)
            elif interpolation == "varying" and len(values) == level.points:
                values = level.linear(values)
            elif interpolation == "faceVarying" and len(values) == len(level.indices):
                values = level.of_corners(values)
        if interpolation in ("vertex", "varying") and len(values) == len(self.points):
            return ("vertex", values)
        if interpolation == "faceVarying" and len(values) == len(self.indices):
            return ("corner", values[self.corners.reshape(-1)])
        if interpolation == "uniform" and len(values) > self.faces.max(initial=-1):
            return ("corner", np.repeat(values[self.faces], 3, axis=0))
        if interpolation == "constant" and len(values) == 1:
            return ("vertex", np.repeat(values, len(self.points), axis=0))
        return None


def mesh(context: Context, prim: Any) -> list[Any]:
    """The surface of a mesh; instances share it."""
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    materials = [
        material_of(context, prim),
        *(material_of(context, subset.GetPrim()) for subset in subsets),
    ]
    colors = _color_primvar(context, prim, materials)
    key = ("mesh", context.source(prim), colors)
    if key not in context.known:
        context.known[key] = _made(context, prim, subsets, colors)
    number = context.known[key]
    return [] if number is None else [{"mesh": number, "materials": materials}]


def triangles_of(context: Context, prim: Any) -> np.ndarray:
    """Corners of the triangles of a mesh, in its own space."""
    polygons = _polygons(context, prim)
    return (
        polygons.points[polygons.triangles].astype(np.float64) if polygons else np.zeros((0, 3, 3))
    )


def _color_primvar(context: Context, prim: Any, materials: list[int]) -> str | None:
    """The primvar that is the colour of the vertices."""
    names = [context.vertex_colors.get(number) for number in materials]
    wanted = {name for name in names if name is not None}
    if not wanted:
        return None
    if len(wanted) > 1 or None in names[1:]:
        context.remark(
            f"{prim.GetPath()}: colours of vertices count for the whole mesh, and not for some of "
            "its materials only"
        )
    return next(name for name in names if name is not None)


def _polygons(context: Context, prim: Any) -> _Polygons | None:
    given = UsdGeom.Mesh(prim)
    points = context.array(given.GetPointsAttr(), 3).astype(np.float32)
    counts = np.array(context.value(given.GetFaceVertexCountsAttr(), []), dtype=np.int64)
    indices = np.array(context.value(given.GetFaceVertexIndicesAttr(), []), dtype=np.int64)
    if len(points) == 0 or len(counts) == 0:
        context.remark(f"{prim.GetPath()}: a mesh without points or faces is left out")
        return None
    if (
        counts.min() < 0
        or counts.sum() != len(indices)
        or indices.min(initial=0) < 0
        or indices.max(initial=0) >= len(points)
    ):
        context.remark(
            f"{prim.GetPath()}: a mesh whose faces and points do not fit together is left out"
        )
        return None
    holes = np.array(context.value(given.GetHoleIndicesAttr(), []), dtype=np.int64)
    levels = _levels(context, given, len(points), counts, indices)
    parents = np.arange(len(counts))
    for level in levels:
        points, parents = level.smooth(points), parents[level.face]
    if levels:
        finest = levels[-1].divided()
        counts, indices, points = finest.counts, finest.indices, points.astype(np.float32)
        holes = np.flatnonzero(np.isin(parents, holes))
    corners, faces = triangulated(points, counts, indices, holes)
    faces = parents[faces]
    if context.value(given.GetOrientationAttr()) == "leftHanded":
        corners = corners[:, ::-1]
    return _Polygons(points, indices, corners, faces, levels)


def _levels(
    context: Context, given: Any, points: int, counts: np.ndarray, indices: np.ndarray
) -> list[Topology]:
    """The levels of the subdivision of a mesh; none if it has none, or is large already."""
    if str(context.value(given.GetSubdivisionSchemeAttr())) != "catmullClark" or counts.min() < 3:
        return []
    number = levels_for(len(indices), context.corners_left)
    if number == 0:
        return []
    context.corners_left -= len(indices) * 4**number
    edges, sharpness = _creases(context, given, points)
    pins = np.array(context.value(given.GetCornerIndicesAttr(), []), dtype=np.int64)
    pinned = context.array(given.GetCornerSharpnessesAttr(), 1)[:, 0]
    if len(pins) != len(pinned) or pins.min(initial=0) < 0 or pins.max(initial=-1) >= points:
        pins, pinned = np.zeros(0, dtype=np.int64), np.zeros(0)
    border = str(context.value(given.GetInterpolateBoundaryAttr()))
    level = Topology(
        points, counts, indices, edges, sharpness, pins, pinned, border == "edgeAndCorner"
    )
    levels = [level]
    while len(levels) < number:
        levels.append(levels[-1].divided())
    return levels


def _creases(context: Context, given: Any, points: int) -> tuple[np.ndarray, np.ndarray]:
    """The sharp edges of a mesh as rows of two points, and their sharpness. The file has chains of
    points; a chain has one sharpness, or one for each of its edges.
    """
    lengths = np.array(context.value(given.GetCreaseLengthsAttr(), []), dtype=np.int64)
    chain = np.array(context.value(given.GetCreaseIndicesAttr(), []), dtype=np.int64)
    sharpness = context.array(given.GetCreaseSharpnessesAttr(), 1)[:, 0]
    none = np.zeros((0, 2), dtype=np.int64), np.zeros(0)
    if len(lengths) == 0:
        return none
    if lengths.min() >= 2 and lengths.sum() == len(chain):
        links = np.delete(np.arange(len(chain)), np.cumsum(lengths) - 1)
        edges = np.stack([chain[links], chain[links + 1]], axis=1)
        if len(sharpness) == len(lengths):
            sharpness = np.repeat(sharpness, lengths - 1)
        if len(sharpness) == len(edges) and chain.min() >= 0 and chain.max() < points:
            return edges, sharpness
    context.remark(f"{given.GetPath()}: creases that do not fit the mesh are left out")
    return none


def _made(context: Context, prim: Any, subsets: list[Any], colors: str | None) -> int | None:
    polygons = _polygons(context, prim)
    if polygons is None:
        return None
    attributes = {
        "normals": _normals(context, prim, polygons),
        "uvs": _primvar(context, prim, _COORDINATES, 2, polygons),
        "colors": _colors(context, prim, colors, polygons) if colors else None,
    }
    slots = np.zeros(len(polygons.faces), dtype=np.uint16)
    for slot, subset in enumerate(subsets, start=1):
        members = np.array(context.value(subset.GetIndicesAttr(), []), dtype=np.int64)
        slots[np.isin(polygons.faces, members)] = slot
    return context.add_mesh(
        polygons.points, polygons.triangles, attributes, slots if subsets else None
    )


def _primvar(
    context: Context, prim: Any, names: tuple[str, ...], width: int, polygons: _Polygons
) -> Any:
    """The first primvar of these names."""
    primvars = UsdGeom.PrimvarsAPI(prim)
    for name in names:
        primvar = primvars.FindPrimvarWithInheritance(name)
        if primvar and primvar.HasValue():
            flat = primvar.ComputeFlattened(context.time)
            flat = primvar.ComputeFlattened() if flat is None else flat
            values = np.array(flat, dtype=np.float32)
            values = values.reshape(len(values), -1)[:, :width]
            found = (
                polygons.interpolated(values, primvar.GetInterpolation())
                if values.shape[1] == width
                else None
            )
            if found is None:
                context.remark(
                    f"{prim.GetPath()}: the primvar {name} does not fit the mesh and is left out"
                )
            return found
    return None


def _colors(context: Context, prim: Any, name: str, polygons: _Polygons) -> Any:
    found = _primvar(context, prim, (name,), 3, polygons)
    if found is None:
        return None
    where, values = found
    return (where, np.concatenate([values, np.ones((len(values), 1), dtype=np.float32)], axis=1))


def _normals(context: Context, prim: Any, polygons: _Polygons) -> Any:
    given = UsdGeom.Mesh(prim)
    if context.value(given.GetSubdivisionSchemeAttr()) in (None, "none"):
        found = _primvar(context, prim, ("normals",), 3, polygons)
        values = context.value(given.GetNormalsAttr())
        if found is None and values is not None and len(values) > 0:
            found = polygons.interpolated(
                np.array(values, dtype=np.float32).reshape(-1, 3), given.GetNormalsInterpolation()
            )
        return found
    if not polygons.levels:
        context.remark(
            f"{prim.GetPath()}: the mesh is not subdivided; its polygons are shown with smooth "
            "normals"
        )
    return ("vertex", _smooth(polygons))


def _smooth(polygons: _Polygons) -> np.ndarray:
    """Normals of points: the mean of those of adjacent triangles, weighted by area."""
    corners = polygons.points[polygons.triangles].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((len(polygons.points), 3))
    for k in range(3):
        np.add.at(normals, polygons.triangles[:, k], cross)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
