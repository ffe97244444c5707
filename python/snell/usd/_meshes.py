"""Meshes: the triangles of their polygons, the attributes of their points and corners, and the
materials of their parts.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pxr import UsdGeom, UsdShade

from ._bindings import material_of
from ._context import Context, Needs
from ._nurbs import Patch, patch
from ._polygons import triangulated
from ._primvars import primvar_rows
from ._subdivision import LoopTopology, Topology, levels_for
from ._tiles import cut_at_borders, tiles_of

__all__ = ["mesh", "triangles_of"]

#: Names of texture coordinates, the most common first.
_COORDINATES = ("st", "UVMap", "st0", "map1", "uv")
_SCHEMES = {"catmullClark": Topology, "loop": LoopTopology}


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
    #: Of a patch, how values of control points become those of its points.
    patch: Patch | None = None

    @property
    def triangles(self) -> np.ndarray:
        return self.indices[self.corners]

    def interpolated(self, values: np.ndarray, interpolation: str) -> Any:
        """Values in the form that `Context.add_mesh` takes; `None` if their number is wrong."""
        if self.patch is not None and len(values) == self.patch.weights.size:
            return ("vertex", self.patch.of(values))
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
        if interpolation == "constant" and len(values) > 0:
            return ("vertex", np.repeat(values[:1], len(self.points), axis=0))
        return None

    def of_corners(self, found: Any) -> np.ndarray:
        """Values in the form of `interpolated` as rows, one for each corner of each triangle."""
        where, values = found
        return np.asarray(values[self.triangles.reshape(-1)] if where == "vertex" else values)


def mesh(context: Context, prim: Any) -> list[Any]:
    """The surface of a mesh; instances share it."""
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    users = [prim, *(subset.GetPrim() for subset in subsets)]
    materials = [material_of(context, user, is_mesh=True) for user in users]
    needs = tuple(context.needs.get(number, Needs()) for number in materials)
    overrides = tuple(sorted((k, v.tobytes()) for k, v in context.overrides.items()))
    key = ("mesh", context.source(prim), needs, overrides)
    if key not in context.known:
        # Files that are referenced many times without being instances give equal meshes.
        equal = ("equal mesh", _fingerprint(context, users), needs, overrides)
        if equal not in context.known:
            context.known[equal] = _made(context, prim, subsets, needs)
        context.known[key] = context.known[equal]
    if context.known[key] is None:
        return []
    number, tiles = context.known[key]
    materials += [
        material_of(context, users[slot], is_mesh=True, tile=tile) for slot, tile in tiles
    ]
    return [{"mesh": number, "materials": materials}]


def _fingerprint(context: Context, prims: list[Any]) -> bytes:
    """A hash of all values that the mesh of a prim and its subsets may depend on."""
    found = hashlib.blake2b(digest_size=20)
    inherited = UsdGeom.PrimvarsAPI(prims[0]).FindPrimvarsWithInheritance()
    attributes = [primvar.GetAttr() for primvar in inherited]
    attributes += [primvar.GetIndicesAttr() for primvar in inherited if primvar.IsIndexed()]
    for prim in prims:
        found.update(str(prim.GetPrimTypeInfo().GetSchemaTypeName()).encode())
        attributes += [
            attribute
            for attribute in prim.GetAuthoredAttributes()
            if not attribute.GetName().startswith(("xformOp", "primvars:"))
        ]
    for attribute in attributes:
        value = context.value(attribute)
        array = np.array(value)
        interpolation = attribute.GetMetadata("interpolation")
        found.update(f"{attribute.GetName()} {array.dtype} {array.shape} {interpolation} ".encode())
        found.update(array.tobytes() if array.dtype.kind in "bfiu" else repr(value).encode())
    return found.digest()


def triangles_of(context: Context, prim: Any) -> np.ndarray:
    """Corners of the triangles of a mesh, in its own space."""
    polygons = _polygons(context, prim)
    return (
        polygons.points[polygons.triangles].astype(np.float64) if polygons else np.zeros((0, 3, 3))
    )


def _polygons(context: Context, prim: Any) -> _Polygons | None:
    if prim.IsA(UsdGeom.TetMesh):
        return _outside(context, prim)
    if prim.IsA(UsdGeom.NurbsPatch):
        return _patch(context, prim)
    if prim.IsA(UsdGeom.Cube):
        return _cube(context, prim)
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
        points, parents = level.smooth(points), parents[level.parents]
    if levels:
        finest = levels[-1].divided()
        counts, indices, points = finest.counts, finest.indices, points.astype(np.float32)
        holes = np.flatnonzero(np.isin(parents, holes))
    corners, faces = triangulated(points, counts, indices, holes)
    faces = parents[faces]
    if context.value(given.GetOrientationAttr()) == "leftHanded":
        corners = corners[:, ::-1]
    return _Polygons(points, indices, corners, faces, levels)


def _outside(context: Context, prim: Any) -> _Polygons | None:
    """The surface of a mesh of tetrahedra."""
    given = UsdGeom.TetMesh(prim)
    points = context.array(given.GetPointsAttr(), 3).astype(np.float32)
    faces = context.value(given.GetSurfaceFaceVertexIndicesAttr(), [])
    if not len(faces):
        faces = UsdGeom.TetMesh.ComputeSurfaceFaces(given, context.time)
    indices = np.array(faces, dtype=np.int64).reshape(-1)
    if not len(indices) or indices.min() < 0 or indices.max() >= len(points):
        context.remark(f"{prim.GetPath()}: tetrahedra that do not fit their points are left out")
        return None
    corners = np.arange(len(indices)).reshape(-1, 3)
    if context.value(given.GetOrientationAttr()) == "leftHanded":
        corners = corners[:, ::-1]
    return _Polygons(points, indices, corners, np.arange(len(corners)))


def _patch(context: Context, prim: Any) -> _Polygons | None:
    """The quadrilaterals of a patch of B-splines; values of control points become those of its
    points.
    """
    found = patch(context, prim)
    if found is None:
        return None
    points, quads = (
        found.of(context.array(UsdGeom.NurbsPatch(prim).GetPointsAttr(), 3)),
        found.quads,
    )
    indices = quads.reshape(-1)
    counts = np.full(len(quads), 4)
    corners, faces = triangulated(points, counts, indices, np.zeros(0, dtype=np.int64))
    if str(context.value(UsdGeom.Gprim(prim).GetOrientationAttr())) == "leftHanded":
        corners = corners[:, ::-1]
    return _Polygons(points.astype(np.float32), indices, corners, faces * 0, patch=found)


def _cube(context: Context, prim: Any) -> _Polygons:
    """The six faces of a cube, in the order of USD."""
    half = float(context.value(UsdGeom.Cube(prim).GetSizeAttr(), 2.0)) / 2
    signs = [(1, 1, 1), (-1, 1, 1), (-1, -1, 1), (1, -1, 1)]
    signs += [(-1, -1, -1), (-1, 1, -1), (1, 1, -1), (1, -1, -1)]
    indices = [0, 1, 2, 3, 4, 5, 6, 7, 0, 6, 5, 1, 4, 7, 3, 2, 0, 3, 7, 6, 4, 2, 1, 5]
    points = np.array(signs, dtype=np.float32) * half
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    corners = (np.arange(6)[:, None, None] * 4 + halves).reshape(-1, 3)
    return _Polygons(points, np.array(indices), corners, np.repeat(np.arange(6), 2))


def _levels(
    context: Context, given: Any, points: int, counts: np.ndarray, indices: np.ndarray
) -> list[Topology]:
    """The levels of the subdivision of a mesh; none if it has none, or is large already."""
    scheme = str(context.value(given.GetSubdivisionSchemeAttr()))
    if scheme not in _SCHEMES or counts.min() < 3:
        return []
    if scheme == "loop" and counts.max() > 3:
        context.remark(
            f"{given.GetPath()}: the scheme loop is for triangles; the polygons are shown instead"
        )
        return []
    number = levels_for(len(indices), context.corners_left)
    if number == 0:
        return []
    context.corners_left -= len(indices) * 4**number
    edges, sharpness = _creases(context, given, points)
    pins = np.array(context.value(given.GetCornerIndicesAttr(), []), dtype=np.int64)
    pinned = context.array(given.GetCornerSharpnessesAttr(), 1)[:, 0]
    if len(pins) != len(pinned) or pins.min(initial=0) < 0 or pins.max(initial=-1) >= points:
        context.remark(f"{given.GetPath()}: corners that do not fit the mesh are left out")
        pins, pinned = np.zeros(0, dtype=np.int64), np.zeros(0)
    border = str(context.value(given.GetInterpolateBoundaryAttr()))
    rule = str(context.value(given.GetTriangleSubdivisionRuleAttr()))
    level = _SCHEMES[scheme](
        points,
        counts,
        indices,
        edges,
        sharpness,
        pins,
        pinned,
        border == "edgeAndCorner",
        rule == "smooth",
    )
    if border == "none" and np.any(np.bincount(level.edge) != 2):
        context.remark(
            f"{given.GetPath()}: faces at the border, which its rule leaves out, are shown"
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


def _made(
    context: Context, prim: Any, subsets: list[Any], needs: tuple[Needs, ...]
) -> tuple[int, list[tuple[int, int]]] | None:
    """The number of a mesh, and the slots and tiles of further materials. Materials with pictures
    in tiles have one slot for each tile that is seen.
    """
    polygons = _polygons(context, prim)
    if polygons is None:
        return None
    slots = np.zeros(len(polygons.faces), dtype=np.uint16)
    for slot, subset in enumerate(subsets, start=1):
        if str(context.value(subset.GetElementTypeAttr(), "face")) != "face":
            context.remark(
                f"{subset.GetPath()}: a subset of something other than faces is left out"
            )
            continue
        members = np.array(context.value(subset.GetIndicesAttr(), []), dtype=np.int64)
        slots[np.isin(polygons.faces, members)] = slot
    sets = [_coordinates(context, prim, polygons, needs, number) for number in (0, 1)]
    attributes = {
        "normals": _normals(context, prim, polygons),
        "uvs": sets[0],
        "second_uvs": sets[1],
        "colors": _colors(context, prim, needs, slots, polygons),
    }
    tiles: list[tuple[int, int]] = []
    for slot, need in enumerate(needs):
        if need.tiles is not None and sets[need.tiles[0]] is not None:
            name = ("uvs", "second_uvs")[need.tiles[0]]
            rows = np.array(need.tiles[1])
            polygons, slots, attributes = _cut(polygons, slots, slot, attributes, name, rows)
            members = np.flatnonzero(slots == slot)
            found = tiles_of(_places(polygons, attributes[name], rows)[members].mean(axis=1))
            for tile in np.unique(found):
                slots[members[found == tile]] = len(needs) + len(tiles)
                tiles.append((slot, int(tile)))
    number = context.add_mesh(
        polygons.points, polygons.triangles, attributes, slots if subsets or tiles else None
    )
    return number, tiles


def _places(polygons: _Polygons, coordinates: Any, rows: np.ndarray) -> np.ndarray:
    """For each corner of each triangle, the coordinates in which tiles are unit squares."""
    own = polygons.of_corners(coordinates).reshape(-1, 3, 2)
    return np.asarray(own @ rows[:, :2].T + rows[:, 2])


def _cut(
    polygons: _Polygons,
    slots: np.ndarray,
    slot: int,
    attributes: dict[str, Any],
    name: str,
    rows: np.ndarray,
) -> tuple[_Polygons, np.ndarray, dict[str, Any]]:
    """The mesh with the triangles of a slot cut at the borders of the tiles that they reach over,
    by the attribute of this name.
    """
    present = {name: value for name, value in attributes.items() if value is not None}
    columns = [polygons.points[polygons.triangles.reshape(-1)]]
    columns += [polygons.of_corners(value) for value in present.values()]
    columns = [values.reshape(len(columns[0]), -1).astype(np.float64) for values in columns]
    corners = np.concatenate(columns, axis=1).reshape(len(polygons.triangles), 3, -1)
    places = _places(polygons, attributes[name], rows)
    found = cut_at_borders(corners, places, np.flatnonzero(slots == slot))
    if found is None:
        return polygons, slots, attributes
    made, origins = found
    widths = np.cumsum([values.shape[1] for values in columns])[:-1]
    points, *values = np.split(made.reshape(-1, made.shape[2]), widths, axis=1)
    every = np.arange(len(points))
    polygons = _Polygons(points, every, every.reshape(-1, 3), polygons.faces[origins])
    attributes = {name: ("vertex", own) for name, own in zip(present, values, strict=True)}
    return polygons, slots[origins], attributes


def _coordinates(
    context: Context, prim: Any, polygons: _Polygons, needs: tuple[Needs, ...], number: int
) -> Any:
    """The set of texture coordinates of this number."""
    names = [name for need in needs for name, place in need.coordinates if place == number]
    return _primvar(context, prim, (*names, *(_COORDINATES if number == 0 else ())), 2, polygons)


def _primvar(
    context: Context, prim: Any, names: tuple[str, ...], width: int, polygons: _Polygons
) -> Any:
    """The first primvar of these names."""
    for name in names:
        found = primvar_rows(context, prim, name)
        if found is None:
            continue
        rows, interpolation = found
        values = (
            polygons.interpolated(rows[:, :width].astype(np.float32), interpolation)
            if rows.shape[1] >= width
            else None
        )
        if values is None:
            context.remark(
                f"{prim.GetPath()}: the primvar {name} does not fit the mesh and is left out"
            )
        return values
    return None


def _colors(
    context: Context, prim: Any, needs: tuple[Needs, ...], slots: np.ndarray, polygons: _Polygons
) -> Any:
    """The colours and opacities of the vertices, white where the material of a triangle reads
    none.
    """
    wanted = [(need.color, need.opacity) for need in needs]
    if not any(color or opacity for color, opacity in wanted):
        return None
    if len(set(wanted)) == 1:
        return _colors_of(context, prim, wanted[0], polygons)
    made = np.ones((len(polygons.triangles), 3, 4), dtype=np.float32)
    for slot, names in enumerate(wanted):
        found = _colors_of(context, prim, names, polygons)
        if found is not None:
            made[slots == slot] = polygons.of_corners(found).reshape(-1, 3, 4)[slots == slot]
    return ("corner", made.reshape(-1, 4))


def _colors_of(
    context: Context, prim: Any, names: tuple[str | None, str | None], polygons: _Polygons
) -> Any:
    """The primvars of these names as colours and opacities."""
    color = _primvar(context, prim, (names[0],), 3, polygons) if names[0] else None
    opacity = _primvar(context, prim, (names[1],), 1, polygons) if names[1] else None
    if color is None and opacity is None:
        return None
    one: Any = opacity if color is None else color
    if color is None or opacity is None or color[0] == opacity[0]:
        where, size = one[0], len(one[1])
    else:
        where, size = "corner", polygons.triangles.size
        color, opacity = (
            ("corner", polygons.of_corners(found)) if found else None for found in (color, opacity)
        )
    made = np.ones((size, 4), dtype=np.float32)
    if color is not None:
        made[:, :3] = color[1]
    if opacity is not None:
        made[:, 3] = opacity[1][:, 0]
    return (where, made)


def _normals(context: Context, prim: Any, polygons: _Polygons) -> Any:
    """The normals of the file for polygons, and smooth ones for surfaces of subdivision, for which
    those of the file do not count. Polygons without normals are flat.
    """
    given = UsdGeom.PointBased(prim)
    if not given:
        return None
    if polygons.patch is not None:
        return ("vertex", _smooth(polygons))
    scheme = str(context.value(prim.GetAttribute("subdivisionScheme"), "none"))
    if polygons.levels or (scheme == "catmullClark" and len(polygons.faces)):
        if not polygons.levels:
            context.remark(
                f"{prim.GetPath()}: the mesh is not subdivided; its polygons are shown with smooth "
                "normals"
            )
        return ("vertex", _smooth(polygons))
    if scheme == "bilinear":
        return None
    found = _primvar(context, prim, ("normals",), 3, polygons)
    values = context.value(given.GetNormalsAttr())
    if found is None and values is not None and len(values) > 0:
        found = polygons.interpolated(
            np.array(values, dtype=np.float32).reshape(-1, 3), given.GetNormalsInterpolation()
        )
        if found is None:
            context.remark(f"{prim.GetPath()}: the normals do not fit the mesh and are left out")
    return found


def _smooth(polygons: _Polygons) -> np.ndarray:
    """Normals of points: the mean of those of adjacent triangles, weighted by area."""
    corners = polygons.points[polygons.triangles].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((len(polygons.points), 3))
    for k in range(3):
        np.add.at(normals, polygons.triangles[:, k], cross)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
