"""The surface of meshes of cells, such as those of finite elements: triangles of surface cells, and
of the boundary of solid cells.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from snell.usd._polygons import triangulated

# Cells by kind, with a name as in meshio: the nodes of each cell, in the order of meshio and VTK.
Blocks = list[tuple[str, Any]]

# Faces of one number of corners: the corners `(m, k)`, and the loops of nodes around them, which
# are the same, or `(m, 2 k)` with the middles of edges.
_Faces = tuple[np.ndarray, np.ndarray]

# The faces of solid cells, by the numbers of their corners.
_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1)),
    "hexahedron": (
        (0, 4, 7, 3),
        (1, 2, 6, 5),
        (0, 1, 5, 4),
        (3, 7, 6, 2),
        (0, 3, 2, 1),
        (4, 5, 6, 7),
    ),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "penta_prism": (
        (0, 4, 3, 2, 1),
        (5, 6, 7, 8, 9),
        *((i, (i + 1) % 5, 5 + (i + 1) % 5, 5 + i) for i in range(5)),
    ),
    "hexa_prism": (
        (0, 5, 4, 3, 2, 1),
        (6, 7, 8, 9, 10, 11),
        *((i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i) for i in range(6)),
    ),
}

# Number of corners, and the edges whose middles are the next nodes of cells of second order.
_CORNERS: dict[str, int] = {"triangle": 3, "quad": 4, "line": 2, "vertex": 1}
_CORNERS |= {kind: 1 + max(max(face) for face in faces) for kind, faces in _FACES.items()}
_EDGES: dict[str, tuple[tuple[int, int], ...]] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "hexahedron": (
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6)),
        *((6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
    ),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "pyramid": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
}

# Cells of second order: their kind. Nodes in the middles of faces and cells follow those of edges.
_SECOND_ORDER = {
    "triangle6": "triangle",
    "triangle7": "triangle",
    "quad8": "quad",
    "quad9": "quad",
    "tetra10": "tetra",
    "tetra14": "tetra",
    "hexahedron20": "hexahedron",
    "hexahedron24": "hexahedron",
    "hexahedron27": "hexahedron",
    "wedge15": "wedge",
    "wedge18": "wedge",
    "pyramid13": "pyramid",
    "pyramid14": "pyramid",
    "pyramid19": "pyramid",
}

# The kinds of VTK by number. A pixel and a voxel have their corners in another order.
_VTK = {
    1: "vertex",
    2: "vertex",
    3: "line",
    4: "line",
    5: "triangle",
    6: "strip",
    7: "polygon",
    8: "pixel",
    9: "quad",
    10: "tetra",
    11: "voxel",
    12: "hexahedron",
    13: "wedge",
    14: "pyramid",
    15: "penta_prism",
    16: "hexa_prism",
    21: "line3",
    22: "triangle6",
    23: "quad8",
    24: "tetra10",
    25: "hexahedron20",
    26: "wedge15",
    27: "pyramid13",
    28: "quad9",
    29: "hexahedron27",
    32: "wedge18",
    33: "hexahedron24",
    34: "triangle7",
    37: "pyramid19",
}
_ORDERS = {"pixel": ("quad", [0, 1, 3, 2]), "voxel": ("hexahedron", [0, 1, 3, 2, 4, 5, 7, 6])}


def blocks_of_vtk(kinds: np.ndarray, offsets: np.ndarray, nodes: np.ndarray) -> Blocks:
    """Cells of VTK by kind: `kinds` has the number of each cell's kind, and its nodes are
    ``nodes[offsets[i]:offsets[i + 1]]``.
    """
    blocks: Blocks = []
    sizes = np.diff(offsets)
    for number in np.unique(kinds):
        cells = np.flatnonzero(kinds == number)
        kind = _VTK.get(int(number))
        if kind is None:
            raise TypeError(
                f"vertices: the mesh has cells of VTK's kind {number}, which Snell does not know; "
                "give it the surface: mesh.extract_surface()"
            )
        for size in np.unique(sizes[cells]):
            chosen = cells[sizes[cells] == size]
            rows = nodes[offsets[chosen][:, None] + np.arange(size)]
            if kind in _ORDERS:
                other, order = _ORDERS[kind]
                blocks.append((other, rows[:, order]))
            elif kind == "strip":
                for i in range(size - 2):
                    order = [i, i + 1, i + 2] if i % 2 == 0 else [i + 1, i, i + 2]
                    blocks.append(("triangle", rows[:, order]))
            else:
                blocks.append((kind, rows))
    return blocks


def surface(points: np.ndarray, blocks: Blocks, library: str) -> np.ndarray:
    """The triangles `(m, 3)` of the surface of cells.

    Surface cells are taken as they are, solid cells by the faces that only one of them has, outer
    side outwards. A surface cell on such a face is left out. Polygons are divided into triangles;
    cells of second order have those between corners and middles of edges. Lines and points are left
    out, with a warning; if there is nothing else, that is an error.
    """
    flat: list[_Faces] = []
    solid: list[_Faces] = []
    others: list[str] = []
    for kind, cells in blocks:
        if len(cells) == 0:
            continue
        base = _SECOND_ORDER.get(kind, kind)
        if kind.startswith(("vertex", "line")):
            others.append(kind)
        elif base in _FACES:
            solid += _faces_of(points, base, np.asarray(cells), base != kind)
        elif kind.startswith("polyhedron"):
            solid += _faces_of_polyhedra(points, cells)
        elif kind.startswith("polygon"):
            flat += _polygons(cells)
        elif base in _CORNERS:
            rows = np.asarray(cells)
            corners = list(range(_CORNERS[base]))
            flat.append((rows[:, corners], _loops(base, rows, corners, base != kind)))
        else:
            raise TypeError(
                f"vertices: the mesh of {library} has cells of the kind {kind}, which Snell does "
                "not know; give it the triangles of its surface"
            )
    if others and not flat and not solid:
        raise TypeError(
            f"vertices: the mesh of {library} has only cells of the kind {', '.join(others)}; "
            "points are added by add_spheres(points, radius), lines by add_curves(points, radius)"
        )
    if others:
        warnings.warn(
            f"vertices: the cells of the kind {', '.join(others)} are left out", stacklevel=2
        )
    triangles = [_triangles(points, *faces) for faces in _boundary(solid, flat)]
    return np.concatenate([np.empty((0, 3), np.int64), *triangles])


def _loops(kind: str, cells: np.ndarray, corners: Sequence[int], is_curved: bool) -> np.ndarray:
    if not is_curved:
        return cells[:, list(corners)]
    middles = {frozenset(edge): _CORNERS[kind] + i for i, edge in enumerate(_EDGES[kind])}
    ends = itertools.pairwise([*corners, corners[0]])
    nodes = itertools.chain.from_iterable((a, middles[frozenset((a, b))]) for a, b in ends)
    return cells[:, list(nodes)]


def _faces_of(
    points: np.ndarray, kind: str, cells: np.ndarray, is_curved: bool
) -> Iterable[_Faces]:
    """The faces of solid cells, outer side outwards."""
    middle = points[cells[:, : _CORNERS[kind]]].mean(axis=1)
    for face in _FACES[kind]:
        corners, loops = cells[:, list(face)], _loops(kind, cells, face, is_curved)
        yield _outwards(points, corners, loops, middle)


def _outwards(
    points: np.ndarray, corners: np.ndarray, loops: np.ndarray, middle: np.ndarray
) -> _Faces:
    """Faces turned so that their outer side is away from the middles of their cells."""
    places = points[corners]
    center = places.mean(axis=1)
    normal = np.cross(places[:, 1] - center, places[:, 2] - center)
    for i in range(2, places.shape[1]):
        after = places[:, (i + 1) % places.shape[1]]
        normal = normal + np.cross(places[:, i] - center, after - center)
    is_inwards = (normal * (center - middle)).sum(axis=1) < 0
    # The first node stays where it is.
    corners = np.where(is_inwards[:, None], np.roll(corners[:, ::-1], 1, axis=1), corners)
    loops = np.where(is_inwards[:, None], np.roll(loops[:, ::-1], 1, axis=1), loops)
    return corners, loops


def _faces_of_polyhedra(points: np.ndarray, cells: Any) -> Iterable[_Faces]:
    for faces in cells:
        nodes = np.unique(np.concatenate([np.asarray(face) for face in faces]))
        middle = points[nodes].mean(axis=0, keepdims=True)
        for face in faces:
            row = np.asarray(face)[None]
            yield _outwards(points, row, row, middle)


def _polygons(cells: Any) -> Iterable[_Faces]:
    by_size: dict[int, list[Any]] = {}
    for cell in cells:
        by_size.setdefault(len(cell), []).append(cell)
    for rows in map(np.asarray, by_size.values()):
        if rows.shape[1] > 2:
            yield rows, rows


def _boundary(solid: list[_Faces], flat: list[_Faces]) -> list[_Faces]:
    """The faces of solid cells that only one cell has, and the flat cells not among them."""
    if not solid:
        return flat
    kept: list[_Faces] = []
    for side in sorted({corners.shape[1] for corners, _ in (*solid, *flat)}):
        ours = [faces for faces in solid if faces[0].shape[1] == side]
        both = [*ours, *(faces for faces in flat if faces[0].shape[1] == side)]
        count = sum(len(corners) for corners, _ in ours)
        keys = np.sort(np.concatenate([corners for corners, _ in both]), axis=1)
        which = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
        uses = np.bincount(which[:count], minlength=which.max() + 1)
        # A flat cell on an inner face is a surface of its own.
        keep = np.concatenate([uses[which[:count]] == 1, uses[which[count:]] != 1])
        parts = np.split(keep, np.cumsum([len(corners) for corners, _ in both])[:-1])
        kept += [(c[part], loops[part]) for (c, loops), part in zip(both, parts, strict=True)]
    return kept


def _triangles(points: np.ndarray, corners: np.ndarray, loops: np.ndarray) -> np.ndarray:
    """The triangles of faces."""
    count, size = loops.shape
    if corners.shape[1] == size:
        places = triangulated(points, np.full(count, size), loops.ravel(), np.empty(0, np.int64))[0]
        triangles: np.ndarray = loops.ravel()[places]
        return triangles
    # Of second order: the corners are cut off at the middles of edges.
    cut = [(i, i + 1, (i - 1) % size) for i in range(0, size, 2)]
    inner = [(1, b, c) for b, c in itertools.pairwise(range(3, size, 2))]
    return np.concatenate([loops[:, list(triangle)] for triangle in (*cut, *inner)])
