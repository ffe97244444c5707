"""Curves as tubes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pxr import UsdGeom

from ._bindings import display_color, material_of
from ._context import Context

__all__ = ["curves"]

#: Number of sides of the tubes, and of pieces of each segment of a curve.
_SIDES, _PIECES = 6, 6

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
    given = UsdGeom.BasisCurves(prim)
    points = context.array(given.GetPointsAttr(), 3)
    counts = np.array(context.value(given.GetCurveVertexCountsAttr(), []), dtype=np.int64)
    if counts.min(initial=0) < 0 or counts.sum() > len(points):
        context.remark(
            f"{prim.GetPath()}: curves whose counts and points do not fit together are left out"
        )
        return []
    kind = (
        "linear"
        if context.value(given.GetTypeAttr()) == "linear"
        else str(context.value(given.GetBasisAttr(), "bezier"))
    )
    wrap = str(context.value(given.GetWrapAttr()))
    widths = _for_points(context.array(given.GetWidthsAttr(), 1, [1.0]), counts, kind, wrap)
    columns = [points[: counts.sum()], widths]
    colors = display_color(context, prim)
    if colors is not None and len(colors) > 1:
        columns.append(_for_points(colors, counts, kind, wrap))
    lines = np.split(np.concatenate(columns, axis=1), np.cumsum(counts)[:-1]) if len(counts) else []
    sampled = [
        line for line in (_sampled(control, kind, wrap) for control in lines) if len(line) > 1
    ]
    if not sampled:
        return []
    tubes = [_tube(line[:, :3], line[:, 3] / 2) for line in sampled]
    bases = np.cumsum([0, *(len(tube[0]) for tube in tubes)])
    attributes = {"normals": ("vertex", np.concatenate([tube[1] for tube in tubes]))}
    if len(columns) > 2:
        colors = np.repeat(np.concatenate([line[:, 4:7] for line in sampled]), _SIDES, axis=0)
        attributes["colors"] = (
            "vertex",
            np.concatenate([colors, np.ones((len(colors), 1))], axis=1),
        )
    triangles = np.concatenate(
        [tube[2] + base for tube, base in zip(tubes, bases[:-1], strict=True)]
    )
    number = context.add_mesh(np.concatenate([tube[0] for tube in tubes]), triangles, attributes)
    return [{"mesh": number, "materials": [material_of(context, prim)]}]


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


def _sampled(control: np.ndarray, kind: str, wrap: str) -> np.ndarray:
    """Points of a curve, with their other attributes in further columns."""
    if (
        kind == "linear"
        or kind not in _BASES
        or len(control) < (2 if wrap == "pinned" and kind != "bezier" else 4)
    ):
        return (
            np.concatenate([control, control[:1]])
            if wrap == "periodic" and len(control) > 2
            else control
        )
    step = 3 if kind == "bezier" else 1
    if wrap == "periodic":
        control = np.concatenate([control, control[: 4 - step]])
    elif wrap == "pinned" and kind != "bezier":
        control = np.concatenate(
            [2 * control[:1] - control[1:2], control, 2 * control[-1:] - control[-2:-1]]
        )
    t = np.linspace(0, 1, _PIECES, endpoint=False)
    powers = np.stack([t**3, t**2, t, np.ones_like(t)], axis=1) @ _BASES[kind]
    pieces = [powers @ control[i : i + 4] for i in range(0, len(control) - 3, step)]
    last = np.ones((1, 4)) @ _BASES[kind] @ control[(len(control) - 4) // step * step :][:4]
    return np.concatenate([*pieces, last])


def _tube(line: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals and triangles around a line; frames are carried along without twist."""
    tangents = np.gradient(line, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-300)
    x = np.cross(tangents[0], [1.0, 0, 0] if abs(tangents[0, 0]) < 0.9 else [0, 1.0, 0])
    angles = np.arange(_SIDES) * (2 * math.pi / _SIDES)
    normals = np.zeros((len(line), _SIDES, 3))
    for i, tangent in enumerate(tangents):
        x = x - tangent * tangent.dot(x)
        x = x / max(np.linalg.norm(x), 1e-300)
        normals[i] = np.outer(np.cos(angles), x) + np.outer(np.sin(angles), np.cross(tangent, x))
    vertices = line[:, None] + normals * radii[:, None, None]
    a = (np.arange(len(line) - 1)[:, None] * _SIDES + np.arange(_SIDES)).reshape(-1)
    b = (np.arange(len(line) - 1)[:, None] * _SIDES + (np.arange(_SIDES) + 1) % _SIDES).reshape(-1)
    triangles = np.concatenate(
        [np.stack([a, b, b + _SIDES], axis=1), np.stack([a, b + _SIDES, a + _SIDES], axis=1)]
    )
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), triangles
