"""Subdivision surfaces of Catmull and Clark (Recursively generated B-spline surfaces on arbitrary
topological meshes, 1978), with sharp edges and corners (DeRose and others, Subdivision surfaces in
character animation, 1998), and those of Loop (Smooth subdivision surfaces based on triangles,
1987) with the same rules for what is sharp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["LoopTopology", "Topology", "levels_for"]

#: Maximum number of corners of a mesh after its subdivision, and of levels.
_MOST_CORNERS, _MOST_LEVELS = 200_000, 3
#: The weight of the middle of a triangle at an edge, where those of other faces have a quarter
#: (OpenSubdiv, rule "smooth" for triangles).
_TRIANGLE = 0.47


def levels_for(corners: int, most: int) -> int:
    """The number of times that a mesh of these corners is divided, if it may have `most` then."""
    most = min(most, _MOST_CORNERS)
    return sum(corners * 4**level <= most for level in range(1, _MOST_LEVELS + 1))


@dataclass
class Topology:
    """The faces of a mesh, and how values of points and corners become those of its parts: each
    corner of a face becomes a face of four corners. The points of the parts are the points before,
    then one for each edge, then one for each face.
    """

    #: Number of points.
    points: int
    #: Number of corners of each face; at least 1.
    counts: np.ndarray
    #: The point of each corner; one face after the other.
    indices: np.ndarray
    #: Sharp edges as rows of two points, and their sharpness: the number of levels they stay sharp.
    creases: np.ndarray
    sharpness: np.ndarray
    #: Points that stay where they are, and their sharpness.
    pins: np.ndarray
    pin_sharpness: np.ndarray
    #: Whether a point of one face only, at the border, stays where it is.
    keeps_corners: bool
    #: Whether edges of triangles take more from the triangles, which look smoother then.
    smooths_triangles: bool = False

    def __post_init__(self) -> None:
        self.starts = np.cumsum(self.counts) - self.counts
        self.face = np.repeat(np.arange(len(self.counts)), self.counts)
        last = self.starts[self.face] + self.counts[self.face] - 1
        at = np.arange(len(self.indices))
        #: The next and the previous corner of the same face.
        self.after = np.where(at == last, self.starts[self.face], at + 1)
        self.before = np.empty_like(self.after)
        self.before[self.after] = at
        ends = np.sort(np.stack([self.indices, self.indices[self.after]], axis=1), axis=1)
        keys, self.edge = np.unique(ends[:, 0] * self.points + ends[:, 1], return_inverse=True)
        self.edge = self.edge.reshape(-1)
        #: The two points of each edge.
        self.ends = np.stack([keys // self.points, keys % self.points], axis=1)
        given = np.sort(self.creases, axis=1)
        wanted = given[:, 0] * self.points + given[:, 1]
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        found = keys[place] == wanted
        self.crease = np.zeros(len(keys))
        self.crease[place[found]] = self.sharpness[found]
        #: True for edges across which the surface is not smooth.
        self.is_sharp = (np.bincount(self.edge, minlength=len(keys)) != 2) | (self.crease >= 0.5)

    @property
    def parents(self) -> np.ndarray:
        """The face of each part."""
        return self.face

    def _sum(self, at: np.ndarray, values: np.ndarray, size: int) -> np.ndarray:
        """Sums of rows by number."""
        columns = [np.bincount(at, column, minlength=size) for column in values.T]
        return np.stack(columns, axis=1)

    def centres(self, corners: np.ndarray) -> np.ndarray:
        """The mean of the values at the corners of each face."""
        return self._sum(self.face, corners, len(self.counts)) / self.counts[:, None]

    def smooth(self, values: np.ndarray) -> np.ndarray:
        """Values of the points of the parts, by the rules of the surface."""
        centres = self.centres(values[self.indices])
        middles = (values[self.ends[:, 0]] + values[self.ends[:, 1]]) / 2
        around = self._sum(self.edge, centres[self.face], len(self.ends)) / 2
        weights = np.where((self.counts == 3) & self.smooths_triangles, _TRIANGLE, 0.25)
        share = self._sum(self.edge, weights[self.face, None], len(self.ends))
        edges = np.where(self.is_sharp[:, None], middles, middles + share * (around - middles))
        valence = np.maximum(np.bincount(self.indices, minlength=self.points), 1)[:, None]
        faces = self._sum(self.indices, centres[self.face], self.points) / valence
        flat = self.ends.reshape(-1)
        degree = np.maximum(np.bincount(flat, minlength=self.points), 1)[:, None]
        rays = self._sum(flat, np.repeat(middles, 2, axis=0), self.points) / degree
        points = (faces + 2 * rays + (valence - 3) * values) / valence
        return np.concatenate([self._sharpened(values, points), edges, centres])

    def _sharpened(self, values: np.ndarray, points: np.ndarray) -> np.ndarray:
        """The values of points by the smooth rule, replaced at sharp edges and corners."""
        sharp = self.ends[self.is_sharp]
        sharp_degree = np.bincount(sharp.reshape(-1), minlength=self.points)
        others = self._sum(sharp.reshape(-1), values[sharp[:, ::-1].reshape(-1)], self.points)
        points = np.where((sharp_degree == 2)[:, None], (6 * values + others) / 8, points)
        stays = sharp_degree > 2
        stays[self.pins[self.pin_sharpness >= 0.5]] = True
        stays |= np.bincount(self.indices, minlength=self.points) == 0
        if self.keeps_corners:
            valence = np.bincount(self.indices, minlength=self.points)
            stays |= (valence == 1) & (sharp_degree == 2)
        return np.where(stays[:, None], values, points)

    def linear(self, values: np.ndarray) -> np.ndarray:
        """Values of the points of the parts, linear on edges."""
        middles = (values[self.ends[:, 0]] + values[self.ends[:, 1]]) / 2
        return np.concatenate([values, middles, self.centres(values[self.indices])])

    def of_corners(self, values: np.ndarray) -> np.ndarray:
        """Values of the corners of the parts, linear on each face."""
        parts = [
            values,
            (values + values[self.after]) / 2,
            self.centres(values)[self.face],
            (values + values[self.before]) / 2,
        ]
        return np.stack(parts, axis=1).reshape(-1, values.shape[1])

    def divided(self) -> Topology:
        """The parts; part i is of face `face[i]`."""
        edge = self.points + self.edge
        centre = self.points + len(self.ends) + self.face
        quads = np.stack([self.indices, edge, centre, edge[self.before]], axis=1)
        return self._finer(self.points + len(self.ends) + len(self.counts), quads)

    def _finer(self, points: int, faces: np.ndarray) -> Topology:
        """The topology of parts that have equally many corners: the rows of `faces`."""
        creased = np.flatnonzero(self.crease > 1)
        middle = self.points + creased
        halves = [np.stack([self.ends[creased, k], middle], axis=1) for k in (0, 1)]
        return type(self)(
            points,
            np.full(len(faces), faces.shape[1], dtype=np.int64),
            faces.reshape(-1),
            np.concatenate(halves),
            np.tile(self.crease[creased] - 1, 2),
            self.pins,
            self.pin_sharpness - 1,
            self.keeps_corners,
        )


class LoopTopology(Topology):
    """The faces of a mesh of triangles; each becomes four. The points of the parts are the points
    before, then one for each edge.
    """

    @property
    def parents(self) -> np.ndarray:
        return np.repeat(np.arange(len(self.counts)), 4)

    def smooth(self, values: np.ndarray) -> np.ndarray:
        middles = (values[self.ends[:, 0]] + values[self.ends[:, 1]]) / 2
        across = self._sum(self.edge, values[self.indices[self.before]], len(self.ends)) / 2
        edges = np.where(self.is_sharp[:, None], middles, (3 * middles + across) / 4)
        flat, others = self.ends.reshape(-1), self.ends[:, ::-1].reshape(-1)
        degree = np.maximum(np.bincount(flat, minlength=self.points), 1)[:, None]
        ring = self._sum(flat, values[others], self.points) / degree
        share = 5 / 8 - (3 / 8 + np.cos(2 * np.pi / degree) / 4) ** 2
        points = values + share * (ring - values)
        return np.concatenate([self._sharpened(values, points), edges])

    def linear(self, values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, (values[self.ends[:, 0]] + values[self.ends[:, 1]]) / 2])

    def of_corners(self, values: np.ndarray) -> np.ndarray:
        middles = (values + values[self.after]) / 2
        return self._parts(values, middles).reshape(-1, values.shape[1])

    def divided(self) -> Topology:
        parts = self._parts(self.indices[:, None], self.points + self.edge[:, None])
        return self._finer(self.points + len(self.ends), parts.reshape(-1, 3))

    @staticmethod
    def _parts(corners: np.ndarray, middles: np.ndarray) -> np.ndarray:
        """The corners of the parts, from rows for the corners of triangles and for the middles of
        the edges that follow them. The axes are the triangle, the corner of a part, and the column.
        """
        a, b, c = corners.reshape(-1, 3, corners.shape[1]).transpose(1, 0, 2)
        ab, bc, ca = middles.reshape(-1, 3, middles.shape[1]).transpose(1, 0, 2)
        return np.stack([a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca], axis=1)
