"""Triangles that reach over several tiles of a picture, cut at the borders of the tiles."""

from __future__ import annotations

import numpy as np

__all__ = ["cut_at_borders", "tiles_of"]

#: Tiles in a row, and rows.
_TILES = 10
#: Corners this near to a border are on it.
_NEAR = 1e-5
#: The largest number of triangles that are cut.
_MOST = 100_000


def tiles_of(places: np.ndarray) -> np.ndarray:
    """The number of the tile of each place: 0 for 1001, with ten tiles in a row."""
    u, v = np.clip(np.floor(places), 0, _TILES - 1).astype(np.int64).T
    return np.asarray(u + _TILES * v)


def cut_at_borders(
    corners: np.ndarray, places: np.ndarray, members: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Cuts those of the triangles `members` that reach over a border between tiles. `corners` has
    a row of numbers for each corner of each triangle, and `places` the two coordinates of each in
    which the tiles are unit squares. Returns the corners of all triangles that there are then, and
    the triangle that each was a part of. `None` if nothing is cut, or too much would be.
    """
    least, most = places.min(axis=1), places.max(axis=1)
    # The first border above the least coordinate; those outside of all tiles do not count.
    border = np.clip(np.floor(least + _NEAR) + 1, 1, _TILES - 1)
    crosses = ((least < border - _NEAR) & (most > border + _NEAR)).any(axis=1)
    crosses &= np.isin(np.arange(len(corners)), members) & np.isfinite(places).all(axis=(1, 2))
    if not 0 < np.count_nonzero(crosses) <= _MOST:
        return None
    made, origins = [corners[~crosses]], [np.flatnonzero(~crosses)]
    for triangle in np.flatnonzero(crosses):
        whole = np.concatenate([places[triangle], corners[triangle]], axis=1)
        for part in _parts(whole):
            fan = [np.stack([part[0], part[i], part[i + 1]]) for i in range(1, len(part) - 1)]
            made.append(np.stack(fan)[:, :, 2:])
            origins.append(np.full(len(fan), triangle))
    return np.concatenate(made), np.concatenate(origins)


def _parts(polygon: np.ndarray) -> list[np.ndarray]:
    """The parts of a convex polygon in single tiles. The first two columns are the coordinates."""
    parts = [polygon]
    for axis in (0, 1):
        for border in range(1, _TILES):
            parts = [half for part in parts for half in _halves(part, axis, border)]
    return parts


def _halves(polygon: np.ndarray, axis: int, border: int) -> list[np.ndarray]:
    """The parts of a convex polygon on both sides of a border."""
    side = polygon[:, axis] - border
    if (side <= _NEAR).all() or (side >= -_NEAR).all():
        return [polygon]
    halves = []
    for sign in (-1.0, 1.0):
        kept = []
        for i, corner in enumerate(polygon):
            j = (i + 1) % len(polygon)
            if sign * side[i] >= 0:
                kept.append(corner)
            if side[i] * side[j] < 0:
                kept.append(corner + (polygon[j] - corner) * (side[i] / (side[i] - side[j])))
        if len(kept) >= 3:
            halves.append(np.stack(kept))
    return halves
