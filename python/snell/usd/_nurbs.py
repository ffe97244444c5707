"""Curves and surfaces of B-splines, with knots and weights (Piegl and Tiller, The NURBS Book)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import UsdGeom

from ._context import Context

__all__ = ["Patch", "curve_points", "patch"]

#: Number of pieces of each segment of a curve, maximum number of pieces of a side of a patch, and
#: maximum order.
_PIECES, _MOST_PIECES, _MOST_ORDER = 6, 400, 32


@dataclass
class _Side:
    """Points of a spline: for each point the first of its control points, and the shares of that
    and the following ones.
    """

    first: np.ndarray
    shares: np.ndarray

    def of(self, control: np.ndarray) -> np.ndarray:
        """The points, from rows for the control points."""
        order = self.shares.shape[1]
        return np.einsum("ij,ij...->i...", self.shares, control[self.first[:, None] + range(order)])


@dataclass
class Patch:
    """A grid of points on a patch, whose control points are in rows of constant v."""

    u: _Side
    v: _Side
    #: The weights of the control points, by v and u.
    weights: np.ndarray

    def of(self, control: np.ndarray) -> np.ndarray:
        """Values at the points, from those of the control points."""
        grid = control.reshape(*self.weights.shape, -1) * self.weights[..., None]
        made = self._swept(grid) / np.maximum(self._swept(self.weights[..., None]), 1e-300)
        return made.reshape(-1, control.shape[1])

    def _swept(self, grid: np.ndarray) -> np.ndarray:
        return self.u.of(self.v.of(grid).swapaxes(0, 1)).swapaxes(0, 1)

    @property
    def quads(self) -> np.ndarray:
        """The corners of the quadrilaterals between the points."""
        u, v = len(self.u.first), len(self.v.first)
        corner = (np.arange(v - 1)[:, None] * u + np.arange(u - 1)).reshape(-1)
        return np.stack([corner, corner + 1, corner + u + 1, corner + u], axis=1)


def _basis(order: int, knots: np.ndarray, at: np.ndarray) -> _Side:
    """The shares of the control points at some parameters (algorithm A2.2)."""
    count = len(knots) - order
    # The last parameter belongs to the last span that is not empty.
    filled = np.flatnonzero(knots[:-1] < knots[1:])
    filled = filled[(filled >= order - 1) & (filled < count)]
    last = int(filled[-1]) if len(filled) else order - 1
    span = np.clip(np.searchsorted(knots, at, side="right") - 1, order - 1, last)
    shares = np.zeros((len(at), order))
    shares[:, 0] = 1
    for degree in range(1, order):
        saved = np.zeros(len(at))
        for i in range(degree):
            after, before = knots[span + i + 1] - at, at - knots[span + 1 - degree + i]
            width = after + before
            part = shares[:, i] / np.where(width > 0, width, np.inf)
            shares[:, i] = saved + after * part
            saved = before * part
        shares[:, degree] = saved
    return _Side(span - order + 1, shares)


def _side(
    context: Context,
    prim: Any,
    order: int,
    knots: np.ndarray,
    count: int,
    ends: Any,
    most: int | None = None,
) -> _Side:
    """Points of a spline of `count` control points. Without knots that fit it is the polygon of its
    control points.
    """
    is_usable = 2 <= order <= min(count, _MOST_ORDER) and len(knots) == count + order
    if not is_usable or not np.all(np.diff(knots) >= 0) or not np.all(np.isfinite(knots)):
        context.remark(
            f"{prim.GetPath()}: the knots do not fit; straight lines between the control points "
            "are shown"
        )
        return _Side(np.arange(count), np.ones((count, 1)))
    low, high = knots[order - 1], knots[count]
    if ends is not None and low <= ends[0] < ends[1] <= high:
        low, high = ends
    pieces = (count - order + 1) * _PIECES
    return _basis(order, knots, np.linspace(low, high, min(pieces, most or pieces) + 1))


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
    weights = context.array(given.GetPointWeightsAttr(), 1)
    if len(weights) != len(control):
        weights = np.ones((len(control), 1))
    orders = np.resize(orders if len(orders) else [4], len(counts))
    lines, start, first = [], 0, 0
    for number, (order, count) in enumerate(zip(orders, counts, strict=True)):
        own = knots[first : first + max(count + order, 0)]
        end = ends[number] if number < len(ends) else None
        side = _side(context, prim, int(order), own, int(count), end)
        mine = slice(start, start + count)
        line = side.of(control[mine] * weights[mine])
        lines.append(line / np.maximum(side.of(weights[mine]), 1e-300))
        start, first = start + count, first + max(count + order, 0)
    lines = [line for line in lines if len(line) > 1]
    lengths = np.array([len(line) for line in lines], dtype=np.int64)
    return np.concatenate(lines) if lines else control[:0], lengths


def patch(context: Context, prim: Any) -> Patch | None:
    """A grid of points on a patch."""
    given = UsdGeom.NurbsPatch(prim)
    sides, sizes = [], []
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
        sizes.append(size)
        if not 2 <= size <= len(context.value(given.GetPointsAttr(), [])):
            context.remark(f"{prim.GetPath()}: a patch whose points do not fit is left out")
            return None
        values = context.array(knots, 1)[:, 0]
        sides.append(_side(context, prim, degree, values, size, context.value(ends), _MOST_PIECES))
    points = context.array(given.GetPointsAttr(), 3)
    if sizes[0] * sizes[1] != len(points):
        context.remark(f"{prim.GetPath()}: a patch whose points do not fit is left out")
        return None
    if len(context.value(given.GetTrimCurveCountsAttr(), [])):
        context.remark(f"{prim.GetPath()}: the trim curves are left out; the whole patch is shown")
    weights = context.array(given.GetPointWeightsAttr(), 1)
    if len(weights) != len(points):
        weights = np.ones((len(points), 1))
    return Patch(sides[0], sides[1], weights.reshape(sizes[1], sizes[0]))
