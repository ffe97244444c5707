"""Curves: linear ones, cubic ones and those of Hermite as strands; NURBS, and those with colours of
their own, as tubes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pxr import UsdGeom

from ._bindings import material_of
from ._context import Context, Needs, numbers
from ._nurbs import curve_points
from ._primvars import first_row, is_varying, primvar_rows

__all__ = ["curves"]

#: Number of sides of the tubes, and of pieces of each segment of a curve.
_SIDES, _PIECES = 6, 6

#: Names of the bases of strands.
_STRANDS = {
    "linear": "linear",
    "bezier": "bezier",
    "bspline": "b-spline",
    "catmullRom": "catmull-rom",
}
_BASES = {
    "bezier": np.array(
        [[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 3, 0, 0], [1, 0, 0, 0]], dtype=np.float64
    ),
    "bspline": np.array(
        [[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 0, 3, 0], [1, 4, 1, 0]], dtype=np.float64
    )
    / 6,
    "catmullRom": np.array(
        [[-1, 3, -3, 1], [2, -5, 4, -1], [-1, 0, 1, 0], [0, 2, 0, 0]], dtype=np.float64
    )
    / 2,
}


def curves(context: Context, prim: Any) -> list[Any]:
    """The surfaces of a curves prim: one mesh for all of its curves."""
    given = UsdGeom.Curves(prim)
    points = context.array(given.GetPointsAttr(), 3)
    counts = np.array(context.value(given.GetCurveVertexCountsAttr(), []), dtype=np.int64)
    if counts.min(initial=0) < 0 or counts.sum() > len(points):
        context.remark(
            f"{prim.GetPath()}: curves whose counts and points do not fit together are left out"
        )
        return []
    name = str(prim.GetPrimTypeInfo().GetSchemaTypeName())
    kind, wrap = _kind_of(context, prim, name)
    if len(context.value(given.GetNormalsAttr(), [])):
        context.remark(
            f"{prim.GetPath()}: the normals of ribbons are left out; the curves are round"
        )
    widths = _for_points(_widths(context, prim, given), counts, kind, wrap)
    columns = [points[: counts.sum()], widths]
    material = material_of(context, prim, is_mesh=True)
    needs = context.needs.get(material, Needs())
    attributes = [(name, _varying(context, prim, name)) for name in (needs.color, needs.opacity)]
    columns += [_for_points(rows, counts, kind, wrap) for _, rows in attributes if rows is not None]
    control = np.concatenate(columns, axis=1)
    if name == "NurbsCurves":
        lines, lengths = curve_points(context, prim, control, counts)
    else:
        if name == "HermiteCurves":
            tangents = context.array(UsdGeom.HermiteCurves(prim).GetTangentsAttr(), 3)
            control, counts = _as_bezier(control, tangents, counts)
            kind = "bezier"
        strands = _strands(control, counts, kind, wrap) if len(columns) == 2 else None
        if strands is not None:
            if not strands["strands"]:
                return []
            context.curves.append(strands)
            return [{"curves": len(context.curves) - 1, "materials": [material]}]
        lines, lengths = _by_count(control, counts, lambda rows: _sampled(rows, kind, wrap))
    if not len(lengths):
        return []
    positions, normals, triangles = _tubes(lines[:, :3], lines[:, 3] / 2, lengths)
    found: dict[str, Any] = {"normals": ("vertex", normals)}
    if len(columns) > 2:
        colors = np.ones((len(lines), 4))
        at = 4
        for place, (_, rows) in zip((slice(0, 3), slice(3, 4)), attributes, strict=True):
            if rows is not None:
                colors[:, place] = lines[:, at : at + rows.shape[1]]
                at += rows.shape[1]
        found["colors"] = ("vertex", np.repeat(colors, _SIDES, axis=0))
    number = context.add_mesh(positions, triangles, found)
    return [{"mesh": number, "materials": [material]}]


def _kind_of(context: Context, prim: Any, name: str) -> tuple[str, str]:
    """The basis of curves and how they end; those without a basis count as linear."""
    given = UsdGeom.BasisCurves(prim)
    if name != "BasisCurves" or str(context.value(given.GetTypeAttr())) == "linear":
        wrap = str(context.value(given.GetWrapAttr())) if name == "BasisCurves" else "nonperiodic"
        return "linear", wrap
    return str(context.value(given.GetBasisAttr(), "bezier")), str(
        context.value(given.GetWrapAttr())
    )


def _as_bezier(
    control: np.ndarray, tangents: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Curves of Hermite as curves of Bezier; columns after the third are interpolated linearly."""
    if len(tangents) < len(control):
        tangents = np.resize(tangents if len(tangents) else np.zeros((1, 3)), (len(control), 3))
    before = np.delete(np.arange(len(control)), np.cumsum(counts[counts > 0]) - 1)
    p, q = control[before], control[before + 1]
    inner = [p + (q - p) / 3, q - (q - p) / 3]
    inner[0][:, :3] = p[:, :3] + tangents[before] / 3
    inner[1][:, :3] = q[:, :3] - tangents[before + 1] / 3
    made = np.full((len(control), 3, control.shape[1]), np.nan)
    made[:, 0] = control
    made[before, 1], made[before, 2] = inner
    rows = made.reshape(-1, control.shape[1])
    return rows[~np.isnan(rows[:, 0])], np.where(counts > 0, 3 * counts - 2, 0)


def _widths(context: Context, prim: Any, given: Any) -> np.ndarray:
    """The widths as rows; those on the screen, in pixels, are left out."""
    if first_row(primvar_rows(context, prim, "screenSpaceWidths"), 1) == (1.0,):
        context.remark(
            f"{prim.GetPath()}: widths on the screen are left out; the curves are as thick as a "
            "hundredth of their extent"
        )
        points = context.array(given.GetPointsAttr(), 3)
        return np.array([[np.ptp(points, axis=0).max() / 100 if len(points) else 1.0]])
    found = primvar_rows(context, prim, "widths")
    if found is not None and len(found[0]):
        return found[0][:, :1]
    return context.array(given.GetWidthsAttr(), 1, [1.0])


def _varying(context: Context, prim: Any, name: str | None) -> np.ndarray | None:
    """The rows of a primvar that varies: three columns for a colour, one for an opacity."""
    found = primvar_rows(context, prim, name) if name else None
    if found is None or not is_varying(found):
        return None
    return found[0][:, : 3 if found[0].shape[1] >= 3 else 1]


def _by_count(
    control: np.ndarray, counts: np.ndarray, make: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The rows that a function makes of each curve, and the number of rows of each curve. Curves of
    equal length are computed together; curves that are only a point are left out.
    """
    starts = np.cumsum(counts) - counts
    made: list[np.ndarray] = [np.zeros((0, control.shape[1]))] * len(counts)
    for count in np.unique(counts):
        chosen = np.flatnonzero(counts == count)
        together = make(control[starts[chosen][:, None] + np.arange(count)])
        for at, line in zip(chosen, together, strict=True):
            made[at] = line
    made = [line for line in made if len(line) > 1]
    lengths = np.array([len(line) for line in made], dtype=np.int64)
    return np.concatenate(made) if made else control[:0], lengths


def _strands(
    control: np.ndarray, counts: np.ndarray, kind: str, wrap: str
) -> dict[str, Any] | None:
    """Curves without colours of their own, as exact strands; `None` if some are too short for their
    basis.
    """
    if kind not in _STRANDS or any(
        _is_short(int(count), kind, wrap) for count in np.unique(counts)
    ):
        return None
    step = 3 if kind == "bezier" else 1

    def whole(control: np.ndarray) -> np.ndarray:
        control = _extended(control, kind, wrap)
        return control[:, : control.shape[1] - (control.shape[1] - 1) % step]

    points, lengths = _by_count(control, counts, whole)
    points[:, 3] = np.maximum(points[:, 3] / 2, 0)
    return {
        "basis": _STRANDS[kind],
        "points": numbers(points[:, :4], np.float32),
        "strands": numbers(lengths, np.uint32),
    }


def _for_points(values: np.ndarray, counts: np.ndarray, kind: str, wrap: str) -> np.ndarray:
    """A row for each point. The values given may be one for all curves, one for each curve, one for
    each end of a segment, or one for each point.
    """
    total = int(counts.sum())
    if len(values) >= total:
        return values[:total]
    if len(values) == len(counts):
        return np.repeat(values, counts, axis=0)
    ends = [_ends(int(count), kind, wrap) for count in counts]
    if len(values) != sum(ends):
        return np.repeat(
            values[:1] if len(values) else np.ones((1, values.shape[1])), total, axis=0
        )
    parts = []
    for count, own in zip(counts, np.split(values, np.cumsum(ends)[:-1]), strict=False):
        at = np.linspace(0, len(own) - 1, int(count))
        parts.append(
            np.stack([np.interp(at, np.arange(len(own)), column) for column in own.T], axis=1)
        )
    return np.concatenate(parts)


def _ends(count: int, kind: str, wrap: str) -> int:
    """The number of values of a curve that vary by segment."""
    step = 3 if kind == "bezier" else 1
    if wrap == "periodic":
        return max(count // step, 0)
    inner = (
        count - 2
        if kind in ("bspline", "catmullRom") and wrap != "pinned"
        else (count - 1) // step + 1
    )
    return max(inner, 0)


def _is_short(count: int, kind: str, wrap: str) -> bool:
    """True for cubic curves with too few points for a segment, which count as linear."""
    return kind != "linear" and count < (2 if wrap == "pinned" and kind != "bezier" else 4)


def _extended(control: np.ndarray, kind: str, wrap: str) -> np.ndarray:
    """The control points of curves with those that close them, or pin them to their ends. The axes
    are the curve, the point, and the column.
    """
    if wrap == "periodic" and control.shape[1] > 2:
        more = 1 if kind in ("linear", "bezier") else 3
        return np.concatenate([control, control[:, :more]], axis=1)
    if wrap == "pinned" and kind in ("bspline", "catmullRom"):
        first = 2 * control[:, :1] - control[:, 1:2]
        last = 2 * control[:, -1:] - control[:, -2:-1]
        return np.concatenate([first, control, last], axis=1)
    return control


def _sampled(control: np.ndarray, kind: str, wrap: str) -> np.ndarray:
    """Points of curves that have equally many control points, with their other attributes in
    further columns. The axes of `control` are the curve, the point, and the column.
    """
    if kind not in _BASES or _is_short(control.shape[1], kind, wrap):
        return _extended(control, "linear", wrap)
    step = 3 if kind == "bezier" else 1
    control = _extended(control, kind, wrap)
    t = np.linspace(0, 1, _PIECES, endpoint=False)
    powers = np.stack([t**3, t**2, t, np.ones_like(t)], axis=1) @ _BASES[kind]
    begins = np.arange(0, control.shape[1] - 3, step)
    segments = control[:, begins[:, None] + np.arange(4)]
    pieces = (powers @ segments).reshape(len(control), -1, control.shape[2])
    last = np.ones((1, 4)) @ _BASES[kind] @ segments[:, -1]
    return np.concatenate([pieces, last], axis=1)


def _tubes(
    points: np.ndarray, radii: np.ndarray, lengths: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals and triangles around lines of the given numbers of points; frames are
    carried along without twist.
    """
    ends = np.cumsum(lengths)
    first = np.repeat(ends - lengths, lengths)
    last = np.repeat(ends - 1, lengths)
    at = np.arange(len(points))
    tangents = points[np.minimum(at + 1, last)] - points[np.maximum(at - 1, first)]
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-300)
    x = _carried(tangents, at == first)
    y = np.cross(tangents, x)
    angles = (np.arange(_SIDES) * (2 * math.pi / _SIDES))[:, None]
    normals = np.cos(angles) * x[:, None] + np.sin(angles) * y[:, None]
    vertices = points[:, None] + normals * radii[:, None, None]
    ring = at[at != last][:, None] * _SIDES
    a = (ring + np.arange(_SIDES)).reshape(-1)
    b = (ring + (np.arange(_SIDES) + 1) % _SIDES).reshape(-1)
    triangles = np.concatenate(
        [np.stack([a, b, b + _SIDES], axis=1), np.stack([a, b + _SIDES, a + _SIDES], axis=1)]
    )
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), triangles


def _carried(tangents: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """A unit vector across each tangent: the one before, made perpendicular. Each follows from the
    last, and for single vectors plain numbers are many times faster than arrays.
    """
    found = []
    x = y = z = 0.0
    for (a, b, c), begins in zip(tangents.tolist(), starts.tolist(), strict=True):
        if begins:
            x, y, z = (0.0, c, -b) if abs(a) < 0.9 else (-c, 0.0, a)
        along = a * x + b * y + c * z
        x, y, z = x - a * along, y - b * along, z - c * along
        length = max(math.sqrt(x * x + y * y + z * z), 1e-300)
        x, y, z = x / length, y / length, z / length
        found.append((x, y, z))
    return np.array(found)
