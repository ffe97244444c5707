"""Polygons as triangles."""

from __future__ import annotations

import numpy as np

__all__ = ["triangulated"]


def triangulated(
    points: np.ndarray, counts: np.ndarray, indices: np.ndarray, holes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the corners of triangles in the list of corners of faces, and the face of each
    triangle.
    """
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    keep = np.ones(len(counts), dtype=bool)
    keep[holes[(holes >= 0) & (holes < len(counts))]] = False
    parts: list[np.ndarray] = []
    owners: list[np.ndarray] = []
    for size in np.unique(counts[keep]):
        faces = np.nonzero(keep & (counts == size))[0]
        if size < 3:
            continue
        first = starts[faces]
        if size == 3:
            parts.append(first[:, None] + np.arange(3))
            owners.append(faces)
        elif size == 4:
            parts.append(_halves(points, indices, first))
            owners.append(np.repeat(faces, 2))
        else:
            for face, start in zip(faces, first, strict=True):
                cut = _ears(points[indices[start : start + size]].astype(np.float64))
                parts.append(start + cut)
                owners.append(np.full(len(cut), face))
    if not parts:
        return np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64)
    corners, owner = np.concatenate(parts), np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return corners[order], owner[order]


def _halves(points: np.ndarray, indices: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Cuts quadrilaterals along the diagonal for which both triangles turn the same way, also in
    faces that are not convex.
    """
    p = points[indices[first[:, None] + np.arange(4)]].astype(np.float64)
    a = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    b = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])
    other = np.einsum("ij,ij->i", a, b) < 0
    one = np.where(other[:, None], [0, 1, 3], [0, 1, 2])
    two = np.where(other[:, None], [1, 2, 3], [0, 2, 3])
    return np.stack([first[:, None] + one, first[:, None] + two], axis=1).reshape(-1, 3)


def _ears(p: np.ndarray) -> np.ndarray:
    """Triangles of a polygon, by ear clipping."""
    following = np.roll(p, -1, axis=0)
    normal = np.cross(p, following).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(p, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat * [-1.0, 1.0]
    rest, found = list(range(len(p))), []
    while len(rest) > 3:
        for i in range(len(rest)):
            ear = [rest[i - 1], rest[i], rest[(i + 1) % len(rest)]]
            if _is_ear(flat, ear, rest):
                break
        else:
            # A polygon that intersects itself gets arbitrary triangles.
            i, ear = 1, rest[:3]
        found.append(ear)
        rest.pop(i)
    return np.array([*found, rest])


def _is_ear(flat: np.ndarray, ear: list[int], rest: list[int]) -> bool:
    """True if a corner turns left and no other point of the polygon is inside its triangle."""
    a, b, c = (flat[i] for i in ear)
    if _area(a, b, c) <= 0:
        return False
    others = (flat[i] for i in rest if i not in ear)
    return not any(
        _area(a, b, q) >= 0 and _area(b, c, q) >= 0 and _area(c, a, q) >= 0 for q in others
    )


def _area(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
