"""Curves and surfaces of B-splines, with knots and weights (Piegl and Tiller, The NURBS Book)."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdGeom

from ._context import Context

__all__ = ["curve_points", "patch"]

#: Number of pieces of each segment of a curve, and maximum number of pieces of a side of a patch.
_PIECES, _MOST_PIECES = 6, 400


def _basis(order: int, knots: np.ndarray, count: int, at: np.ndarray) -> np.ndarray:
    """The share of each of `count` control points at some parameters: a row for each parameter."""
    # The last parameter belongs to the last span that is not empty.
    last = int(np.max(np.flatnonzero(knots[:-1] < knots[1:]), initial=0))
    span = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, last)
    shares = (np.arange(len(knots) - 1) == span[:, None]).astype(np.float64)
    for degree in range(1, order):
        size = len(knots) - 1 - degree
        i = np.arange(size)
        left, right = knots[i + degree] - knots[i], knots[i + degree + 1] - knots[i + 1]
        up = (at[:, None] - knots[i]) / np.where(left > 0, left, np.inf)
        down = (knots[i + degree + 1] - at[:, None]) / np.where(right > 0, right, np.inf)
        shares = up * shares[:, :-1] + down * shares[:, 1:]
    return shares[:, :count]


def _shares(
    context: Context, prim: Any, order: int, knots: np.ndarray, count: int, ends: Any
) -> np.ndarray:
    """The shares of the control points, in rows for the points of a curve. Without knots that fit
    it is the polygon of its control points.
    """
    if order < 2 or count < order or len(knots) != count + order or np.any(np.diff(knots) < 0):
        context.remark(
            f"{prim.GetPath()}: the knots do not fit; straight lines between the control points "
            "are shown"
        )
        return np.eye(count)
    low, high = knots[order - 1], knots[count]
    if ends is not None and low <= ends[0] < ends[1] <= high:
        low, high = ends
    pieces = min((count - order + 1) * _PIECES, _MOST_PIECES)
    return _basis(order, knots, count, np.linspace(low, high, pieces + 1))


def curve_points(
    context: Context, prim: Any, control: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points of the curves of a prim, with their other attributes in further columns, and the
    number of points of each curve.
    """
    given = UsdGeom.NurbsCurves(prim)
    orders = np.array(context.value(given.GetOrderAttr(), []), dtype=np.int64)
    knots = context.array(given.GetKnotsAttr(), 1)[:, 0]
    ends = context.array(given.GetRangesAttr(), 2)
    weights = context.array(given.GetPointWeightsAttr(), 1)[:, 0]
    orders = np.resize(orders if len(orders) else [4], len(counts))
    lines, start, first = [], 0, 0
    for number, (order, count) in enumerate(zip(orders, counts, strict=True)):
        own = knots[first : first + count + order]
        end = ends[number] if number < len(ends) else None
        shares = _shares(context, prim, int(order), own, int(count), end)
        shares *= weights[start : start + count] if len(weights) == len(control) else 1.0
        shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1e-300)
        lines.append(shares @ control[start : start + count])
        start, first = start + count, first + count + order
    lengths = np.array([len(line) for line in lines], dtype=np.int64)
    return np.concatenate(lines) if lines else control[:0], lengths


def patch(context: Context, prim: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """The points of a grid on a patch, the corners of its quadrilaterals, and for each point the
    shares of the control points.
    """
    given = UsdGeom.NurbsPatch(prim)
    points = context.array(given.GetPointsAttr(), 3)
    sides = []
    for count, order, knots, ends in (
        (
            given.GetUVertexCountAttr(),
            given.GetUOrderAttr(),
            given.GetUKnotsAttr(),
            given.GetURangeAttr(),
        ),
        (
            given.GetVVertexCountAttr(),
            given.GetVOrderAttr(),
            given.GetVKnotsAttr(),
            given.GetVRangeAttr(),
        ),
    ):
        size, degree = int(context.value(count, 0)), int(context.value(order, 4))
        values = context.array(knots, 1)[:, 0]
        if size < 2:
            context.remark(f"{prim.GetPath()}: a patch without points is left out")
            return None
        sides.append(_shares(context, prim, degree, values, size, context.value(ends)))
    u, v = sides
    if u.shape[1] * v.shape[1] != len(points):
        context.remark(f"{prim.GetPath()}: a patch whose points do not fit is left out")
        return None
    if len(context.value(given.GetTrimCurveCountsAttr(), [])):
        context.remark(f"{prim.GetPath()}: the trim curves are left out; the whole patch is shown")
    shares = (v[:, None, :, None] * u[None, :, None, :]).reshape(len(v) * len(u), -1)
    weights = context.array(given.GetPointWeightsAttr(), 1)[:, 0]
    shares *= weights if len(weights) == len(points) else 1.0
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1e-300)
    corner = (np.arange(len(v) - 1)[:, None] * len(u) + np.arange(len(u) - 1)).reshape(-1)
    quads = np.stack([corner, corner + 1, corner + len(u) + 1, corner + len(u)], axis=1)
    return shares @ points, quads, shares
