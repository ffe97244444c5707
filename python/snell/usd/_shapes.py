"""Spheres, cubes, cylinders, cones, capsules and planes as exact shapes; points as spheres."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdGeom

from ._bindings import bound_materials, display_material, material_of
from ._context import Context, rows
from ._primvars import first_row, is_varying, primvar_rows

__all__ = ["from_y", "points", "shape"]

#: Maximum number of spheres that stand for points.
_MAX_POINTS = 100_000


def shape(context: Context, prim: Any) -> list[int]:
    """The nodes of a shape."""
    kind = str(prim.GetPrimTypeInfo().GetSchemaTypeName())
    get = lambda name, default: float(context.value(prim.GetAttribute(name), default))  # noqa: E731
    axis = str(context.value(prim.GetAttribute("axis"), "Z"))
    if kind == "Sphere":
        return [
            context.add_shape(
                {"shape": "sphere", "radius": get("radius", 1)}, material_of(context, prim)
            )
        ]
    if kind == "Cube":
        half = get("size", 2) / 2
        return [
            context.add_shape(
                {"shape": "box", "min": [-half] * 3, "max": [half] * 3}, material_of(context, prim)
            )
        ]
    if kind in ("Cylinder", "Cone"):
        form = {"shape": kind.lower(), "radius": get("radius", 1), "height": get("height", 2)}
        return [context.add_shape(form, material_of(context, prim), from_y(axis))]
    if kind == "Capsule":
        return _capsule(
            context, get("radius", 0.5), get("height", 1), material_of(context, prim), from_y(axis)
        )
    if kind == "Plane":
        # The normal of the plane is the axis; the normal of Snell's rectangle is z.
        form = {"shape": "rectangle", "half_size": [get("width", 2) / 2, get("length", 2) / 2]}
        return [context.add_shape(form, material_of(context, prim), _from_z(axis))]
    if prim.IsA(UsdGeom.Boundable):
        context.remark(f"{prim.GetPath()}: {kind} is not supported and was left out")
    return []


def _capsule(
    context: Context, radius: float, height: float, material: int, turn: np.ndarray
) -> list[int]:
    found = [
        context.add_shape(
            {"shape": "cylinder", "radius": radius, "height": height, "caps": False}, material, turn
        )
    ]
    for side in (0.5, -0.5):
        move = np.eye(4)
        move[1, 3] = side * height
        found.append(
            context.add_shape({"shape": "sphere", "radius": radius}, material, turn @ move)
        )
    return found


def points(context: Context, prim: Any) -> list[int]:
    """A sphere for each point."""
    given = UsdGeom.Points(prim)
    positions = context.array(given.GetPointsAttr(), 3)
    widths = context.array(given.GetWidthsAttr(), 1, [1.0]).reshape(-1)
    if len(positions) > _MAX_POINTS:
        context.remark(
            f"{prim.GetPath()}: {len(positions)} points, of which the first {_MAX_POINTS} are shown"
        )
        positions = positions[:_MAX_POINTS]
    if len(widths) < len(positions):
        widths = np.resize(widths if len(widths) else [1.0], len(positions))
    balls = _balls(context, prim, len(positions))
    found = []
    for position, width, ball in zip(positions, widths, balls, strict=False):
        place = np.diag([width, width, width, 1.0])
        place[:3, 3] = position
        found.append(context.add_node({"transform": rows(place), "children": [ball]}))
    return found


def _balls(context: Context, prim: Any, count: int) -> list[int]:
    """The node of each point's sphere; points of one colour and opacity share a node."""
    form = {"shape": "sphere", "radius": 0.5}
    shown = np.array([[0.18, 0.18, 0.18, 1.0]] * count).reshape(count, 4)
    varies = False
    for name, place in (("displayColor", slice(0, 3)), ("displayOpacity", slice(3, 4))):
        found, width = primvar_rows(context, prim, name), place.stop - place.start
        if found is not None and is_varying(found) and len(found[0]) >= count:
            shown[:, place] = found[0][:count, :width]
            varies = True
        elif (one := first_row(found, width)) is not None:
            shown[:, place] = one
    if bound_materials(prim) or not varies:
        return [context.add_shape(form, material_of(context, prim))] * count
    distinct, which = np.unique(shown, axis=0, return_inverse=True)
    made = [
        context.add_shape(form, display_material(context, color[:3], float(color[3])))
        for color in distinct
    ]
    return [made[i] for i in which.reshape(-1)]


def from_y(axis: str) -> np.ndarray:
    """Rotates shapes from the y axis to another axis."""
    columns = {
        "X": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        "Y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "Z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    }
    m = np.eye(4)
    m[:3, :3] = np.array(columns.get(axis, columns["Z"]), dtype=np.float64).T
    return m


def _from_z(axis: str) -> np.ndarray:
    """Rotates a rectangle from the normal z to another axis."""
    columns = {
        "X": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        "Y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        "Z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    }
    m = np.eye(4)
    m[:3, :3] = np.array(columns.get(axis, columns["Z"]), dtype=np.float64).T
    return m
